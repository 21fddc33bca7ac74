"""Problems with another question: the same blocks pushed, or tilted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fcsim.arrays import FloatArray, is_vector
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.masonry.problem import GRAVITY, Acceleration, MasonryProblem, PointForce, expect_problem

_ALONG_AXIS = 1e-6  # of a load: round-off of a direction in digits


def pushed(problem: MasonryProblem, direction: tuple[float, float, float]) -> MasonryProblem:
    """Return the problem with another load in place of those that grow: the weight of every block (g = 9.81 m/s^2) in a direction."""
    x, y, z = (GRAVITY * unit(problem, direction)).tolist()
    kept = tuple(load for load in problem.loads if not load.scaled)
    return replace(problem, loads=(*kept, Acceleration((x, y, z), scaled=True)))


def tilted(problem: MasonryProblem, direction: tuple[float, float, float]) -> MasonryProblem:
    """Return the problem with the load of a table that tilts, whose tangent is the multiplier.

    In the axes of the table all loads turn by the angle a about its axis, those down (-z) towards the horizontal `direction`: cos a D +
    sin a D', which is in equilibrium iff D + tan a D' is, since forces without tension or cohesion scale. Moments turn as forces do. Loads
    that grow already are left out. InputError for loads along the axis, which stay as they are and are no multiple of the others.
    """
    along = unit(problem, direction)
    if abs(along[2]) > 1e-9:
        raise InputError(f"direction: expected a horizontal one to tilt to, got {direction}")
    axis = np.cross((0.0, 0.0, 1.0), along)

    def turned(value: tuple[float, float, float]) -> tuple[float, float, float]:
        forward = float(np.dot(value, along))
        x, y, z = (-value[2] * along + np.array([0.0, 0.0, forward])).tolist()
        return x, y, z

    kept = tuple(load for load in problem.loads if not load.scaled)
    growing: list[Acceleration | PointForce] = []
    for load in kept:
        moment = load.moment if isinstance(load, PointForce) else (0.0, 0.0, 0.0)
        for what, value in (("load", load.value), ("moment", moment)):
            if abs(np.dot(value, axis)) > _ALONG_AXIS * np.linalg.norm(value):
                on = f" on {load.block!r}" if isinstance(load, PointForce) else ""
                raise InputError(
                    f"tilt of {problem.name!r}: expected loads across the axis of the table, which turn with it, got the {what} "
                    f"{tuple(value)}{on}: tilt in another direction, or push"
                )
        if isinstance(load, PointForce):
            growing.append(replace(load, value=turned(load.value), moment=turned(moment), scaled=True))
        else:
            growing.append(replace(load, value=turned(load.value), scaled=True))
    return replace(problem, loads=(*kept, *growing))


def unit(problem: MasonryProblem, direction: tuple[float, float, float]) -> FloatArray:
    """The direction (3,) at the length 1; InputError where it has none, or leaves the plane of a plane problem."""
    expect_problem(problem, "direction")
    length = float(np.linalg.norm(direction)) if is_vector(direction, 3) else 0.0
    if not 0 < length < np.inf:
        raise InputError(f"direction: expected three finite numbers, not all 0, got {shown(direction)}")
    if problem.dimension == 2 and direction[1] != 0:
        raise InputError(f"direction: expected one in the plane of x and z, got {direction}")
    return np.asarray(direction, dtype=np.float64) / length
