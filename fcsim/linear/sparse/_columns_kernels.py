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
def squares_of_touched_columns(indptr, indices, data, weight, some, step, count):
    """See `normals_of_some`, by rows: columns that `some` rows have no entry in, most of them, are passed over."""
    whole, others, touched = np.zeros(count), np.zeros(count), np.zeros((count + 1) * step, dtype=np.bool_)
    for i in range(len(indptr) - 1):
        if some[i]:
            for k in range(indptr[i], indptr[i + 1]):
                if indices[k] % step == 0:
                    touched[indices[k]] = True
    for i in range(len(indptr) - 1):
        for k in range(indptr[i], indptr[i + 1]):
            if touched[indices[k]]:
                square = weight[i] * data[k] ** 2
                whole[indices[k] // step] += square
                if not some[i]:
                    others[indices[k] // step] += square
    return whole, others, touched[: count * step : step].copy()
