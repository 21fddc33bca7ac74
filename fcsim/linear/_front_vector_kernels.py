"""Triangular solves of one vector with the fronts of a multifrontal Cholesky factor, compiled: one call for all fronts, since a call of
BLAS and two of NumPy a front take longer than its numbers.

values: front by front the columns of L11 (n entries each, those above the diagonal not used), then those of L21 (b entries each); sizes
(fronts, 2): n and b; borders: of all fronts, the unknowns of L21's rows. Own unknowns are numbered in the fronts' order.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def forward(values, sizes, borders, x):
    """Overwrite x with L^-1 x."""
    first, at, edge = 0, 0, 0
    below = np.empty(sizes[:, 1].max() if len(sizes) else 0, dtype=x.dtype)
    for f in range(len(sizes)):
        n, b = sizes[f]
        own, border, L21 = x[first : first + n], borders[edge : edge + b], at + n * n
        below[:b] = 0
        for j in range(n):
            column, beside = values[at + j * n : at + j * n + n], values[L21 + j * b : L21 + j * b + b]
            t = own[j] / column[j]
            own[j] = t
            for i in range(j + 1, n):
                own[i] -= column[i] * t
            for i in range(b):
                below[i] += beside[i] * t
        for i in range(b):
            x[border[i]] -= below[i]
        first, at, edge = first + n, L21 + n * b, edge + b


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})  # so that the compiler makes vectors of the sum's parts
def dot(a, b):
    """a . b in their precision."""
    total = a.dtype.type(0)
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@njit(cache=True, nogil=True)
def backward(values, sizes, borders, x):
    """Overwrite x with L^-T x."""
    first, at, edge = sizes[:, 0].sum(), (sizes[:, 0] * (sizes[:, 0] + sizes[:, 1])).sum(), len(borders)
    gathered = np.empty(sizes[:, 1].max() if len(sizes) else 0, dtype=x.dtype)
    for f in range(len(sizes) - 1, -1, -1):
        n, b = sizes[f]
        first, at, edge = first - n, at - n * (n + b), edge - b
        own, border, L21, above = x[first : first + n], borders[edge : edge + b], at + n * n, gathered[:b]
        for i in range(b):
            above[i] = x[border[i]]
        for j in range(n - 1, -1, -1):
            column, beside = values[at + j * n : at + j * n + n], values[L21 + j * b : L21 + j * b + b]
            own[j] = (own[j] - dot(column[j + 1 :], own[j + 1 :]) - dot(beside, above)) / column[j]
