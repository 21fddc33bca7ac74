"""What a solve leaves for the next, nearly equal problem: a typed value that `solve` takes and gives back.

    memory = Memory.of(contacts.identity)                    # a simulation's first step: empty, but things are to be kept
    result = solve(problem, "NSN-AC", r, memory=memory)
    memory = result.memory.follow(contacts.identity)         # the next problem's contacts
    result = solve(problem, "NSN-AC", r, memory=memory)

It shortens the way to an answer, which is checked against its own problem alone: whatever is kept is a preconditioner, a first guess of
a parameter or an analysis, never a part of the answer. Without a memory (None) methods keep nothing.

How a method uses it: it declares what it keeps as a frozen dataclass derived from `Kept`, looks for an earlier one in `monitor.memory`
and leaves its new one there:

    @dataclass(frozen=True, eq=False)
    class AdaptedRho(Kept):
        rho: FloatArray                                       # (nc, d)

    if monitor.memory is not None:
        earlier = monitor.memory.earlier(AdaptedRho)          # of whatever contacts there were; `places` matches them one by one
        earlier = monitor.memory.of_same_contacts(AdaptedRho)  # or: only of exactly these, in this order
        monitor.memory = monitor.memory.having(AdaptedRho(monitor.memory.identity, rho))
        monitor.memory = monitor.memory.without(AdaptedRho)   # what misled is forgotten

Values are not changed once they are in a memory (who needs another makes a new one, which may share arrays), and they do not hold the
problem's W: the problem has it, and a step's W must be free before the next is made.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from fcsim.arrays import IntArray
from fcsim.brief import brief
from fcsim.errors import InputError


@dataclass(frozen=True, eq=False)
class Kept:
    """What one method keeps; identity (nc,): the numbers of the contacts that it belongs to, in its own order."""

    identity: IntArray

    def places(self, identity: IntArray) -> IntArray:
        """Where the contacts `identity` (k,) stand among this value's (k,), -1 for those that it does not know."""
        if not len(self.identity):
            return np.full(len(identity), -1)
        order = np.argsort(self.identity, kind="stable")
        found = np.minimum(np.searchsorted(self.identity, identity, sorter=order), len(order) - 1)
        place = order[found]
        return np.where(self.identity[place] == identity, place, -1)


Own = TypeVar("Own", bound=Kept)


@dataclass(frozen=True, eq=False)
class Memory:
    """identity (nc,): the contacts of the problem at hand, each by a number of its own; values: what methods keep, one of each kind."""

    identity: IntArray
    values: tuple[Kept, ...] = ()

    __repr__ = brief

    @classmethod
    def of(cls, identity: IntArray) -> Memory:
        """The empty memory for contacts (nc,)."""
        identity = np.asarray(identity)
        if identity.ndim != 1 or identity.dtype.kind not in "iu":
            raise InputError(f"identity: expected whole numbers (nc,), one a contact, got {identity.dtype} of shape {identity.shape}")
        return cls(identity)

    def follow(self, identity: IntArray) -> Memory:
        """The same values for the contacts of the next problem."""
        return replace(Memory.of(identity), values=self.values)

    def earlier(self, kind: type[Own]) -> Own | None:
        """The value of a kind, of whatever contacts there were when it was kept."""
        return next((value for value in self.values if isinstance(value, kind)), None)

    def of_same_contacts(self, kind: type[Own]) -> Own | None:
        """The value of a kind where it belongs to the present contacts in their present order, else None."""
        value = self.earlier(kind)
        return value if value is not None and np.array_equal(value.identity, self.identity) else None

    def having(self, value: Kept) -> Memory:
        """A memory with this value in the place of the one of its kind."""
        return replace(self, values=(*(old for old in self.values if type(old) is not type(value)), value))

    def without(self, kind: type[Kept]) -> Memory:
        """A memory without a value of this kind."""
        return replace(self, values=tuple(old for old in self.values if not isinstance(old, kind)))
