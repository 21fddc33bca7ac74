"""Sums of many vectors, compiled."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

AT_ONCE = 1024
"""Entries that stay in the first cache while the vectors pass."""


@njit(cache=True, nogil=True)
def less_combination(V, y, w):
    """Replace w (n,) by w - V^T y for V (j, n), y (j,): each entry by the same operations in the same order, wherever it stands, so that
    copies of it on several ranks keep the same bits, which products of matrices do not promise."""
    count, n = len(y), len(w)
    sums = np.empty(AT_ONCE)
    for begin in range(0, n, AT_ONCE):
        m = min(n, begin + AT_ONCE) - begin
        end = begin + m
        sums[:m] = 0.0
        for j in range(0, count - 3, 4):
            a, b, c, d = V[j, begin:end], V[j + 1, begin:end], V[j + 2, begin:end], V[j + 3, begin:end]
            p, q, r, s = y[j], y[j + 1], y[j + 2], y[j + 3]
            for i in range(m):
                sums[i] += (p * a[i] + q * b[i]) + (r * c[i] + s * d[i])
        for j in range(count - count % 4, count):
            row, factor = V[j, begin:end], y[j]
            for i in range(m):
                sums[i] += factor * row[i]
        for i in range(m):
            w[begin + i] -= sums[i]


@njit(cache=True, nogil=True)
def take_divided(w, size, own, v):
    """Write w / size (n,) to v, in its precision, and return the sum of the squares of v's first `own` entries, in double precision."""
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    for i in range(len(w)):
        v[i] = w[i] / size
    for i in range(0, own - 3, 4):
        p, q, r, s = np.float64(v[i]), np.float64(v[i + 1]), np.float64(v[i + 2]), np.float64(v[i + 3])
        a, b, c, d = a + p * p, b + q * q, c + r * r, d + s * s
    for i in range(own - own % 4, own):
        a += np.float64(v[i]) * np.float64(v[i])
    return (a + b) + (c + d)
