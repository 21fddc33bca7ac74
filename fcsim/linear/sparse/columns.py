"""Products with a transposed sparse matrix, and sums over the squares of its columns: a step asks ten times for H^T v."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray
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


def normals_of_some(A: sp.csr_array, weight: FloatArray, some: BoolArray, step: int) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Of each `step`-th column j of A (n, m): sum_i weight_i A_ij^2 over all rows and over those that are not `some` (n,), and whether
    it has entries in `some`; the sums are zero where it has none. weight (n,)."""
    sums: tuple[FloatArray, FloatArray, BoolArray]
    sums = kernels.squares_of_touched_columns(A.indptr, A.indices, A.data, weight, some, step, A.shape[1] // step)
    return sums
