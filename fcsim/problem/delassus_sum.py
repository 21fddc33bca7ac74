"""The Delassus operator W = H^T M^-1 H as the sum of the bodies' shares h C h^T.

C is a body's compliance, M^-1 on those of its unknowns that contacts touch, and h its part of H^T: contacts that share no body have no
block in W.
"""

from __future__ import annotations

import weakref
from functools import cached_property, partial

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray, Matrix
from fcsim.linear import storage
from fcsim.problem._delassus_kernels import (
    add_bodies,
    add_diagonal_bodies,
    entries_by_body,
    of_one_pattern,
    rounds_of_bodies,
    union_of_neighbours,
    weights_from,
)
from fcsim.ranks import digest_of
from fcsim.threads import pieces_by_work, side_by_side

WORK_A_PIECE = 15_000
"""Numbers of h C and h C h^T that one thread makes: each takes a weighted sum of some twelve, a tenth of a millisecond in all."""

type Entries = tuple[IntArray, IntArray, IntArray, IntArray, FloatArray]
"""first, contacts, begins, unknowns, weights of h, see `entries_by_body`."""


class _Patterns:
    """Finds patterns of block rows, and gives the last one again where it is asked for, as long as somebody keeps its columns: from most
    steps to the next contacts are those of the same bodies, and at 125 000 of them it takes 31 million numbers."""

    def __init__(self) -> None:
        self._last: tuple[IntArray, IntArray, IntArray, weakref.ref[IntArray]] | None = None

    def of(self, first: IntArray, contacts: IntArray, nc: int) -> tuple[IntArray, IntArray]:
        """As `union_of_neighbours`."""
        last = self._last  # read once: threads may ask side by side
        if last is not None and len(last[2]) == nc + 1 and np.array_equal(first, last[0]) and np.array_equal(contacts, last[1]):
            kept = last[3]()
            if kept is not None:
                return last[2], kept
        starts, columns = union_of_neighbours(first, contacts, nc)
        self._last = first, contacts, starts, weakref.ref(columns)
        return starts, columns


_patterns = _Patterns()

ENTRIES_FROM = 20_000
"""Entries of H from which it is looked whether it has those of the last one."""


class _Entries:
    """Makes h of H by bodies: where H has entries where the last two had them, contacts of the same bodies, from its values alone."""

    def __init__(self) -> None:
        self._last: tuple[bytes, tuple[int, int], tuple[IntArray, ...], IntArray | None] | None = None
        self._kept_as: object = None  # of the last one, see `DelassusSum`

    def of(self, H: sp.csc_array, body: IntArray, column: IntArray, count: int, d: int, some: IntArray, kept_as: object = None) -> Entries:
        """As `entries_by_body`; kept_as: see `DelassusSum`."""
        given, sizes = (H.indptr, H.indices, body, column, some), (count, d)
        if len(H.indices) < ENTRIES_FROM:
            found: Entries = entries_by_body(H.indptr, H.indices, H.data, *given[2:4], *sizes, some)
            return found
        last = self._last  # read once: threads may ask side by side
        same = last is not None and last[1] == sizes
        digest = last[0] if same and last is not None and kept_as is not None and kept_as is self._kept_as else digest_of(*given)
        same = same and last is not None and digest == last[0]
        self._kept_as = kept_as
        if last is not None and same and last[3] is not None:
            first, contacts, begins, unknowns = last[2]
            return first, contacts, begins, unknowns, weights_from(last[3], H.data)
        found = entries_by_body(H.indptr, H.indices, H.data, *given[2:4], *sizes, some)
        if last is not None and same and H.has_canonical_format:  # a weight is one entry
            self._last = *last[:2], found[:4], self._sources(given, sizes, found)
        elif not same:
            self._last = digest, sizes, found[:4], None
        return found

    @staticmethod
    def _sources(given: tuple[IntArray, ...], sizes: tuple[int, int], found: Entries) -> IntArray:
        """Of each weight (entries, 3) its place in H's values, from 1 on, 0: it is 0; less than 0 where it was added to a zero."""
        indptr, indices, body, column, some = given
        places = entries_by_body(indptr, indices, np.arange(1.0, len(indices) + 1), body, column, *sizes, some)[4].astype(np.int32)
        added = ~of_one_pattern(indptr, indices, sizes[1], some)[found[1]]
        places[np.repeat(added, np.diff(found[2]))] *= -1
        return places


_entries = _Entries()


