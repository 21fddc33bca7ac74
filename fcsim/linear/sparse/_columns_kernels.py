"""Loops over the entries of sparse matrices, compiled."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def transposed_times_rows(indptr, indices, data, x, size):
    """A^T x (size,) of A (n, size) by rows for x (n,)."""
    y = np.zeros(size)
    for i in range(len(indptr) - 1):
        for k in range(indptr[i], indptr[i + 1]):
            y[indices[k]] += data[k] * x[i]
    return y


@njit(cache=True)
def transposed_times_columns(indptr, indices, data, x):
    """A^T x (m,) of A (n, m) by columns for x (n,)."""
    m = len(indptr) - 1
    y = np.empty(m)
    for j in range(m):
        s = 0.0
        for k in range(indptr[j], indptr[j + 1]):
            s += data[k] * x[indices[k]]
        y[j] = s
    return y


@njit(cache=True)
def weighted_squares_rows(indptr, indices, data, weight, size):
    """sum_i weight_i A_ij^2 (size,) of the columns of A (n, size) by rows, weight (n,)."""
    y = np.zeros(size)
    for i in range(len(indptr) - 1):
        if weight[i] != 0.0:
            for k in range(indptr[i], indptr[i + 1]):
                y[indices[k]] += weight[i] * data[k] ** 2
    return y
