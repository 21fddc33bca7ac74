"""A sparse matrix times many vectors that stand by rows: that of one part times the displacements of all its bodies."""

from __future__ import annotations

from functools import partial

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.linear.over_ranks.rows import RowsOverRanks
from fcsim.threads import pieces, side_by_side

NUMBERS_AT_ONCE, VECTORS_A_PIECE = 50_000, 500
"""Of the vectors that are multiplied at once, which a core's own cache holds with what comes out (half the time of all at once for 2565
bricks of 675 unknowns); vectors that one thread takes."""


def times_each(A: sp.csr_array | RowsOverRanks, X: FloatArray) -> FloatArray:
    """A x (k, n) for each row x of X (k, m); entries are summed as in A @ X^T."""
    at_once = max(1, NUMBERS_AT_ONCE // max(1, A.shape[1]))
    if len(X) <= 2 * at_once or not isinstance(A, sp.csr_array):
        product: FloatArray = (A @ X.T).T
        return product
    out = np.empty((len(X), A.shape[0]))

    def some(begin: int, end: int) -> None:
        for i in range(begin, end, at_once):
            j = min(i + at_once, end)
            out[i:j] = (A @ np.ascontiguousarray(X[i:j].T)).T

    side_by_side([partial(some, begin, end) for begin, end in pieces(len(X), VECTORS_A_PIECE)])
    return out
