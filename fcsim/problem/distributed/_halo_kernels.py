"""Sums of what ranks have of a vector, and their shares of products, compiled.

every: what came from the ranks, one after the other: `count` numbers, and d values of each row that a rank sends; places (k, 2): numbers
of rows, counted through all ranks, and their ranks.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def add_rows(values, rows, total):
    """Add values (k, d) to the rows (k,) of total (n, d), one after the other."""
    for k in range(len(rows)):
        row = np.uint64(rows[k])
        for i in range(values.shape[1]):
            total[row, i] += values[k, i]


@njit(cache=True, nogil=True)
def put_together(numbers, square, share, rows, d, out):
    """Write to out the numbers (j,), `square` and the rows (k,) of share (n d,): what a rank sends."""
    count = len(numbers) + 1
    for i in range(len(numbers)):
        out[i] = numbers[i]
    out[count - 1] = square
    for k in range(len(rows)):
        at, row = count + d * k, d * rows[k]
        for i in range(d):
            out[at + i] = share[row + i]


@njit(cache=True, nogil=True)
def taken_apart(every, sizes, count, d, share, both, sums, w):
    """Write to sums (count,) those of the ranks' numbers, to w (m,) share (n,), what is behind it 0, with what others have added: `both` =
    places, to, first, second as `add_received` and `products` take them, the sum of which is returned. sizes: rows that each rank sends."""
    places, to, first, second = both
    at = 0
    for j in range(count):
        sums[j] = 0.0
    for k in range(len(sizes)):
        for j in range(count):
            sums[j] += every[at + j]
        at += count + d * sizes[k]
    for i in range(len(share)):
        w[i] = share[i]
    for i in range(len(share), len(w)):
        w[i] = 0.0
    add_received(every, count, d, places, to, w)
    return products(every, count, d, first, second)


@njit(cache=True, nogil=True)
def add_received(every, count, d, places, to, w):
    """Add the rows at `places` to the rows `to` (k,) of w (n,)."""
    for k in range(len(to)):
        at, row = places[k, 0] * d + (places[k, 1] + 1) * count, to[k] * d
        for i in range(d):
            w[row + i] += every[at + i]


@njit(cache=True, nogil=True)
def products(every, count, d, first, second):
    """The sum of the products of the rows at `first` with those at `second`."""
    total = 0.0
    for k in range(len(first)):
        a, b = first[k, 0] * d + (first[k, 1] + 1) * count, second[k, 0] * d + (second[k, 1] + 1) * count
        for i in range(d):
            total += every[a + i] * every[b + i]
    return total


@njit(cache=True, nogil=True)
def rows_of(x, place, out):
    """out[a] = x[place[a]] (n, d), in the precision of `out`."""
    for a in range(len(place)):
        for i in range(x.shape[1]):
            out[a, i] = x[place[a], i]


@njit(cache=True, nogil=True)
def alone(A, B, own):
    """Which blocks A (n, d, d) have a diagonal alone, where that of B (n, d, d), which counts for the first `own` of them, is zero."""
    n, d = len(A), A.shape[1]
    found = np.ones(n, dtype=np.bool_)
    for a in range(n):
        for i in range(d):
            for j in range(d):
                found[a] &= (i == j or A[a, i, j] == 0) and (a >= own or B[a, i, j] == 0)
    return found


@njit(cache=True, nogil=True)
def diagonals(A):
    """Those of A (n, d, d): (n, d)."""
    n, d = len(A), A.shape[1]
    found = np.empty((n, d))
    for a in range(n):
        for i in range(d):
            found[a, i] = A[a, i, i]
    return found


@njit(cache=True, nogil=True)
def apply_blocks(A, B, diagonal, is_alone, y, here, x, own, out):
    """out[a] = A[a] y[here[a]] (n, d), and B[a] x[a] more for a < own; A, B: blocks (d, d), not read where A has its diagonal alone."""
    d = x.shape[1]
    for a in range(len(here)):
        if is_alone[a]:
            for i in range(d):
                out[a, i] = diagonal[a, i] * y[here[a], i]
            continue
        for i in range(d):
            s = 0.0
            for j in range(d):
                s += A[a, i, j] * y[here[a], j]
            if a < own:
                for j in range(d):
                    s += B[a, i, j] * x[a, j]
            out[a, i] = s
