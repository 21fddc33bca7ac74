"""Vectors over contacts cut among ranks: each has the part of the contacts that it owns, and asks others for what it needs of theirs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray, IntArray
from fcsim.ranks import World


class ContactParts:
    """owner (nc,): the rank that has each contact; order (nc,): all contacts, rank after rank; begins (size + 1,): where each one's part
    begins. What comes together stands, or is summed, in the order of the ranks: the same bits on all."""

    def __init__(self, world: World, owner: IntArray, joint: IntArray) -> None:
        """joint (nc,): contacts of a rank are in the order of these numbers, equal ones as they come."""
        self.world, self.owner = world, owner
        self.order = np.lexsort((joint, owner))
        self.begins = np.searchsorted(owner[self.order], np.arange(world.size + 1))

    @property
    def own(self) -> IntArray:
        """This rank's contacts (k,)."""
        return self.order[self.begins[self.world.number] : self.begins[self.world.number + 1]]

    def whole(self, part: FloatArray) -> FloatArray:
        """x (nc, d) from each rank's part (k, d) of it."""
        d = part.shape[1]
        x = np.empty((len(self.order), d), dtype=part.dtype)
        x[self.order] = self.world.gathered(part.ravel(), d * np.diff(self.begins)).reshape(-1, d)
        return x

    def summed[T: np.floating](self, values: NDArray[T]) -> NDArray[T]:
        """The sum over the ranks of values (k,), of as many on each."""
        size = self.world.size
        total: NDArray[T] = self.world.gathered(values, [len(values)] * size).reshape(size, -1).sum(axis=0)
        return total


class Needed:
    """What a rank needs of the others' contacts: `of` brings it from their owners, `to_owners` gives them what this one has there."""

    def __init__(self, parts: ContactParts, contacts: IntArray) -> None:
        """contacts (k,): of other ranks."""
        world, owner = parts.world, parts.owner
        self._parts = parts
        counts = parts.world.gathered(np.array([len(contacts)]), np.ones(world.size, dtype=np.int64))
        everyones = world.gathered(contacts, counts)
        self._counts = counts
        asked = np.unique(everyones)
        asked = asked[np.argsort(owner[asked], kind="stable")]
        self._counts_of_owners = np.bincount(owner[asked], minlength=world.size)
        place = np.full(len(owner), -1)
        place[asked] = np.arange(len(asked))
        self._which = place[contacts]  # of what the owners send
        place[parts.own] = np.arange(len(parts.own))
        self._sent = place[asked[owner[asked] == world.number]]
        self._for_me = np.flatnonzero(owner[everyones] == world.number)  # of what others have on contacts of this rank
        self._own = place[everyones[self._for_me]]

    def of[T: np.floating](self, part: NDArray[T]) -> NDArray[T]:
        """x (k, d) on the contacts that are needed, from each rank's part of it."""
        d = part.shape[1]
        given = self._parts.world.gathered(part[self._sent].ravel(), d * self._counts_of_owners)
        return given.reshape(-1, d)[self._which]

    def to_owners(self, part: FloatArray, needed: FloatArray) -> None:
        """Add to each rank's part what the others have on its contacts, at most one for each; needed (k, d): what this one has."""
        d = part.shape[1]
        given = self._parts.world.gathered(needed.ravel(), d * self._counts).reshape(-1, d)
        part[self._own] += given[self._for_me]
