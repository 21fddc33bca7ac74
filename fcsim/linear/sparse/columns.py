"""Products with a sparse matrix that has few rows a column and with its transposed one, its rows renumbered, sums over the squares of its
columns: a step asks ten times for H^T v."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.arrays import BoolArray, FloatArray, IntArray, Matrix
from fcsim.linear.sparse import _columns_kernels as kernels


def transposed_times(A: sp.sparray | FloatArray, x: FloatArray) -> FloatArray:
    """A^T x (m,) for A (n, m) and x (n,), in SciPy's order of summation."""
    if x.ndim == 1 and len(x) == A.shape[0] and A.dtype == np.float64 == x.dtype:
        if isinstance(A, sp.csr_array):
            product: FloatArray = kernels.transposed_times_rows(A.indptr, A.indices, A.data, x, A.shape[1])
            return product
        if isinstance(A, sp.csc_array):
            by_columns: FloatArray = kernels.transposed_times_columns(A.indptr, A.indices, A.data, x)
            return by_columns
    other: FloatArray = A.T @ x
    return other


def times(A: sp.sparray | FloatArray, x: FloatArray) -> FloatArray:
    """A x (n,) for A (n, m) and x (m,), in SciPy's order of summation."""
    if isinstance(A, sp.csc_array) and x.ndim == 1 and len(x) == A.shape[1] and A.dtype == np.float64 == x.dtype:
        product: FloatArray = kernels.times_columns(A.indptr, A.indices, A.data, x, A.shape[0])
        return product
    other: FloatArray = A @ x
    return other


def rows_kept(A: sp.csc_array, place: IntArray, count: int) -> sp.csc_array:
    """The matrix (count, m) with row i of A (n, m) at place[i], those with place[i] < 0 left out; the others' order stays."""
    starts, rows, values = np.empty_like(A.indptr), np.empty_like(A.indices), np.empty_like(A.data)
    starts[0], ordered = 0, bool(A.has_canonical_format)
    by_columns = A.indptr, A.indices, A.data, ordered
    kernels.rows_kept(*by_columns, place, kernels.first_moved(place), 0, len(rows), starts[1:], rows, values)
    return of_kept(A, count, starts, rows, values)


def of_kept(A: sp.csc_array, count: int, starts: IntArray, rows: IntArray, values: FloatArray) -> sp.csc_array:
    """The matrix (count, m) of what `rows_kept` leaves of A (n, m)."""
    end = int(starts[-1])
    rows = rows if end == len(rows) else rows[:end]  # the very array where it is whole
    kept = sp.csc_array((values[:end], rows, starts), shape=(count, A.shape[1]))
    if A.has_canonical_format:
        kept.has_canonical_format = True
    return kept


def has_pattern(A: sp.csc_array, indptr: NDArray[np.integer], indices: NDArray[np.integer]) -> bool:
    """Whether A's arrays are these very ones, in one place of memory: SciPy makes views of the indices that it is given."""
    same = A.indptr is indptr and A.indices.shape == indices.shape and A.indices.dtype == indices.dtype
    return same and A.indices.__array_interface__["data"] == indices.__array_interface__["data"]


def entries_of_rows(A: sp.csr_array | sp.csc_array) -> IntArray:
    """How many entries each row (n,) of A (n, m) has."""
    found: IntArray = np.diff(A.indptr) if isinstance(A, sp.csr_array) else kernels.entries_of_rows(A.indices, A.shape[0])
    return found


def met_twice_beyond(A: Matrix, few: float) -> bool:
    """Whether more than so many rows of A (n, m) by columns have two entries or more; False of other matrices, nobody has counted."""
    return isinstance(A, sp.csc_array) and bool(kernels.met_twice_beyond(A.indices, A.shape[0], few))


def normals_of_some(
    A: sp.csr_array | sp.csc_array, weight: FloatArray, some: BoolArray, step: int
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Of each `step`-th column j of A (n, m): sum_i weight_i A_ij^2 over all rows and over those that are not `some` (n,), and whether
    it has entries in `some`; the sums are zero where it has none. weight (n,)."""
    sums: tuple[FloatArray, FloatArray, BoolArray]
    by = kernels.squares_of_touched if isinstance(A, sp.csc_array) else kernels.squares_of_touched_columns
    sums = by(A.indptr, A.indices, A.data, weight, some, step, A.shape[1] // step)
    return sums
