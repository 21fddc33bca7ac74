"""Work on the columns of a sparse matrix that all ranks have: each takes some of them, with the bits that one process would have."""

from __future__ import annotations

import weakref

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.linear.sparse import _columns_kernels as kernels
from fcsim.linear.sparse.columns import has_pattern, normals_of_some, of_kept, rows_kept, times, transposed_times
from fcsim.ranks import common_arrays, for_parts, in_parts, kept_alike, world, written

CONTACTS_FROM = 3000
"""Contacts from which ranks share work on them: a product with H^T of as many takes a third of a millisecond, exchanging it a tenth."""

NORMALS_FROM = 20_000
"""The same of sums over the squares of the normals' columns where ranks have no memory in common: of as many a millisecond, and three
exchanges. Where they have it that is one of a few bytes, and pays from CONTACTS_FROM on."""


def transposed_times_by_ranks(A: sp.sparray | FloatArray, x: FloatArray) -> FloatArray:
    """A^T x (m,) as `transposed_times`; all ranks must ask."""
    if world() is None or not isinstance(A, sp.csc_array) or A.dtype != np.float64 or x.dtype != np.float64:
        return transposed_times(A, x)
    d = 1 if A.shape[1] % 3 else 3  # columns that the kernel takes together
    product = for_parts((A.shape[1] // d, d), CONTACTS_FROM)

    def multiply(begin: int, end: int) -> None:
        own = A.indptr[d * begin : d * end + 1]
        product[begin:end] = kernels.transposed_times_columns(own, A.indices, A.data, x).reshape(-1, d)

    in_parts("H^T v", len(product), CONTACTS_FROM, multiply, product)
    return product.ravel()


def times_by_ranks(A: sp.sparray | FloatArray, x: FloatArray) -> FloatArray:
    """A x (n,) as `times`, each rank some of its rows where they ascend in each column; all ranks must ask."""
    by_columns = isinstance(A, sp.csc_array) and A.dtype == np.float64 == x.dtype and x.shape == A.shape[1:]
    if world() is None or not isinstance(A, sp.csc_array) or not by_columns or not A.has_canonical_format or A.shape[1] < 3 * CONTACTS_FROM:
        return times(A, x)
    product = for_parts((A.shape[0],), 0)

    def multiply(begin: int, end: int) -> None:
        product[begin:end] = 0.0
        kernels.times_columns_between(_columns_between(A, begin, end), A.indptr, A.indices, A.data, x, begin, end, product)

    in_parts("H r", len(product), 0, multiply, product)
    return product


_between: dict[int, tuple[weakref.ref[IntArray], IntArray, tuple[int, int], IntArray]] = {}
"""By the number of its indptr, of a pattern that is still there: its indices, rows, and the columns that have entries in these."""


def _columns_between(A: sp.csc_array, first: int, last: int) -> IntArray:
    """The columns with entries in the rows first, ..., last - 1, see `columns_between`; those of a pattern are found once: to look through
    all columns takes as long as a product with these."""
    indptr, number = A.indptr, id(A.indptr)
    known = _between.get(number)
    if known is not None and known[0]() is indptr and has_pattern(A, A.indptr, known[1]) and known[2] == (first, last):
        return known[3]
    found: IntArray = kernels.columns_between(indptr, A.indices, first, last)
    _between[number] = weakref.ref(indptr, lambda _: _between.pop(number, None)), A.indices, (first, last), found
    return found


class RowsKept:
    """A -> `rows_kept`, each rank some columns where ranks have memory in common; where A has the very indptr and indices of the last A the
    result has those of the last result, and values alone are made."""

    def __init__(self, place: IntArray, count: int) -> None:
        """place (n,), count: as `rows_kept` takes them."""
        self._place, self._count, self._moved = place, count, int(kernels.first_moved(place))
        self._last: tuple[IntArray, IntArray, IntArray, IntArray] | None = None  # indptr and indices of A, and of the result

    def __call__(self, A: sp.csc_array) -> sp.csc_array:
        """A's rows (count, m); all ranks must ask."""
        last = self._last if kept_alike() else None
        if last is not None and not has_pattern(A, *last[:2]):
            last = None
        m, size = A.shape[1], len(A.indices) if last is None else len(last[3])
        wanted = ((size,), A.data.dtype), ((m + 1,), A.indptr.dtype), ((size,), A.indices.dtype)
        shared = common_arrays(m, 3 * CONTACTS_FROM, *wanted[: 3 if last is None else 1])
        if last is not None:
            values = shared[0] if shared else np.empty_like(A.data, shape=size)
            kept = self._of_last(A, *last[2:], values, shared is not None)
        else:
            kept = rows_kept(A, self._place, self._count) if shared is None else self._shared(A, *shared)
        if kept_alike():
            self._last = A.indptr, A.indices, kept.indptr, kept.indices
        return kept

    def _of_last(self, A: sp.csc_array, starts: IntArray, rows: IntArray, values: FloatArray, shared: bool) -> sp.csc_array:
        ordered = bool(A.has_canonical_format)

        def keep(begin: int, end: int) -> None:
            own = A.indptr[begin : end + 1], A.indices, A.data
            kernels.values_kept(*own, ordered, self._place, self._moved, starts[begin : end + 1], values)

        if shared:
            written("rows of H", A.shape[1], keep)
        else:
            keep(0, A.shape[1])
        return of_kept(A, self._count, starts, rows, values)

    def _shared(self, A: sp.csc_array, values: FloatArray, starts: IntArray, rows: IntArray) -> sp.csc_array:
        of_rows = bool(A.has_canonical_format), self._place, self._moved

        def keep(begin: int, end: int) -> None:
            at, own = kernels.entries_kept(A.indptr[: begin + 1], A.indices, *of_rows), A.indptr[begin : end + 1]
            until = at + kernels.entries_kept(own, A.indices, *of_rows)
            if begin == 0:
                starts[0] = 0
            kernels.rows_kept(own, A.indices, A.data, *of_rows, at, until, starts[begin + 1 : end + 1], rows, values)

        written("rows of H", A.shape[1], keep)
        return of_kept(A, self._count, starts, rows, values)


def normals_by_ranks(
    A: sp.csr_array | sp.csc_array, weight: FloatArray, some: BoolArray, step: int
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """As `normals_of_some`, each rank of some columns; all ranks must ask."""
    ranks = world()
    if ranks is None or not isinstance(A, sp.csc_array):
        return normals_of_some(A, weight, some, step)
    count, least = A.shape[1] // step, NORMALS_FROM if ranks.common is None else min(CONTACTS_FROM, NORMALS_FROM)
    whole, others, touched = (for_parts((count,), least, kind) for kind in (np.float64, np.float64, np.bool_))

    def sums(begin: int, end: int) -> None:
        own = A.indptr[step * begin : step * end + 1]
        found = kernels.squares_of_touched(own, A.indices, A.data, weight, some, step, end - begin)
        whole[begin:end], others[begin:end], touched[begin:end] = found

    in_parts("normals", count, least, sums, whole, others, touched)
    return whole, others, touched
