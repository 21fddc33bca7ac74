"""A block that turns freely, about no axis of its inertia, and what it keeps."""

from typing import Any

import numpy as np

from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.mesh.blocks import brick, rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.part import Body
from fcsim.timestep.state import State

FAR = 1e3


def spinning(material: Any, omega: float, d: int = 2, **options: Any) -> tuple[Model, State]:
    """A block that turns with |omega| [rad/s], and a rigid one that nothing touches."""
    if d == 3:
        part, far = brick("b", (0.4, 0.2, 0.1), (3, 2, 1), material), rigid_box("far", (1, 1, 1), (FAR, 0, 0), 1.0)
    else:
        part, far = rectangle("b", (0.4, 0.2), (4, 2), material), rigid_rectangle("far", (1, 1), (FAR, 0), 1.0)
    held = Support("far", ("x", "y", "rz") if d == 2 else ("x", "y", "z", "rx", "ry", "rz"))
    model = build_model([Body("block", part), far], supports=[held], **options)
    X = part.points - part.points.mean(axis=0)
    axis = omega * (np.array([2.0, 1.0, 2.0]) / 3 if d == 3 else np.array([0, 0, 1.0]))
    v = np.zeros(model.n_dofs)
    v[: model.n_elastic] = np.cross(axis, np.column_stack([X, np.zeros((len(X), 3 - d))]))[:, :d].ravel()
    return model, State(0.0, np.zeros(model.n_dofs), v)


def angular_momentum(model: Model, state: State) -> np.ndarray:
    """About the origin, (3,): of the deformable bodies."""
    d, n = model.dimension, model.n_elastic
    zeros = np.zeros((n // d, 3 - d))
    arm = np.column_stack([model.reference.ravel()[:n].reshape(-1, d) + state.x[:n].reshape(-1, d), zeros])
    momentum = np.column_stack([model.apply_mass(state.v)[:n].reshape(-1, d), zeros])
    return np.cross(arm, momentum).sum(axis=0)
