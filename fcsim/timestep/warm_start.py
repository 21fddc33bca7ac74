"""Where a step's solver begins: the last steps' reactions, matched contact by contact and extrapolated in time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray
from fcsim.brief import brief
from fcsim.contact_detection.contacts import Contacts
from fcsim.problem import Reduced, natural_map_residual

MEMORY = 4
"""How many past steps are remembered; `warm_start` looks at all but the oldest."""


_SAME_WAY = 0.5
"""Cosine between a contact's normals before and after some motion; where it is less the contact is another one, of the far side."""


@dataclass(frozen=True, eq=False)
class Reactions:
    """The reactions of a step, to be matched contact by contact: identity (nc,), frame (nc, d, d), r (nc, d) in that frame, with rolling
    moments (nc, 5), with spinning moments (nc, 6)."""

    identity: NDArray[np.int64]
    frame: FloatArray
    r: FloatArray

    __repr__ = brief

    def transfer(self, contacts: Contacts, rows: int | None = None) -> FloatArray:
        """Return r (m,) for new contacts: the same vectors in space where the contact is known, zero where it is new.

        rows: unknowns a contact, None = d.
        """
        d = contacts.dimension
        r = np.zeros((len(contacts), d if rows is None else rows))
        if len(self.identity) and len(contacts):
            place = np.minimum(np.searchsorted(self.identity, contacts.identity), len(self.identity) - 1)
            known = np.flatnonzero(self.identity[place] == contacts.identity)
            old = place[known]
            frame, before = contacts.frame[known], self.frame[old]
            r[known, :d] = np.einsum("aij,aj->ai", frame, np.einsum("akj,ak->aj", before, self.r[old, :d]))  # at once: three times as long
            if min(r.shape[1], self.r.shape[1]) > 3:
                moments = self.r[old, 3:5]
                r[known, 3:5] = moments if d == 2 else np.einsum("aij,akj,ak->ai", frame[:, 1:], before[:, 1:], moments)
            if min(r.shape[1], self.r.shape[1]) > 5:
                r[known, 5] = self.r[old, 5]
        return r.ravel()


def carried(met: Contacts, r: FloatArray, contacts: Contacts) -> tuple[FloatArray, FloatArray]:
    """Return r (m,) of the contacts `met` at `contacts`, the same ones after some motion, zero at new ones: r_N along the normal as it is
    now, r_T turned with the normal, of the same length; and of r what has no contact there that looks the same way.

    What the tangent of contact takes for constant (`contact_tangent`), unlike vectors in space, which turn r_N into friction."""
    d, turned = contacts.dimension, np.zeros((len(contacts), contacts.dimension))
    if not len(met) or not len(contacts):
        return turned.ravel(), r
    old = r.reshape(-1, d)
    place = np.searchsorted(contacts.identity, met.identity).clip(max=len(contacts) - 1)
    same = contacts.identity[place] == met.identity
    same &= np.einsum("ad,ad->a", met.frame[:, 0], contacts.frame[place, 0]) > _SAME_WAY
    before, place = met.frame[same], place[same]
    tangential = np.einsum("aij,akj,ak->ai", contacts.frame[place, 1:], before[:, 1:], old[same, 1:])
    length, size = np.linalg.norm(tangential, axis=1), np.linalg.norm(old[same, 1:], axis=1)
    turned[place, 0] = old[same, 0]
    turned[place, 1:] = tangential * np.divide(size, length, out=np.ones_like(size), where=length > 0)[:, None]
    return turned.ravel(), np.where(same[:, None], 0.0, old).ravel()


def carried_in_space(met: Contacts, r: FloatArray, contacts: Contacts) -> tuple[FloatArray, FloatArray]:
    """The same as vectors in space, which stay whatever normal a contact has; nothing of r is said to be left."""
    return Reactions(met.identity, met.frame, r.reshape(-1, contacts.dimension)).transfer(contacts), np.zeros(0)


def warm_start(problem: Reduced, contacts: Contacts, memory: Sequence[Reactions], enough: float = 0.0) -> FloatArray:
    """Return the best starting point r (m,) that the last steps' reactions (newest first) suggest; zero without any.

    With r1, r2, r3 of the last three steps the candidates are r1, the linear 2 r1 - r2, and r1 + r2 - r3: linear as well, and exact for
    what alternates from step to step, as stick and slip do at theta = 1/2 in steady loading. The one of the smallest error is taken,
    but r1 where its residual is `enough` [unit of q]: among answers round-off would choose, and where reactions are not unique (barrels
    between two walls) differences of former steps would add up to forces that nothing asks for.
    """
    return _best(problem, [reactions.transfer(contacts) for reactions in memory[: MEMORY - 1]], enough)


def nearest_start(problem: Reduced, contacts: Contacts, memory: Sequence[Reactions], enough: float = 0.0) -> FloatArray:
    """As `warm_start`, but of the candidates the one whose rule would have met the last step best from the three before it: for Newton's
    method, which begins with the last step's statuses.

    The error measures badly how near a start is. Where reactions of sticking contacts are wrong by little, velocities are wrong by much;
    r1, wrong by more but smoothly, has the smaller error. On a wall in shear 2 r1 - r2 is four to a hundred times nearer to the answer.
    """
    if len(memory) < MEMORY:
        return warm_start(problem, contacts, memory, enough)
    r = [reactions.transfer(contacts) for reactions in memory[:MEMORY]]
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
