"""W of a patch from what ranks have of it, compiled."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def add_part(part, at, d, W):
    """Add part (k d, k d), blocks of contacts, to W at their places `at` (k,)."""
    for a in range(len(at)):
        for i in range(d):
            source, row = part[d * a + i], W[d * at[a] + i]
            for b in range(len(at)):
                for j in range(d):
                    row[d * at[b] + j] += source[d * b + j]


@njit(cache=True, nogil=True)
def lower(part):
    """The symmetric matrix part (n, n) by rows up to the diagonal (n (n + 1) / 2,)."""
    n, end = len(part), 0
    packed = np.empty(n * (n + 1) // 2)
    for i in range(n):
        row = part[i]
        for j in range(i + 1):
            packed[end + j] = row[j]
        end += i + 1
    return packed


@njit(cache=True, nogil=True)
def add_lower(packed, at, d, W):
    """As `add_part`, of a symmetric part as `lower` gives it."""
    e = 0
    for a in range(len(at)):
        for i in range(d):
            p = d * at[a] + i
            for b in range(a + 1):
                for j in range(d if b < a else i + 1):
                    q = d * at[b] + j
                    W[p, q] += packed[e]
                    if p != q:
                        W[q, p] += packed[e]
                    e += 1
