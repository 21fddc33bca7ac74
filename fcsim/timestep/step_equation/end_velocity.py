"""The end of a step of rigid bodies that turn, from where their contacts are struck: velocity, and what their supports do meanwhile."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model
from fcsim.timestep.state import State


def end_velocity(model: Model, start: FloatArray, v: FloatArray, rigid_mass: FloatArray, dt: float) -> FloatArray:
    """Return v (n_dofs,) with the omega+ of R+ = exp(dt omega+) R_start that keeps the angular momentum `rigid_mass` v [N m s].

    start (n_dofs,) the configuration of the last rotation's beginning; dt [s] its length. Rotations of bodies of whose rotations some are
    driven stay as they are.
    """
    if not model.rigid_bodies.turning:
        return v
    d = model.dimension
    angular = np.einsum("aij,aj->ai", rigid_mass, model.rigid_part(v))[:, d:]
    free = model.rigid_free[:, d:]
    omega = model.rigid_part(v)[:, d:]
    mass = model.rigid_bodies.free_end_mass(model.rigid_part(start), angular, omega, dt, free)
    end = v.copy()
    turned = np.linalg.solve(mass[:, d:, d:], angular[..., None])[..., 0]
    model.rigid_part(end)[:, d:] = np.where(free.all(axis=1)[:, None], turned, omega)
    return end


def turning_impulse(model: Model, v: FloatArray, rigid_mass: FloatArray, after: State) -> FloatArray:
    """Angular impulses (n_dofs,) [N m s] by which supports change the momentum of what they turn, from `rigid_mass` v where contacts are
    struck to the state after: the gyroscopic moment. Free rotations keep their momentum; zero where no inertia turns."""
    if not model.rigid_bodies.turning or model.rigid_free[:, model.dimension :].all():
        return np.zeros_like(v)
    change = np.zeros_like(v)
    now = np.einsum("aij,aj->ai", model.rigid_mass(after.x), model.rigid_part(after.v))
    model.rigid_part(change)[:, model.dimension :] = (now - np.einsum("aij,aj->ai", rigid_mass, model.rigid_part(v)))[:, model.dimension :]
    return model.driven_share(change)