class DelassusSum:
    """W (m, m) while the bodies' shares are added, dense or by block rows (`fcsim.linear.storage`); values: its entries so far, in one
    array whose order is the contacts' alone; bodies: h by pairs of a body and a contact, see `_delassus_kernels`."""

    def __init__(
        self,
        H: sp.sparray,
        body: IntArray,
        column: IntArray,
        count: int,
        dimension: int,
        blocks: int | None = None,
        some: IntArray | None = None,
        kept_as: object = None,
        *,
        rigid: bool = False,
    ) -> None:
        """H (n, m) sparse; body (n,): the body of each unknown, of `count`, -1 for one without a share in W; column (n,): which
        unknown of its body's compliance it is. Both are read only where H has entries. blocks: of W, where their number is known: which
        they are is then found when it is asked for. some (k,): W of these contacts alone, None: of all. kept_as: whoever gives the
        same as for the sum before says that H has its entries where that one had them, and all else but their values is the same. rigid: no
        body has more than a rigid one's unknowns, so that W is sparse from fewer on."""
        H = H.tocsc()
        some = np.arange(H.shape[1] // dimension) if some is None else some
        self.nc, self._axes = len(some), tuple(range(dimension))
        self._m = self.nc * dimension
        self.bodies: Entries = _entries.of(H, body, column, count, dimension, some, kept_as)
        self._blocks, self._rigid = blocks, rigid

    @cached_property
    def _neighbours(self) -> tuple[IntArray, IntArray]:
        """Starts (nc + 1,) and sorted columns of the block rows; of small W, which are dense, none."""
        if self._m <= storage.sparse_from(rigid=self._rigid):
            return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int32)
        return _patterns.of(*self.bodies[:2], self.nc)

    @cached_property
    def _entries(self) -> int:
        """Entries of the blocks."""
        return (len(self._neighbours[1]) if self._blocks is None else self._blocks) * self.dimension**2

    @property
    def dense(self) -> bool:
        return storage.summed_dense(self._m, self._entries, rigid=self._rigid)

    @property
    def pattern(self) -> tuple[IntArray, IntArray]:
        """Starts (nc + 1,) and sorted columns of the block rows, empty where W is dense."""
        starts, columns = self._neighbours
        return (starts[:0], columns[:0]) if self.dense else (starts, columns)

    @property
    def short_pattern(self) -> tuple[IntArray, IntArray]:
        """`pattern` with starts of 32 bits where these suffice: SciPy makes columns of 64 bits, in a copy, where starts have them."""
        starts, columns = self.pattern
        return (starts.astype(np.int32) if len(columns) < np.iinfo(np.int32).max else starts), columns

    @property
    def size(self) -> int:
        """Entries that there is room for."""
        return self._m**2 if self.dense else self._entries

    @cached_property
    def values(self) -> FloatArray:
        return np.zeros(self.size)

    @property
    def dimension(self) -> int:
        return len(self._axes)

    def add(self, begin: int, C: FloatArray, kind: IntArray, *, symmetric: bool = True) -> None:
        """Add the shares of the bodies begin, begin + 1, ... with the compliances C[kind[0]], C[kind[1]], ... of C (c, k, k)."""
        C = np.ascontiguousarray(C if symmetric else C.transpose(0, 2, 1))
        first = self.bodies[0]
        count = np.diff(first[begin : begin + len(kind) + 1])
        work = count * (C.shape[1] + len(self._axes) * count)  # the rows of h C, and those of h C h^T
        values = self.values  # made here: threads that ask first at once would each make their own, and all but one be lost
        for bodies in self._rounds(begin, work):

            def add(some: IntArray) -> None:
                add_bodies(*self.pattern, values, *self.bodies, begin + some, C, kind[some], symmetric, self._axes, self.nc)

            begins = np.concatenate([[0], np.cumsum(work[bodies])])
            side_by_side([partial(add, bodies[i:j]) for i, j in pieces_by_work(begins, WORK_A_PIECE)])

    def _rounds(self, begin: int, work: IntArray) -> list[IntArray]:
        """Bodies (from `begin` on) that add their shares side by side, since no two of them share a contact, round by round."""
        every = np.arange(len(work))
        if work.sum() < 2 * WORK_A_PIECE:
            return [every]
        rounds = rounds_of_bodies(*self.bodies[:2], self.nc, begin, len(work))
        return [every[rounds == k] for k in range(rounds.max() + 1)]

    def add_diagonal(self, begin: int, C: FloatArray, group: IntArray) -> None:
        """Add the shares of the bodies from `begin` on whose compliances are diagonal: C[group[k]:group[k + 1]] that of the k-th."""
        add_diagonal_bodies(*self.pattern, self.values, *self.bodies, begin, C, group, self._axes, self.nc)

    def matrix(self) -> Matrix:
        """W, a dense array or a bsr_array."""
        d, m = len(self._axes), self._m
        if self.dense:
            return self.values.reshape(m, m)
        starts, columns = self.short_pattern
        return sp.bsr_array((self.values.reshape(-1, d, d), columns, starts), shape=(m, m), blocksize=(d, d))
