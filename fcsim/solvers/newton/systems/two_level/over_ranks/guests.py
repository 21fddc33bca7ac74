"""Joints of other ranks on this one's bodies, its guests: what it needs of them to have the preconditioner's answer at its bodies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import IntArray
from fcsim.ranks import World
from fcsim.solvers.newton.systems.two_level import _block_kernels as kernels


class Guests:
    """z - R c on others' contacts at this rank's bodies: R is sent once a system, z with what each application exchanges, and c is known;
    the owner's bits, by the owner's operations."""

    def __init__(
        self,
        world: World,
        contacts: IntArray,
        ends: tuple[IntArray, IntArray],
        listed: IntArray,
        between: IntArray,
        foreign: IntArray,
        d: int,
        k: int,
    ) -> None:
        """contacts: those of this rank's joints, joint by joint; ends: where each joint's contacts and, of `listed`, its bodies begin, with
        k motions each; between: which joints are on other ranks' bodies, too; foreign: the contacts at this rank's bodies that others have,
        ascending."""
        cuts, begins = ends
        self._world = world
        self.rows = _of(cuts, between)  # of this rank's contacts, that others need
        bodies = listed[_of(begins, between)]
        sizes = np.stack([np.diff(cuts)[between], np.diff(begins)[between]], axis=1)
        lengths = world.gathered(np.array([len(sizes), len(self.rows), len(bodies)]), [3] * world.size).reshape(-1, 3)
        sizes = world.gathered(sizes.ravel(), 2 * lengths[:, 0]).reshape(-1, 2)
        every, bodies = world.gathered(contacts[self.rows], lengths[:, 1]), world.gathered(bodies, lengths[:, 2])
        self._counts = [d * int(count) for count in lengths[:, 1]]  # of z, that each rank sends
        self._d, self._lengths = d, list[int]()
        cuts, begins, starts = _ends(sizes[:, 0]), _ends(sizes[:, 1]), _ends(d * k * sizes[:, 0] * sizes[:, 1])
        rank = np.repeat(np.arange(world.size), lengths[:, 0])
        which = np.flatnonzero((rank != world.number) & np.isin(every[cuts[:-1]], foreign))
        self._sent, self._which, self._starts = between, which, starts
        self._R_counts = np.bincount(rank, np.diff(starts), minlength=world.size).astype(np.int64)
        self._here = _of(cuts, which)  # of what is received
        self._rank = np.repeat(rank[which], np.diff(cuts)[which])
        self._place = np.searchsorted(foreign, every[self._here])
        self.listed = bodies[_of(begins, which)]
        ends_here = (_ends(np.diff(of)[which]) for of in (starts, cuts, begins))
        self._R_starts, self._cuts, self._begins = ends_here
        self._R = np.empty(0, dtype=np.float32)

    def take(self, R: NDArray[np.float32], starts: IntArray) -> None:
        """R of this rank's joints, each from its start on, has changed: hear of the guests'."""
        with self._world.unasked("joints between ranks"):
            received = self._world.gathered(kernels.blocks_of(R, starts, self._sent), self._R_counts)
            self._R = kernels.blocks_of(received, self._starts, self._which)

    def lengths(self, before: int) -> list[int]:
        """Of what each rank sends, an even number: so many others `before` its z."""
        if not self._lengths:
            self._lengths = [before + count + count % 2 for count in self._counts]
            rows = np.cumsum(self._counts) - self._counts
            begins = np.cumsum(self._lengths) - self._lengths + before - rows
            self._at = (begins[self._rank] + self._d * self._here)[:, None] + np.arange(self._d)
        return self._lengths

    def put(self, received: NDArray[np.float32], c: NDArray[np.float32], out: NDArray[np.float32]) -> None:
        """Write z - R c of the guests' contacts to out (foreign, d), which are in this order; received: what ranks have sent."""
        z = received.take(self._at)
        motions = self._R, self._R_starts, self._cuts, self._begins, self.listed, c
        kernels.less_motions(*motions, 0, len(self._which), z, self._place, out)


def _of(ends: IntArray, which: IntArray) -> IntArray:
    """The numbers ends[k], ..., ends[k + 1] - 1 of each k in `which`, one after the other."""
    counts = np.diff(ends)[which]
    numbers: IntArray = np.repeat(ends[which] - np.cumsum(counts) + counts, counts) + np.arange(int(counts.sum()))
    return numbers


def _ends(sizes: IntArray) -> IntArray:
    return np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(sizes)])
