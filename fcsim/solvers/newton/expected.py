"""Where a step's first system is linearised: at the velocities and statuses of the solutions before, contact by contact.

A start r near the answer has statuses far from the answer's: u = W r + q takes what is wrong with r for opening and sliding. The last
solution's statuses are nearly the right ones, but for contacts at the edge of sliding: at theta = 1/2 velocities swing about the motion
from step to step, so that some of them slide in every other step alone. A contact that slid in one of the last two solutions and is still
closed is expected to slide, with the velocity that it slid with. Where it sticks after all it has nearly the right reaction as a sliding
one; where it slides but was made to stick it carries what makes the error thousands of times as large, and what that does to its
neighbours takes further systems.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.solvers.memory import Kept, Memory
from fcsim.solvers.newton.statuses import OPEN, SLIDING, STICKING


@dataclass(frozen=True, eq=False)
class LastVelocities(Kept):
    """A solution and what is expected after it: its velocities u (nc, d) and statuses (nc,); the velocities `expected` (nc, d) of the next
    one, and which contacts slide there (nc,)."""

    u: FloatArray
    status: NDArray[np.int8]
    expected: FloatArray
    slides: BoolArray

    def at(self, u: FloatArray, identity: IntArray) -> tuple[FloatArray, BoolArray]:
        """`expected` and `slides` of the contacts `identity`; new ones have the velocities u (nc, d) and are not known to slide."""
        if np.array_equal(identity, self.identity):
            return self.expected, self.slides
        place, expected, slides = self.places(identity), u.copy(), np.zeros(len(u), dtype=bool)
        old = place >= 0
        expected[old], slides[old] = self.expected[place[old]], self.slides[place[old]]
        return expected, slides


def with_velocities(memory: Memory, u: FloatArray, r: FloatArray, mu: FloatArray, compliance: FloatArray) -> Memory:
    """The memory that knows a solution of its contacts, u and r (nc, d); mu and compliance (nc,): their own."""
    status, earlier = statuses(u, r, mu, compliance), memory.earlier(LastVelocities)
    expected, slides = u, status == SLIDING
    if earlier is not None and earlier.u.shape[1] == u.shape[1] and len(earlier.u):
        same = np.array_equal(earlier.identity, memory.identity)
        place = np.arange(len(u)) if same else earlier.places(memory.identity)
        again = (status == STICKING) & (place >= 0) & (earlier.status[place] == SLIDING)
        few, expected = np.flatnonzero(again), u.copy()
        expected[few], slides = earlier.u[place[few]], slides | again
    return memory.having(LastVelocities(memory.identity, u, status, expected, slides))


def statuses(u: FloatArray, r: FloatArray, mu: FloatArray, compliance: FloatArray) -> NDArray[np.int8]:
    """The pieces (nc,) of Alart and Curnier's equations on which contacts are at u and r (nc, d), for one over their compliances (nc,) as
    rho; moments of rolling and spinning do not count."""
    y = r[:, :3] - u[:, :3] / compliance[:, None]
    sticks = np.einsum("ai,ai->a", y[:, 1:], y[:, 1:]) <= (mu * y[:, 0]) ** 2
    return np.where(y[:, 0] > 0, np.where(sticks, STICKING, SLIDING), OPEN).astype(np.int8)
