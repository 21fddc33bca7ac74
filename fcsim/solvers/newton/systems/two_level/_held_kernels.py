"""Newton's steps on a patch, compiled: contacts that stick are eliminated once for all steps, few are left to each.

Of (A W + B) dr = -F a contact that sticks has B = 0 and A diagonal, so that W dr is known there, v = -A^-1 F. With those held, h, which
stick in all steps so far, and the others, o,

    W_hh = L L^T,    Y = L^-1 W_ho,    S = W_oo - Y^T Y,    y = L^-1 v_h,
    (A S + B) dr_o = -F_o - A Y^T y,    dr_h = L^-T (y - Y dr_o).
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.linear._front_kernels import dot

ROWS = 48
"""Of L that are solved for at once, by products of matrices."""


@njit(cache=True, nogil=True)
def slides(B, held):
    """Whether one of the contacts `held` does not stick, B (n, d, d)."""
    found = False
    for a in held:
        if np.any(B[a] != 0):
            found = True
    return found


@njit(cache=True, nogil=True)
def may_slide(u, r, mu, rho, B, edge, free):
    """Set free (n,) for the contacts that do not stick, and those whose friction, r_T - rho u_T, is beyond `edge` of what holds it."""
    n, d = u.shape
    for a in range(n):
        norm2 = 0.0
        for i in range(1, d):
            norm2 += (r[a, i] - rho[a, i] * u[a, i]) ** 2
        radius = edge * mu[a] * (r[a, 0] - rho[a, 0] * u[a, 0])
        free[a] = free[a] or np.any(B[a] != 0) or norm2 > radius * radius


@njit(cache=True, nogil=True)
def part(W, rows, columns, d):
    """The blocks of W in the contacts `rows` and `columns`."""
    out = np.empty((len(rows) * d, len(columns) * d))
    for i in range(len(rows)):
        for p in range(d):
            source, target = W[rows[i] * d + p], out[i * d + p]
            for j in range(len(columns)):
                for q in range(d):
                    target[j * d + q] = source[columns[j] * d + q]
    return out


@njit(cache=True, nogil=True)
def without_held(W, held, others, d, eased):
    """L, Y and S, with `eased` of W's diagonal added to it. Raises LinAlgError where W_hh is not positive definite."""
    S, Y, own = part(W, others, others, d), part(W, held, others, d), part(W, held, held, d)
    for i in range(len(S)):
        S[i, i] *= 1 + eased
    for i in range(len(own)):
        own[i, i] *= 1 + eased
    L = np.linalg.cholesky(own)
    if len(held) and len(others):
        solve_below(L, Y)
        known = np.dot(Y.T, Y)
        for i in range(len(S)):
            for j in range(len(S)):
                S[i, j] -= known[i, j]
    return L, Y, S


@njit(cache=True, nogil=True)
def solve_below(L, X):
    """Overwrite X (n, k) with L^-1 X."""
    n = len(L)
    for begin in range(0, n, ROWS):
        end = min(begin + ROWS, n)
        if begin:
            known = np.dot(np.ascontiguousarray(L[begin:end, :begin]), X[:begin])
            for i in range(begin, end):
                for c in range(X.shape[1]):
                    X[i, c] -= known[i - begin, c]
        for i in range(begin, end):
            row = X[i]
            for j in range(begin, i):
                x, other = L[i, j], X[j]
                for c in range(len(row)):
                    row[c] -= x * other[c]
            pivot = L[i, i]
            for c in range(len(row)):
                row[c] /= pivot


@njit(cache=True, nogil=True)
def newton_step(F, A, B, held, others, L, Y, S):
    """dr (n d,) for F (n, d), A and B (n, d, d). Raises LinAlgError where A S + B is singular."""
    n, d = F.shape
    m, step = len(others), np.empty(n * d)
    y, rhs = np.empty(len(held) * d), np.empty(m * d)
    for i in range(len(held)):
        for p in range(d):
            y[i * d + p] = -F[held[i], p] / A[held[i], p, p]
    for j in range(len(y)):  # L stands by columns
        y[j] /= L[j, j]
        x, column = y[j], L[:, j]
        for i in range(j + 1, len(y)):
            y[i] -= x * column[i]
    if m:
        pushed = np.dot(Y.T, y)
        J = np.zeros((m * d, m * d)).T  # by columns, as it is factored
        for j in range(m * d):
            source, target = S[j], J[:, j]  # S is symmetric
            for i in range(m):
                a = others[i]
                for p in range(d):
                    value = 0.0
                    for q in range(d):
                        value += A[a, p, q] * source[i * d + q]
                    target[i * d + p] = value
        for i in range(m):
            a = others[i]
            for p in range(d):
                value = -F[a, p]
                for q in range(d):
                    value -= A[a, p, q] * pushed[i * d + q]
                    J[i * d + p, i * d + q] += B[a, p, q]
                rhs[i * d + p] = value
        solution = np.linalg.solve(J, rhs)
        known = np.dot(Y, solution)
        for j in range(len(y)):
            y[j] -= known[j]
        for i in range(m):
            for p in range(d):
                step[others[i] * d + p] = solution[i * d + p]
    for j in range(len(y) - 1, -1, -1):
        y[j] = (y[j] - dot(L[j + 1 :, j], y[j + 1 :])) / L[j, j]
    for i in range(len(held)):
        for p in range(d):
            step[held[i] * d + p] = y[i * d + p]
    return step
