"""Problems with another question: the same blocks pushed, or tilted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fcsim.arrays import FloatArray, is_vector
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.masonry.problem import GRAVITY, Acceleration, MasonryProblem, expect_problem


def pushed(problem: MasonryProblem, direction: tuple[float, float, float]) -> MasonryProblem:
    """Return the problem with another load in place of those that grow: the weight of every block (g = 9.81 m/s^2) in a direction."""
    x, y, z = (GRAVITY * unit(problem, direction)).tolist()
    kept = tuple(load for load in problem.loads if not load.scaled)
    return replace(problem, loads=(*kept, Acceleration((x, y, z), scaled=True)))


def tilted(problem: MasonryProblem, direction: tuple[float, float, float]) -> MasonryProblem:
    """Return the problem with the load of a table that tilts, whose tangent is the multiplier.

    In the axes of the table all loads turn by the angle a, those down (-z) towards the horizontal `direction`: cos a D + sin a D', which is
    in equilibrium iff D + tan a D' is, since forces without tension or cohesion scale. Loads that grow already are left out.
    """
    along = unit(problem, direction)
    if abs(along[2]) > 1e-9:
        raise InputError(f"direction: expected a horizontal one to tilt to, got {direction}")

    def turned(value: tuple[float, float, float]) -> tuple[float, float, float]:
        forward = float(np.dot(value, along))
        x, y, z = (-value[2] * along + np.array([0.0, 0.0, forward])).tolist()
        return x, y, z

    kept = tuple(load for load in problem.loads if not load.scaled)
    return replace(problem, loads=(*kept, *(replace(load, value=turned(load.value), scaled=True) for load in kept)))


def unit(problem: MasonryProblem, direction: tuple[float, float, float]) -> FloatArray:
    """The direction (3,) at the length 1; InputError where it has none, or leaves the plane of a plane problem."""
    expect_problem(problem, "direction")
    length = float(np.linalg.norm(direction)) if is_vector(direction, 3) else 0.0
    if not 0 < length < np.inf:
        raise InputError(f"direction: expected three finite numbers, not all 0, got {shown(direction)}")
    if problem.dimension == 2 and direction[1] != 0:
        raise InputError(f"direction: expected one in the plane of x and z, got {direction}")
    return np.asarray(direction, dtype=np.float64) / length
