"""The state of a simulation at one time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model


@dataclass(frozen=True, eq=False)
class State:
    """t [s]; x (n_dofs,) displacement [m, rad]; v (n_dofs,) velocity [m/s, rad/s]; driven dofs included.

    internal (n_variables,): internal variables of nonlinear materials, None = those at the beginning, see `NonlinearBodies`
    rate, inertia (n_dofs,): what the generalised-alpha scheme keeps beside, the rate of x [m/s, rad/s] and M v' of smooth motion [N, N m]
    """

    t: float
    x: FloatArray
    v: FloatArray
    rate: FloatArray | None = None
    inertia: FloatArray | None = None
    internal: FloatArray | None = None


def at_rest(model: Model, t: float = 0.0) -> State:
    """The reference configuration; driven dofs have the velocity prescribed at t, all others none."""
    v = np.zeros(model.n_dofs)
    v[model.driven_dofs] = model.driven_velocity(t)
    return State(t, np.zeros(model.n_dofs), v)
