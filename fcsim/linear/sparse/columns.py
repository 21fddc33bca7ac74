"""Products with a transposed sparse matrix, and sums over the squares of its columns: a step asks ten times for H^T v."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray
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


def weighted_squares(A: sp.csr_array, weight: FloatArray) -> FloatArray:
    """sum_i weight_i A_ij^2 (m,) of the columns of A (n, m); weight (n,)."""
    squares: FloatArray = kernels.weighted_squares_rows(A.indptr, A.indices, A.data, weight, A.shape[1])
    return squares
