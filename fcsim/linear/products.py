"""Dense products and triangular solves of a Newton step by pieces, side by side: the pieces are those of the sizes alone.

Where one thread reads a matrix that no cache holds, two take half the time. SciPy's wrappers of BLAS keep the interpreter's lock, NumPy's
products and LAPACK's wrappers leave it.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.threads import pieces, side_by_side

ENTRIES_A_PIECE = 1_000_000
"""Of a matrix that one thread multiplies a vector with: a tenth of a millisecond where a cache holds it."""
OPERATIONS_A_PIECE = 4_000_000
"""The same for products of matrices."""


def times(A: FloatArray, x: FloatArray) -> FloatArray:
    """A x (n,) for A (n, m) in C order, by pieces of rows."""
    if A.size < 2 * ENTRIES_A_PIECE:
        return A @ x
    y = np.empty(len(A), dtype=np.result_type(A, x))
    least = max(1, ENTRIES_A_PIECE // A.shape[1])
    side_by_side([partial(np.matmul, A[i:j], x, out=y[i:j]) for i, j in pieces(len(A), least)])
    return y


def transposed_times(A: FloatArray, x: FloatArray) -> FloatArray:
    """A^T x (m,) for A (n, m) in C order, by pieces of columns."""
    if A.size < 2 * ENTRIES_A_PIECE:
        return x @ A
    y = np.empty(A.shape[1], dtype=np.result_type(A, x))
    least = max(1, ENTRIES_A_PIECE // len(A))
    side_by_side([partial(np.matmul, x, A[:, i:j], out=y[i:j]) for i, j in pieces(A.shape[1], least)])
    return y


def product(A: FloatArray, B: FloatArray, out: FloatArray) -> None:
    """Write A B (n, k) to `out`, by pieces of rows."""
    operations = A.size * B.shape[1]
    if operations < 2 * OPERATIONS_A_PIECE:
        np.matmul(A, B, out=out)
        return
    least = max(1, OPERATIONS_A_PIECE * len(A) // operations)
    side_by_side([partial(np.matmul, A[i:j], B, out=out[i:j]) for i, j in pieces(len(A), least)])
