"""When patches of joints are solved between Newton's systems, and what systems share that know joints; `patches` says how and why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from fcsim.arrays import FloatArray, IntArray
from fcsim.solvers.newton._formulation_kernels import disk_misses

SMALL = 0.1
"""Share of the tolerance up to which a joint is left as it is."""
WORTH = 0.75
"""What a round must leave of the error of all contacts for another one to follow."""
NEARLY, STILL_WORTH = 2.0, 0.95
"""Up to so many times the tolerance a round need leave no less than this for another one: it takes a tenth of what a system does."""
NEAR = 1e-2
"""Error from which on patches are solved: before that, from zero, they mislead Newton's method."""


@dataclass(frozen=True)
class Rounds:
    """How often in a row patches are solved after a system at most, the share of the error up to which a joint is left as it is, and
    as WORTH."""

    most: int = 1
    part: float = 0.1
    worth: float = WORTH


@dataclass(frozen=True, eq=False)
class ContactIterate:
    """Contacts at an iterate, as patches take them: u, r (nc, d); mu (nc,); rho (nc, d) of Alart and Curnier's equations F(u, r) = 0;
    weight (nc,) by which F counts in the error."""

    u: FloatArray
    r: FloatArray
    mu: FloatArray
    rho: FloatArray
    weight: FloatArray

    def take(self, own: IntArray) -> ContactIterate:
        """Those of some contacts (k,)."""
        return ContactIterate(self.u[own], self.r[own], self.mu[own], self.rho[own], self.weight[own])

    @property
    def misses(self) -> FloatArray:
        """(weight ||F||)^2 (nc,)."""
        misses: FloatArray = disk_misses(self.u, self.r, self.mu, self.rho, self.weight)
        return misses


class TwoLevel(Protocol):
    """A system by joints' blocks and bodies' motions, in one process or over ranks."""

    pays: bool
    rounds: Rounds

    def settled(self, at: ContactIterate, limit: float) -> tuple[FloatArray, FloatArray] | None: ...


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

    def settled(self, at: ContactIterate, limit: float) -> tuple[FloatArray, FloatArray] | None:
        """dr and W dr (m,) by which patches are solved in which ||weight F|| of the middle joint is above `limit`; None where another way
        is gone or there are none."""
        return None if self._two_level is None else self._two_level.settled(at, limit)
