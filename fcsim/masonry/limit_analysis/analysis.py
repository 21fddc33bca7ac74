"""The limit analysis of a problem: both laws of slip, and the joints of the mechanism."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.masonry.limit_analysis.joints import Joint, joints_of
from fcsim.masonry.limit_analysis.limit import LimitLoad, associative_limit, coulomb_limit, lowest_limit
from fcsim.masonry.limit_analysis.limit_problem import LimitProblem, limit_problem
from fcsim.masonry.problem import MasonryProblem


@dataclass(frozen=True, eq=False)
class LimitAnalysis:
    """What limit analysis says of a problem: joints with the forces and the mechanism of `lowest`, which is `coulomb` or a state of
    collapse below it that other forces led to."""

    problem: MasonryProblem
    limit: LimitProblem
    associative: LimitLoad
    coulomb: LimitLoad
    lowest: LimitLoad
    joints: tuple[Joint, ...]


def analyse(problem: MasonryProblem, tolerance: float | None = None) -> LimitAnalysis:
    """Return the limit analysis of a problem with rigid blocks; tolerance [m]: see `limit_problem`."""
    limit = limit_problem(problem, tolerance=tolerance)
    upper = associative_limit(limit)
    coulomb = coulomb_limit(limit, upper)
    least = lowest_limit(limit, upper, coulomb)
    if coulomb.outcome == "undecided":
        coulomb = least
    u = limit.H.T @ least.v[limit.free]
    if least.dilatancy:  # what slip opens is no opening
        parting = u.reshape(-1, problem.dimension)
        slip = np.linalg.norm(parting[:, 1:], axis=1)
        parting[:, 0] -= np.minimum(parting[:, 0], 1.001 * least.dilatancy * limit.contacts.mu * slip)
    names = tuple(block.name for block in problem.blocks)
    return LimitAnalysis(problem, limit, upper, coulomb, least, joints_of(limit.contacts, names, least.r, u))
