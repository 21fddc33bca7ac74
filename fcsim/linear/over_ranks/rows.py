"""A matrix of which each rank has some rows: products, and the rows that a factorisation by all ranks is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray, Matrix
from fcsim.brief import brief
from fcsim.ranks import World, world


@dataclass(frozen=True, eq=False)
class RowLayout:
    """rank (n,): whose each row is among those of `world`."""

    world: World
    rank: IntArray

    @cached_property
    def own(self) -> IntArray:
        """This rank's rows, ascending."""
        return np.flatnonzero(self.rank == self.world.number)

    @cached_property
    def order(self) -> IntArray:
        """All rows (n,), rank after rank."""
        return np.argsort(self.rank, kind="stable")

    @cached_property
    def counts(self) -> IntArray:
        """Rows of each rank (size,)."""
        return np.bincount(self.rank, minlength=self.world.size)

    @cached_property
    def number(self) -> IntArray:
        """Where each row (n,) stands in `order`."""
        number = np.empty(len(self.rank), dtype=np.int64)
        number[self.order] = np.arange(len(self.rank))
        return number

    @property
    def computes_together(self) -> bool:
        """Whether all these ranks compute what is asked for now; not where this one computes alone."""
        return world() is self.world

    def gathered(self, own: FloatArray) -> FloatArray:
        """x (n,) or (n, k) of all ranks from this rank's rows of it."""
        width = own.shape[1] if own.ndim == 2 else 1
        x = np.empty((len(self.rank), width))
        x[self.order] = self.world.gathered(np.ascontiguousarray(own).ravel(), self.counts * width).reshape(-1, width)
        return x.reshape(len(self.rank), *own.shape[1:])

    def of(self, rows: IntArray) -> RowLayout:
        """That of some of the rows."""
        return RowLayout(self.world, self.rank[rows])


class RowsOverRanks:
    """A (n, n): rows (number of own, n) are this rank's, those of `layout.own`.

    All ranks ask for products at the same time; a rank that computes alone takes `whole`, which `make_whole` makes as one process would.
    """

    __repr__ = brief

    def __init__(self, layout: RowLayout, rows: sp.csr_array, make_whole: Callable[[], sp.csr_array]) -> None:
        self.layout, self.rows, self.make_whole = layout, rows, make_whole
        self.shape = (len(layout.rank), len(layout.rank))

    @property
    def whole(self) -> sp.csr_array:
        """A (n, n) on this rank."""
        return self.make_whole()

    def __matmul__(self, x: FloatArray) -> FloatArray:
        if not self.layout.computes_together:
            return np.asarray(self.whole @ x)
        with self.layout.world.together("product with a matrix over ranks"):
            own = self.rows @ x
        return self.layout.gathered(own)

    def diagonal(self) -> FloatArray:
        """The diagonal (n,)."""
        if not self.layout.computes_together:
            return np.asarray(self.whole.diagonal())
        with self.layout.world.together("diagonal of a matrix over ranks"):
            row = np.repeat(self.layout.own, np.diff(self.rows.indptr))
            at = np.flatnonzero(row == self.rows.indices)
            own = np.zeros(self.shape[0])
            own[row[at]] = self.rows.data[at]
        return self.layout.gathered(own[self.layout.own])

    def plus(self, share: float, other: Matrix | RowsOverRanks, times: float) -> RowsOverRanks:
        """share A + times B; B whole, or over the same ranks."""
        own = other.rows if isinstance(other, RowsOverRanks) else sp.csr_array(other)[self.layout.own]
        rows = sp.csr_array(share * self.rows + times * own)
        return RowsOverRanks(self.layout, rows, lambda: sp.csr_array(share * self.whole + times * whole(other)))

    def turned(self, T: sp.csr_array) -> RowsOverRanks:
        """T A T^T of a T (n, n) that couples no rows of different ranks."""
        own, make = self.layout.own, self.make_whole  # not these rows, which nobody may want any more
        rows = sp.csr_array(T[own][:, own] @ self.rows @ T.T)
        return RowsOverRanks(self.layout, rows, lambda: sp.csr_array(T @ make() @ T.T))

    def on(self, unknowns: IntArray) -> RowsOverRanks:
        """The rows and columns `unknowns`, ascending."""
        if len(unknowns) == self.shape[0]:
            return self
        kept, make = np.zeros(self.shape[0], dtype=bool), self.make_whole
        kept[unknowns] = True
        rows = self.rows[np.flatnonzero(kept[self.layout.own])][:, unknowns]
        return RowsOverRanks(self.layout.of(unknowns), sp.csr_array(rows), lambda: sp.csr_array(make()[unknowns][:, unknowns]))


def whole(A: Matrix | RowsOverRanks) -> Matrix:
    """A as a matrix on this rank, itself where it is one."""
    return A.whole if isinstance(A, RowsOverRanks) else A
