"""Rotations nearest to small matrices, compiled by numba."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

ITERATIONS = 20
"""Newton's method takes five to nine from condition numbers up to `CONDITION`."""

SETTLED = 1e-9
"""Change of an iterate, whose square is below round-off: the next one would change nothing."""

CONDITION = 1e5
"""Of a matrix in the norm of Frobenius: beyond it inverses lose more digits than singular values do."""


@njit(cache=True, error_model="numpy")
def inverse(A, d, out):
    """A^-1 of the leading d rows and columns (2 or 3) into `out`, by the adjugate, and its determinant; not finite where A is singular."""
    if d == 2:
        determinant = A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0]
        out[0, 0], out[1, 1] = A[1, 1] / determinant, A[0, 0] / determinant
        out[0, 1], out[1, 0] = -A[0, 1] / determinant, -A[1, 0] / determinant
        return determinant
    for i in range(3):
        k, m = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            a, b = (j + 1) % 3, (j + 2) % 3
            out[j, i] = A[k, a] * A[m, b] - A[k, b] * A[m, a]
    determinant = A[0, 0] * out[0, 0] + A[0, 1] * out[1, 0] + A[0, 2] * out[2, 0]
    for i in range(3):
        for j in range(3):
            out[i, j] /= determinant
    return determinant


@njit(cache=True, error_model="numpy")
def newton_rotations(A, R, found):
    """Rotations R (n, d, d) nearest to A (n, d, d) by Newton's method R <- (s R + R^-T / s) / 2, s^2 = |R^-1| / |R|, until s is one;
    found (n,): whether it holds, not where A is singular, nearly so, not finite, or mirrors.

    Source: N. J. Higham, "Computing the polar decomposition - with applications", SIAM J. Sci. Stat. Comput. 7, 1986.
    """
    n, d = A.shape[:2]
    X, Y = np.empty((d, d)), np.empty((d, d))
    for b in range(n):
        for i in range(d):
            for j in range(d):
                X[i, j] = A[b, i, j]
        found[b] = False
        for k in range(ITERATIONS):
            determinant = inverse(X, d, Y)
            size = inverse_size = 0.0
            for i in range(d):
                for j in range(d):
                    size += X[i, j] * X[i, j]
                    inverse_size += Y[i, j] * Y[i, j]
            if k == 0 and not (determinant > 0 and size * inverse_size < CONDITION**2):
                break
            s = (inverse_size / size) ** 0.25
            change = 0.0
            for i in range(d):
                for j in range(d):
                    value = 0.5 * (s * X[i, j] + Y[j, i] / s)
                    change += (value - X[i, j]) ** 2
                    R[b, i, j] = value
            for i in range(d):
                for j in range(d):
                    X[i, j] = R[b, i, j]
            if change <= SETTLED * SETTLED:
                found[b] = True
                break
