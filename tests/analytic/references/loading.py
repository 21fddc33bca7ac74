"""Load steps of the published problems."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh.blocks import rigid_box, rigid_rectangle
from fcsim.mesh.part import Body, Part
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.limits import Limits
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step

ANY = Limits(rotation=np.inf, strain=np.inf, inversion=True)


def pair(
    model: Model,
    slave: tuple[str, str],
    master: tuple[str, str],
    mu: float = 0.0,
    alert: float = 1.0,
    rule: Any = "mortar",
    normals: Any = "facet",
) -> SurfacePair:
    return SurfacePair(contact_surface(model, [slave]), contact_surface(model, [master]), mu, alert, rule, normals=normals)


def loaded(
    model: Model, detection: Any, steps: int, *, last: float = 1.0, eta: float = 0.0, tol: float = 1e-8, **settings: Any
) -> list[Step]:
    """Load steps to the time `last`, any strain and rotation allowed, without a witness; detection: pairs, or a detection."""
    detector = Detector(detection, model.n_nodes) if isinstance(detection, list | tuple) else detection
    settings.setdefault("witness", None)
    scheme = QuasiStatic(last / steps, eta=eta)
    return list(Simulation(model, detector, scheme, steps, SolverSettings(tol=tol), limits=ANY, **settings))


def alone(part: Part, supports: Sequence[Any], loads: Sequence[Any] = (), steps: int = 1) -> tuple[Model, list[Step]]:
    """The steps to t = 1 of a body "body" that touches nothing."""
    d, far = part.dimension, 1e3 * float(np.ptp(part.points))
    rigid = (rigid_rectangle if d == 2 else rigid_box)("far", (1.0,) * d, (0.0,) * (d - 1) + (far,), 1.0)
    model = build_model([Body("body", part), rigid], supports=[*supports, held("far", d)], loads=list(loads))
    return model, loaded(model, [pair(model, ("body", "x+"), ("far", "y-"), alert=1e-3, rule="nodes")], steps)


def held(name: str, d: int) -> Support:
    return Support(name, ("x", "y", "rz") if d == 2 else ("x", "y", "z", "rx", "ry", "rz"))


def displacement(model: Model, step: Step, body: str) -> np.ndarray:
    """(nn, d) [m] of a deformable body's nodes."""
    return on_nodes(model, step.state.x, body)


def support_force(model: Model, step: Step, body: str) -> np.ndarray:
    """(nn, d) [N] of a deformable body's nodes."""
    return on_nodes(model, step.support_impulse, body)


def contact_force(model: Model, step: Step, body: str) -> np.ndarray:
    """(nn, d) [N] on a deformable body's nodes."""
    return on_nodes(model, step.H @ step.result.r, body)


def on_nodes(model: Model, values: np.ndarray, body: str) -> np.ndarray:
    number = model.number[body]
    return values[model.dof_offset[number] : model.dof_offset[number + 1]].reshape(-1, model.dimension)
