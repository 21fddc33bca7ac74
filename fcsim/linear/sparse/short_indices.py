"""Sparse matrices with indices of 32 bits, as most have them: for others, too, loops would be compiled anew."""

from __future__ import annotations

from typing import cast

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import Matrix

PLAIN = (sp.csr_array, sp.csc_array, sp.bsr_array)
"""Not what is made of them, as rows whose entries are made late: these choose their indices themselves."""


def with_short_indices[M: Matrix](matrix: M) -> M:
    """The same matrix with indices of 32 bits where they suffice; itself where it has these, is dense, or is no plain array by rows,
    columns or blocks. SciPy gives 64 bits to what is made of places in such arrays, and to what is made of that."""
    if not isinstance(matrix, PLAIN) or type(matrix) not in PLAIN:
        return matrix
    if matrix.indices.dtype == np.int32 or max(*matrix.shape, matrix.nnz) > np.iinfo(np.int32).max:
        return matrix
    data = matrix.data if matrix.has_canonical_format else matrix.data.copy()  # which may be put in order
    indices, indptr = matrix.indices.astype(np.int32), matrix.indptr.astype(np.int32)
    return cast(M, type(matrix)((data, indices, indptr), shape=matrix.shape))
