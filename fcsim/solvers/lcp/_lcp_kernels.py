"""Pivots of Lemke's method, compiled by numba."""

from __future__ import annotations

import numpy as np
from numba import njit

GOING, DONE, RAY = 0, 1, 2


@njit(cache=True)
def _leaving_row(T, basic, place, column, n, tolerance):
    """Return the row of the lexicographically smallest (b, E)_i / -T_i,column over T_i,column < 0, or -1 where there is none.

    Rows read x_i = b_i + sum_j T_ij x_j + sum_j E_ij eps^j: a nonbasic w_j carries the perturbation eps^j of its own row, E_ij = -T_ij,
    and a basic one has E_ij = 1 in its row only. The artificial variable (2 n) leaves wherever it can.
    """
    last = T.shape[1] - 1
    least = np.inf
    for i in range(n):
        if T[i, column] < -tolerance:
            least = min(least, max(T[i, last], 0.0) / -T[i, column])
    if least == np.inf:
        return -1
    tied = np.empty(n, dtype=np.int64)
    count = 0
    for i in range(n):
        if T[i, column] < -tolerance and max(T[i, last], 0.0) / -T[i, column] <= least + 1e-12 * (1 + least):
            if basic[i] == 2 * n:
                return i
            tied[count] = i
            count += 1
    for j in range(n):
        if count == 1:
            break
        least = np.inf
        for k in range(count):
            i = tied[k]
            E = -T[i, -place[j] - 1] if place[j] < 0 else (1.0 if place[j] == i else 0.0)
            least = min(least, E / -T[i, column])
        kept = 0
        for k in range(count):
            i = tied[k]
            E = -T[i, -place[j] - 1] if place[j] < 0 else (1.0 if place[j] == i else 0.0)
            if E / -T[i, column] <= least + 1e-12 * (1 + abs(least)):
                tied[kept] = i
                kept += 1
        count = kept
    best = tied[0]
    for k in range(1, count):  # equal to round-off: the largest pivot
        if T[tied[k], column] < T[best, column]:
            best = tied[k]
    return best


@njit(cache=True)
def exchange(T, row, column):
    """Pivot the dictionary T (n, n + 2): the basic variable of `row` and the nonbasic one of `column` change places."""
    rows, columns = T.shape
    pivot = T[row, column]
    full = 0
    nonzero = np.empty(columns, dtype=np.int64)
    for j in range(columns):
        T[row, j] = -T[row, j] / pivot
        if j != column and T[row, j] != 0.0:
            nonzero[full] = j
            full += 1
    T[row, column] = 1 / pivot
    for i in range(rows):
        factor = T[i, column]
        if i == row or factor == 0.0:
            continue
        if 2 * full > columns:
            T[i, column] = 0.0
            for j in range(columns):
                T[i, j] += factor * T[row, j]
        else:
            for k in range(full):
                T[i, nonzero[k]] += factor * T[row, nonzero[k]]
            T[i, column] = factor / pivot


@njit(cache=True)
def pivots(T, basic, nonbasic, place, column, limit, tolerance):
    """Up to `limit` pivots of Lemke's method from the entering `column`; return (state, next entering column, pivots)."""
    n = T.shape[0]
    for count in range(limit):
        row = _leaving_row(T, basic, place, column, n, tolerance)  # (1) ratio test
        if row < 0:
            return RAY, column, count
        exchange(T, row, column)  # (2) pivot
        leaves = basic[row]
        basic[row], nonbasic[column] = nonbasic[column], leaves
        for variable, where in ((basic[row], row), (leaves, -column - 1)):
            if variable < n:
                place[variable] = where
        if leaves == 2 * n:
            return DONE, column, count + 1
        complement = leaves + n if leaves < n else leaves - n  # (3) its complement enters
        for j in range(n + 1):
            if nonbasic[j] == complement:
                column = j
                break
    return GOING, column, limit
