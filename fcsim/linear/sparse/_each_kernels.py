"""A sparse matrix times many vectors, compiled."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def times_rows(indptr, indices, data, X, begin, end, Y, lanes):
    """Y[b] = A X[b] for begin <= b < end, A (n, m) by rows; sums in the order of its entries. lanes: so many vectors go through A
    together, their numbers of one column side by side; one that the compiler knew would take half more time."""
    n, m = len(indptr) - 1, X.shape[1]
    x, sums = np.empty((m, lanes)), np.empty(lanes)
    for first in range(begin, end, lanes):
        count = min(lanes, end - first)
        for b in range(lanes):
            row = X[min(first + b, end - 1)]
            for j in range(m):
                x[j, b] = row[j]
        for i in range(n):
            sums[:] = 0.0
            for k in range(indptr[i], indptr[i + 1]):
                a, other = data[k], x[indices[k]]
                for b in range(lanes):
                    sums[b] += a * other[b]
            for b in range(count):
                Y[first + b, i] = sums[b]
