"""Joints that one of Newton's systems has left unsolved are solved one by one, all other reactions held, before the next system.

For the contacts J of a joint, with u_J and r_J where the system has led,

    F(u_J + W_JJ x, r_J + x) = 0,

by Newton's method with steps that are halved until ||F|| falls. With the bodies' reactions elsewhere held, x moves these bodies as a whole
by inertia alone, so that it hardly changes what the joint carries: contacts that open, close, stick or slide share that anew.

Near a solution of a wall a handful of contacts keep Newton's method from its end: they stand between sticking and sliding, some of which a
linear system's defect turns, and each system costs as much as one for all contacts. Farther from it what a joint's contacts settle among
themselves is no better for the others; whoever asks takes the answer where the error of all contacts is less with it.

Sources: P. J. Lanzkron, D. J. Rose, J. T. Wilkes, SIAM J. Sci. Comput. 17, 1996 (nonlinear elimination between Newton's steps); X.-C. Cai,
D. E. Keyes, SIAM J. Sci. Comput. 24, 2002. That the joints of contact are what is eliminated is our own.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.solvers.newton.systems.two_level import _settling_kernels as kernels
from fcsim.threads import side_by_side

SMALL, PART = 0.1, 0.01
"""Share of the tolerance, and of the error, up to which a joint is left as it is."""
WORTH = 0.75
"""What a round must leave of the error of all contacts for another one to follow."""
NEARLY, STILL_WORTH = 2.0, 0.95
"""Up to so many times the tolerance a round need leave no less than this for another one: it takes a tenth of what a system does."""
NEAR = 1e-2
"""Error from which on joints are solved one by one: before that, from zero, it misleads Newton's method."""
ITERATIONS, FALLS = 15, 1e-3
"""Of Newton's method in a joint: at most, and the ||F|| relative to where it began at which it ends."""


class JointsOfContacts(Protocol):
    """What is taken of `Joints`, or of a rank's own ones."""

    E: FloatArray
    starts: IntArray
    cuts: IntArray
    begins: IntArray
    order: IntArray
    modes: tuple[FloatArray, IntArray, IntArray, IntArray]
    ranges: list[tuple[int, int]]


@dataclass(frozen=True)
class Rounds:
    """How often in a row joints or patches are solved after a system at most, and the share of the error up to which one is left as it
    is."""

    most: int = 1
    part: float = PART


class TwoLevel(Protocol):
    """A system by joints' blocks and bodies' motions, in one process or over ranks."""

    pays: bool
    rounds: Rounds

    def settled(
        self, u: FloatArray, r: FloatArray, mu: FloatArray, rho: FloatArray, weight: FloatArray, limit: float
    ) -> tuple[FloatArray, FloatArray] | None: ...


class SettlesJoints[T: TwoLevel]:
    """What systems share that go by joints as long as that pays."""

    _two_level: T | None

    @property
    def by_joints(self) -> bool:
        """Whether systems are solved by joints and bodies' motions, without any factor of W."""
        return self._two_level is not None and self._two_level.pays

    @property
    def rounds(self) -> Rounds:
        """Those of the two-level system."""
        return Rounds() if self._two_level is None else self._two_level.rounds

    def settled(
        self, u: FloatArray, r: FloatArray, mu: FloatArray, rho: FloatArray, weight: FloatArray, limit: float
    ) -> tuple[FloatArray, FloatArray] | None:
        """dr and W dr (m,) by which joints or patches are solved one by one, arguments as of `settled`; None where another way is gone or
        none are."""
        return None if self._two_level is None else self._two_level.settled(u, r, mu, rho, weight, limit)


def settled(
    joints: JointsOfContacts, u: FloatArray, r: FloatArray, mu: FloatArray, rho: FloatArray, weight: FloatArray, limit: float
) -> FloatArray | None:
    """r (nc, d) with the joints solved in which ||weight F|| is above `limit`, None where there are none; u, r, rho (nc, d), mu and weight
    (nc,)."""
    found, counts = r.copy(), np.zeros(len(joints.ranges), dtype=np.int64)
    given = (joints.E, joints.starts, joints.cuts, joints.begins, joints.order, joints.modes[0], u, r, mu, rho, weight, limit)

    def own(piece: int, begin: int, end: int) -> None:
        counts[piece] = kernels.settle_joints(*given, ITERATIONS, FALLS, begin, end, found)

    side_by_side([partial(own, piece, begin, end) for piece, (begin, end) in enumerate(joints.ranges)])
    return found if counts.any() else None
