"""Solutions with a block tridiagonal Cholesky factor, compiled: a product of small matrices a block."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def solve(starts, at, values, X):
    """Overwrite X (n, k) with A^-1 X: y_b+1 = x_b+1 - G_b y_b downwards, x_b = S_b^-1 y_b - G_b^T x_b+1 upwards.

    starts (p + 1,): where the blocks begin; values from at[2 b] on: S_b^-1, from at[2 b + 1] on: G_b, by rows.
    """
    count = len(starts) - 1
    for b in range(count - 1):
        i, j, m = starts[b], starts[b + 1], starts[b + 2]
        G = values[at[2 * b + 1] : at[2 * b + 2]].reshape((m - j, j - i))
        less = np.dot(G, X[i:j])
        for p in range(m - j):
            for q in range(X.shape[1]):
                X[j + p, q] -= less[p, q]
    for b in range(count - 1, -1, -1):
        i, j = starts[b], starts[b + 1]
        inverse = values[at[2 * b] : at[2 * b + 1]].reshape((j - i, j - i))
        x = np.dot(inverse, X[i:j])
        if b < count - 1:
            m = starts[b + 2]
            G = values[at[2 * b + 1] : at[2 * b + 2]].reshape((m - j, j - i))
            x -= np.dot(G.T, X[j:m])
        for p in range(j - i):
            for q in range(X.shape[1]):
                X[i + p, q] = x[p, q]


@njit(cache=True, nogil=True)
def partition(reach, first):
    """Ends of blocks of which each reaches into the next one alone; reach (n,), ascending: the last unknown that one of the first i + 1
    is coupled to; first: size of the first block."""
    n = len(reach)
    ends = np.empty(n, dtype=np.int64)
    count, end = 1, first
    ends[0] = end
    while end < n:
        end = max(reach[end - 1] + 1, end + 1)
        ends[count] = end
        count += 1
    return ends[:count].copy()
