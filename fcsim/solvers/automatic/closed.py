"""What the contacts that are closed at a race's best iterate hold."""

from __future__ import annotations

import numpy as np

from fcsim.solvers.automatic.race import Race
from fcsim.solvers.newton.systems._velocity_kernels import velocities_held

STICKING = 1e-6
"""Share of the friction cone next to its surface where a contact is not said to stick."""


def closed(race: Race) -> int:
    """Contact unknowns whose reaction is not zero at the best iterate."""
    return race.problem.dimension * int(np.count_nonzero(race.best_r().reshape(race.problem.nc, -1)[:, 0]))


def singular_here(race: Race) -> bool:
    """Whether Newton's matrix is sure to be singular here, since the closed contacts hold more velocities than the bodies have.

    A sticking contact holds all of its velocity, a sliding one its normal one at least.
    """
    motion = race.problem.delassus.motion
    if motion is None or motion.own is not None:
        return False
    held = velocities_held(race.best_r(), race.problem.mu, 1 - STICKING, race.problem.dimension)
    return int(held) > motion.M.shape[0]


def faces(race: Race) -> bool:
    """Whether faces of bodies hold one another: in 3D, the closed contacts hold more velocities than the bodies have.

    Three and more points a face hold nine and more unknowns of two bodies' six velocities, an edge's two points in 2D four of three.
    """
    return race.problem.dimension == 3 and singular_here(race)
