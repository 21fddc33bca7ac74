"""Where a step's solver begins: the last steps' reactions, matched contact by contact and extrapolated in time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.contact_detection.contacts import Contacts
from fcsim.problem import Reduced, natural_map_residual
from fcsim.timestep.reactions.reactions import Reactions, transferred

MEMORY = 4
"""How many past steps are remembered; `warm_start` looks at all but the oldest."""


def warm_start(problem: Reduced, contacts: Contacts, memory: Sequence[Reactions], enough: float = 0.0) -> FloatArray:
    """Return the best starting point r (m,) that the last steps' reactions (newest first) suggest; zero without any.

    With r1, r2, r3 of the last three steps the candidates are r1, the linear 2 r1 - r2, and r1 + r2 - r3: linear as well, and exact for
    what alternates from step to step, as stick and slip do at theta = 1/2 in steady loading. The one of the smallest error is taken,
    but r1 where its residual is `enough` [unit of q]: among answers round-off would choose, and where reactions are not unique (barrels
    between two walls) differences of former steps would add up to forces that nothing asks for.
    """
    return _best(problem, transferred(memory[: MEMORY - 1], contacts), enough)


def nearest_start(problem: Reduced, contacts: Contacts, memory: Sequence[Reactions], enough: float = 0.0) -> FloatArray:
    """As `warm_start`, but of the candidates the one whose rule would have met the last step best from the three before it: for Newton's
    method, which begins with the last step's statuses.

    The error measures badly how near a start is. Where reactions of sticking contacts are wrong by little, velocities are wrong by much;
    r1, wrong by more but smoothly, has the smaller error. On a wall in shear 2 r1 - r2 is four to a hundred times nearer to the answer.
    """
    if len(memory) < MEMORY:
        return warm_start(problem, contacts, memory, enough)
    r = transferred(memory[:MEMORY], contacts)
    missed = [float(np.linalg.norm(r[0] - candidate)) for candidate in _suggested(r[1:])]
    if _residual(problem, r[0]) <= enough:  # the first that asks for W
        return r[0]
    return _suggested(r)[int(np.argmin(missed))]


def _best(problem: Reduced, r: Sequence[FloatArray], enough: float) -> FloatArray:
    """What follows r (m,), newest first, with the smallest residual."""
    if not r:
        return np.zeros(len(problem.q))
    candidates = _suggested(r)
    if len(candidates) == 1:
        return candidates[0]
    residuals = []
    for candidate in candidates:  # one product a candidate: BLAS' matrix product is slower than that for three columns
        residuals.append(_residual(problem, candidate))
        if residuals[0] <= enough:
            break
    return candidates[int(np.argmin(residuals))]


def _suggested(r: Sequence[FloatArray]) -> list[FloatArray]:
    """What follows the reactions r (m,), newest first, by each rule for which there are enough."""
    candidates = [r[0]]
    if len(r) > 1:
        candidates.append(2 * r[0] - r[1])
    if len(r) > 2:
        candidates.append(r[0] + r[1] - r[2])
    return candidates


def _residual(problem: Reduced, r: FloatArray) -> float:
    """The residual of r (m,) [unit of q]."""
    u = problem.local.delassus.affine(r, problem.q)
    return natural_map_residual(r, u, problem.mu, problem.dimension, problem.compliance)
