"""Sparse matrices with unknowns more that nothing couples with the others, without a conversion."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray


def further_rows(indptr: IntArray, k: int) -> IntArray:
    """Starts of rows, and of k more of one entry each."""
    return np.concatenate([indptr, indptr[-1] + np.arange(1, k + 1, dtype=indptr.dtype)])


def with_diagonal_block(A: sp.csr_array, diagonal: FloatArray) -> sp.csr_array:
    """A (n, n) with k unknowns more, coupled to nothing, and their entries (k,) on the diagonal."""
    n, k = A.shape[0], len(diagonal)
    indices = np.concatenate([A.indices, np.arange(n, n + k, dtype=A.indices.dtype)])
    return sp.csr_array((np.concatenate([A.data, diagonal]), indices, further_rows(A.indptr, k)), shape=(n + k, n + k))
