"""Loops over contacts of the condensed elimination, compiled: a handful of passes over blocks (d, d) that NumPy takes a call a line for."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def roles(A, B):
    """Which contacts are closed (nc,), A not zero, and which of these stick, B zero."""
    nc, d = len(A), A.shape[1]
    closed, sticking = np.empty(nc, dtype=np.bool_), np.empty(nc, dtype=np.bool_)
    for a in range(nc):
        closes = A[a, 0, 0] != 0  # of most that are
        if not closes:
            for i in range(d):
                for j in range(d):
                    closes |= A[a, i, j] != 0
        sticks = closes
        if closes:
            for i in range(d):
                for j in range(d):
                    sticks &= B[a, i, j] == 0
        closed[a], sticking[a] = closes, sticks
    return closed, sticking


@njit(cache=True)
def solve_block(A, b, work, x):
    """Write A^-1 b to x (d,) by elimination with row pivoting; work (d, d + 1). Returns whether A is regular."""
    d = len(x)
    for i in range(d):
        for j in range(d):
            work[i, j] = A[i, j]
        work[i, d] = b[i]
    for k in range(d):
        pivot = k
        for i in range(k + 1, d):
            if abs(work[i, k]) > abs(work[pivot, k]):
                pivot = i
        if work[pivot, k] == 0:
            return False
        if pivot != k:
            for j in range(k, d + 1):
                work[k, j], work[pivot, j] = work[pivot, j], work[k, j]
        for i in range(k + 1, d):
            factor = work[i, k] / work[k, k]
            for j in range(k + 1, d + 1):
                work[i, j] -= factor * work[k, j]
    for i in range(d - 1, -1, -1):
        s = work[i, d]
        for j in range(i + 1, d):
            s -= work[i, j] * x[j]
        x[i] = s / work[i, i]
    return True


@njit(cache=True)
def known_components(A, B, rhs):
    """The components of x = W dr (k, d) that A x + B dr = rhs gives for every dr, zero elsewhere, which ones are unknown, and whether all
    blocks were regular.

    All of a sticking contact (B = 0), the normal one of a closed contact where row N of A is (A_NN, 0, 0) and of B zero, as Alart and
    Curnier's and Jean and Moreau's are.
    """
    k, d = rhs.shape
    x, unknown, work = np.zeros_like(rhs), np.ones((k, d), dtype=np.bool_), np.empty((d, d + 1), dtype=rhs.dtype)
    regular = True
    for a in range(k):
        sticks = True
        for i in range(d):
            for j in range(d):
                sticks &= B[a, i, j] == 0
        if sticks:
            regular &= solve_block(A[a], rhs[a], work, x[a])
            unknown[a] = False
            continue
        normal = A[a, 0, 0] != 0
        for j in range(d):
            normal &= B[a, 0, j] == 0 and (j == 0 or A[a, 0, j] == 0)
        if normal:
            x[a, 0] = rhs[a, 0] / A[a, 0, 0]
            unknown[a, 0] = False
    return x, unknown, regular


@njit(cache=True)
def held_side(A, rhs, coupling, contacts, stays, t):
    """Write the right side of the held contacts (s, d) to t: A^-1 rhs where they stay, 0 where they are released, less the coupling.
    Returns whether all blocks were regular."""
    d = t.shape[1]
    work, regular = np.empty((d, d + 1), dtype=t.dtype), True
    for i in range(len(contacts)):
        a = contacts[i]
        if stays[i]:
            regular &= solve_block(A[a], rhs[a], work, t[i])
        else:
            t[i] = 0
        for j in range(d):
            t[i, j] -= coupling[a, j]
    return regular


@njit(cache=True)
def signed(known, released, coupling, contacts):
    """Turn P^T z (k, d) in place into what the border's contacts know: -P^T z of released ones, P^T z and the coupling of free ones."""
    for k in range(len(contacts)):
        for j in range(known.shape[1]):
            known[k, j] = -known[k, j] if released[k] else known[k, j] + coupling[contacts[k], j]


@njit(cache=True)
def left_over(outer, inner, response, x, rhs, contacts, unknown):
    """rhs - outer response - inner x on the unknown components, one after the other (n,); rhs (nc, d) of all contacts, the rest of k."""
    left, n, d = np.empty(np.count_nonzero(unknown), dtype=x.dtype), 0, x.shape[1]
    for k in range(len(contacts)):
        for i in range(d):
            if unknown[k, i]:
                s = rhs[contacts[k], i]
                for j in range(d):
                    s -= outer[k, i, j] * response[k, j]
                for j in range(d):
                    s -= inner[k, i, j] * x[k, j]
                left[n] = s
                n += 1
    return left


@njit(cache=True)
def own_blocks(G, outer, inner, unknown):
    """The contacts' own blocks (k, d, d) of outer G + inner on the unknown components, with those of the identity on the others."""
    k, d = unknown.shape
    own = np.zeros_like(inner)
    for a in range(k):
        for i in range(d):
            for j in range(d):
                if unknown[a, i] and unknown[a, j]:
                    s = inner[a, i, j]
                    for c in range(d):
                        s += outer[a, i, c] * G[d * a + c, d * a + j]
                    own[a, i, j] = s
                elif i == j:
                    own[a, i, j] = 1
    return own


@njit(cache=True)
def apply_blocks(A, y, B, x):
    """A y + B x (nc, d) with A and B block diagonal (nc, d, d)."""
    nc, d = x.shape
    z = np.empty_like(x)
    for a in range(nc):
        for i in range(d):
            s = A[a, i, 0] * y[a, 0]
            for j in range(1, d):
                s += A[a, i, j] * y[a, j]
            for j in range(d):
                s += B[a, i, j] * x[a, j]
            z[a, i] = s
    return z
