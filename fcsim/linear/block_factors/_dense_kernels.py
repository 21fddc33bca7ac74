"""Products and LU of small dense matrices inside compiled code, up to some hundred unknowns, where a call of BLAS or LAPACK would cost as
much as the work, and begin threads of its own."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

PANEL = 4
"""Columns that are eliminated before the rest of the matrix is told: each row of it is then read once for four of them."""


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def affine(W, x, shift, q):
    """(W + diag(shift)) x + q (m,); sums in the order that suits the processor's vectors."""
    y = np.empty_like(q)
    for i in range(len(q)):
        total = 0.0
        for j in range(len(x)):
            total += W[i, j] * x[j]
        y[i] = total + shift[i] * x[i] + q[i]
    return y


@njit(cache=True, nogil=True)
def eliminate_panel(A, b, k, width):
    """Partial pivoting on the columns k, ..., k + width - 1 of A (n, n) alone, with b (n,); False where a pivot is zero or no number.

    Rows are swapped whole; to the right of the panel only those of the pivots are brought up to date.
    """
    n = len(b)
    for p in range(k, k + width):
        largest, pivot = abs(A[p, p]), p
        for i in range(p + 1, n):
            if abs(A[i, p]) > largest:
                largest, pivot = abs(A[i, p]), i
        if not largest > 0.0:
            return False
        if pivot != p:
            for j in range(n):
                A[p, j], A[pivot, j] = A[pivot, j], A[p, j]
            b[p], b[pivot] = b[pivot], b[p]
        inverse = 1.0 / A[p, p]
        for i in range(p + 1, n):
            factor = A[i, p] * inverse
            A[i, p] = factor
            for j in range(p + 1, k + width):
                A[i, j] -= factor * A[p, j]
    for p in range(k, k + width):
        for i in range(p + 1, k + width):
            factor, row, upper = A[i, p], A[i, k + width :], A[p, k + width :]
            for j in range(len(row)):
                row[j] -= factor * upper[j]
    return True


@njit(cache=True, nogil=True)
def solve_dense(A, b):
    """Overwrite b (n,) with A^-1 b and A (n, n), in C order, with its factors; False where A is singular. 2/3 n^3 operations."""
    n = len(b)
    for k in range(0, n, PANEL):
        width = min(PANEL, n - k)
        if not eliminate_panel(A, b, k, width):
            return False
        if width < PANEL:
            break
        u0, u1, u2, u3 = A[k, k + 4 :], A[k + 1, k + 4 :], A[k + 2, k + 4 :], A[k + 3, k + 4 :]
        for i in range(k + 4, n):
            f0, f1, f2, f3, row = A[i, k], A[i, k + 1], A[i, k + 2], A[i, k + 3], A[i, k + 4 :]
            for j in range(len(row)):
                row[j] -= f0 * u0[j] + f1 * u1[j] + f2 * u2[j] + f3 * u3[j]
    for i in range(n):
        for j in range(i):
            b[i] -= A[i, j] * b[j]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            b[i] -= A[i, j] * b[j]
        b[i] /= A[i, i]
    return True
