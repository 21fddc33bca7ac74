"""A sparse matrix times many vectors that stand by rows: that of one part times the displacements of all its bodies."""

from __future__ import annotations

from functools import partial

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.linear.over_ranks.rows import RowsOverRanks
from fcsim.linear.sparse._each_kernels import times_rows
from fcsim.threads import pieces, side_by_side

FEW, VECTORS_A_PIECE, LANES, FULL = 50_000, 500, 32, 0.85
"""Numbers of vectors up to twice which SciPy multiplies them at once, all in a core's own cache; vectors that one thread takes, and that
go through the matrix together; how full these are where that takes less time than SciPy at once (96 vectors of a rank: 0.8 of it)."""


def times_each(A: sp.csr_array | RowsOverRanks, X: FloatArray) -> FloatArray:
    """A x (k, n) for each row x of X (k, m); entries are summed as in A @ X^T."""
    few = len(X) <= 2 * max(1, FEW // max(1, A.shape[1])) and len(X) < FULL * LANES * -(-len(X) // LANES)
    if not len(X) or few or not isinstance(A, sp.csr_array):
        product: FloatArray = (A @ X.T).T
        return product
    out = np.empty((len(X), A.shape[0]))
    work = [partial(times_rows, A.indptr, A.indices, A.data, X, begin, end, out, LANES) for begin, end in pieces(len(X), VECTORS_A_PIECE)]
    side_by_side(work)
    return out
