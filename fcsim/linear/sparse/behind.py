"""Sparse matrices by rows to which rows are joined that stand behind the others, and from which they are cut: arrays set end to end, where
SciPy's constructors for any blocks convert them three times."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray


def with_diagonal_behind(A: sp.csr_array, diagonal: FloatArray) -> sp.csr_array:
    """A (n, n) with k unknowns more, coupled to nothing, and their entries (k,) on the diagonal."""
    n, k = A.shape[0], len(diagonal)
    indices = np.concatenate([A.indices, np.arange(n, n + k, dtype=A.indices.dtype)])
    return sp.csr_array((np.concatenate([A.data, diagonal]), indices, _further_rows(A.indptr, k)), shape=(n + k, n + k))


def with_units_behind(A: sp.csr_array, columns: IntArray) -> sp.csr_array:
    """A (n, m) with k rows more, each with a one in its own column (k,)."""
    k = len(columns)
    data, indices = np.concatenate([A.data, np.ones(k)]), np.concatenate([A.indices, columns.astype(A.indices.dtype)])
    return sp.csr_array((data, indices, _further_rows(A.indptr, k)), shape=(A.shape[0] + k, A.shape[1]))


def first_rows(A: sp.csr_array, k: int, columns: int) -> sp.csr_array:
    """The first k rows of A, which have entries in the first so many columns alone."""
    end = A.indptr[k]
    return sp.csr_array((A.data[:end], A.indices[:end], A.indptr[: k + 1]), shape=(k, columns))


def _further_rows(indptr: IntArray, k: int) -> IntArray:
    """Starts of rows, and of k more of one entry each."""
    return np.concatenate([indptr, indptr[-1] + np.arange(1, k + 1, dtype=indptr.dtype)])
