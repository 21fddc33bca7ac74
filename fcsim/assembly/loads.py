"""Loads: tractions and volume forces on deformable bodies, forces and moments on rigid ones, times functions of the time."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fcsim.assembly import elasticity
from fcsim.assembly.supports import DIRECTIONS, TimeFunction
from fcsim.errors import InputError
from fcsim.mesh.part import Body, RigidBody

if TYPE_CHECKING:
    from fcsim.assembly.model import Model

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Traction:
    """A force per area [Pa] (2D: per length and thickness) on a deformable body's surface, in world axes, times factor(t)."""

    body: str
    surface: str
    traction: tuple[float, ...]
    factor: TimeFunction = field(default=lambda t: 1.0)


@dataclass(frozen=True)
class Force:
    """A force [N] at a rigid body's centre of mass, and a moment [N m] (3 entries, 2D: 1), in world axes, times factor(t)."""

    body: str
    force: tuple[float, ...]
    moment: tuple[float, ...] | None = None
    factor: TimeFunction = field(default=lambda t: 1.0)


@dataclass(frozen=True)
class BodyForce:
    """A force per volume [N/m^3] on a deformable body, in world axes, times factor(t)."""

    body: str
    density: tuple[float, ...]
    factor: TimeFunction = field(default=lambda t: 1.0)


Load = Traction | Force | BodyForce


def load_vector(model: Model, load: Load) -> FloatArray:
    number = model.body_number(load.body)
    body, d = model.bodies[number], model.dimension
    vector = np.zeros(model.n_dofs)
    own = slice(model.dof_offset[number], model.dof_offset[number + 1])
    if isinstance(load, Force):
        if not isinstance(body, RigidBody):
            raise InputError(f"Force on body {load.body!r}: expected a rigid body; use Traction or BodyForce on a deformable one")
        moment = (0.0,) * (len(DIRECTIONS[d]) - d) if load.moment is None else load.moment
        values = np.concatenate([load.force, moment])
        if values.shape != (len(DIRECTIONS[d]),) or not np.all(np.isfinite(values)):
            raise InputError(
                f"Force on body {load.body!r}: expected {d} force and {len(DIRECTIONS[d]) - d} moment components, finite numbers, got "
                f"{load.force} and {load.moment}"
            )
        vector[own] = values
        return vector
    if not isinstance(body, Body):
        raise InputError(f"{type(load).__name__} on body {load.body!r}: expected a deformable body; use Force on a rigid one")
    values = np.asarray(load.traction if isinstance(load, Traction) else load.density, dtype=np.float64)
    if values.shape != (d,):
        raise InputError(f"{type(load).__name__} on body {load.body!r}: expected {d} components, got {values.shape}")
    in_part_axes = body.rotation.T @ values
    if isinstance(load, Traction):
        nodal = elasticity.traction(body.part, load.surface, in_part_axes)
    else:
        nodal = elasticity.body_force(body.part, in_part_axes)
    vector[own] = (nodal.reshape(-1, d) @ body.rotation.T).ravel()
    return vector
