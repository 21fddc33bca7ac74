"""Which rank has which contacts: those of its bodies. A contact between bodies of two ranks is known to both."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.linear.block_rows import dofs_of
from fcsim.problem.distributed._halo_kernels import add_rows
from fcsim.ranks import World, world


@dataclass(frozen=True, eq=False)
class ContactLayout:
    """contacts: of each rank of `world` those of its bodies, ascending among all nc; d: `dimension` unknowns a contact.

    Vectors (m,) of all contacts are whole on every rank, matrices are not: a rank makes its own contacts' part of a vector, and what
    comes together stands, or is summed, in the order of the ranks, so that all have the same bits.
    """

    world: World
    contacts: Sequence[IntArray]
    nc: int
    dimension: int

    def together(self, what: str) -> AbstractContextManager[None]:
        """A block of each rank's own work, whose errors are all ranks'; RuntimeError where this rank computes alone."""
        if world() is not self.world:
            ask = "ask for it on every rank first, outside of fcsim.ranks.alone(), and it is kept"
            raise RuntimeError(f"{what}: expected all ranks, which have a share of W each, got one that computes alone; {ask}")
        return self.world.together(what)

    @property
    def own(self) -> IntArray:
        """This rank's contacts (k,)."""
        return self.contacts[self.world.number]

    @cached_property
    def own_unknowns(self) -> IntArray:
        """Their unknowns (k d,)."""
        return dofs_of(self.own, self.dimension)

    @cached_property
    def known(self) -> BoolArray:
        """Which contacts each rank knows (size, nc)."""
        known = np.zeros((len(self.contacts), self.nc), dtype=bool)
        for of_rank, some in zip(known, self.contacts, strict=True):
            of_rank[some] = True
        return known

    @cached_property
    def _owners(self) -> IntArray:
        """How many ranks know each contact (nc,)."""
        return np.bincount(np.concatenate(self.contacts), minlength=self.nc)

    @cached_property
    def interface(self) -> IntArray:
        """The contacts between bodies of several ranks, ascending."""
        return np.flatnonzero(self._owners > 1)

    @cached_property
    def at_interface(self) -> BoolArray:
        """Which of this rank's contacts (k,) are among them."""
        between: BoolArray = self._owners[self.own] > 1
        return between

    @cached_property
    def free(self) -> IntArray:
        """The contacts that no body with a compliance takes part in: W has nothing there."""
        return np.flatnonzero(self._owners == 0)

    def interface_unknowns_of(self, rank: int) -> IntArray:
        """The unknowns among those of the interface, in its order, that a rank knows."""
        place = np.searchsorted(self.interface, self.contacts[rank][self._owners[self.contacts[rank]] > 1])
        return dofs_of(place, self.dimension)

    @cached_property
    def _everyones(self) -> IntArray:
        return np.concatenate(self.contacts)

    @cached_property
    def _counts(self) -> IntArray:
        return self.dimension * np.array([len(contacts) for contacts in self.contacts])

    def summed(self, own: FloatArray) -> FloatArray:
        """The sum (m,) over the ranks of what each has on its own unknowns, own (k d,)."""
        return self.summed_blocks(own.reshape(-1, self.dimension)).ravel()

    def summed_blocks(self, own: FloatArray) -> FloatArray:
        """The sum (nc, ...) over the ranks, in their order, of what each has on its own contacts, own (k, ...)."""
        size, total = math.prod(own.shape[1:]), np.zeros((self.nc, *own.shape[1:]))
        every = self.world.gathered(own.ravel(), [size * len(contacts) for contacts in self.contacts])
        add_rows(every.reshape(-1, size), self._everyones, total.reshape(-1, size))
        return total

    @cached_property
    def _everyones_at_interface(self) -> IntArray:
        return np.concatenate([self.interface_unknowns_of(rank) for rank in range(self.world.size)])

    @cached_property
    def _counts_at_interface(self) -> IntArray:
        return np.array([len(self.interface_unknowns_of(rank)) for rank in range(self.world.size)])

    def summed_at_interface(self, own: FloatArray) -> FloatArray:
        """The sum on the interface's unknowns of what each rank has on those of its own there, in their order."""
        everything = self.world.gathered(own, self._counts_at_interface)
        return np.bincount(self._everyones_at_interface, everything, self.dimension * len(self.interface))

    @cached_property
    def _everyones_inner(self) -> IntArray:
        inner = [contacts[self._owners[contacts] == 1] for contacts in self.contacts]
        return np.concatenate([dofs_of(contacts, self.dimension) for contacts in inner])

    def joined(self, inner: FloatArray, interface: FloatArray) -> FloatArray:
        """x (m,) from each rank's own part on the contacts that it alone knows, and the interface's; zero on the `free` ones."""
        x = np.zeros(self.nc * self.dimension)
        x[self._everyones_inner] = self.world.gathered(inner, self._counts - self._counts_at_interface)
        x[dofs_of(self.interface, self.dimension)] = interface
        return x


def contact_layout(ranks: World, rank: IntArray, contacts: IntArray, nc: int, dimension: int) -> ContactLayout:
    """The layout where the rank rank[p] has a body on the contact contacts[p], rank and contacts (pairs,)."""
    known = np.zeros((ranks.size, nc), dtype=bool)
    known[rank, contacts] = True
    return ContactLayout(ranks, [np.flatnonzero(some) for some in known], nc, dimension)
