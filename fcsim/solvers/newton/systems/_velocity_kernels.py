"""The contacts' own equations, and adding their shares h^T K h to a matrix of the bodies' velocities; compiled."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def contacts_eliminated(A, B, shift, rhs):
    """K = C^-1 A (nc, d, d) and c = C^-1 rhs (nc, d) with C = A diag(shift) + B of each contact, by elimination of [C, A, rhs] with row
    pivoting.

    Returns (K, c, the first contact whose C is singular or -1); A, B (nc, d, d), shift and rhs (nc, d).
    """
    nc, d = rhs.shape
    K, c, rows = np.empty((nc, d, d)), np.empty((nc, d)), np.empty((d, 2 * d + 1))
    for a in range(nc):
        for i in range(d):
            for j in range(d):
                rows[i, j] = A[a, i, j] * shift[a, j] + B[a, i, j]
                rows[i, d + j] = A[a, i, j]
            rows[i, 2 * d] = rhs[a, i]
        for k in range(d):
            pivot = k
            for i in range(k + 1, d):
                if abs(rows[i, k]) > abs(rows[pivot, k]):
                    pivot = i
            if rows[pivot, k] == 0.0:
                return K, c, a
            if pivot != k:
                for j in range(k, 2 * d + 1):
                    rows[k, j], rows[pivot, j] = rows[pivot, j], rows[k, j]
            for i in range(k + 1, d):
                factor = rows[i, k] / rows[k, k]
                if factor != 0.0:
                    for j in range(k + 1, 2 * d + 1):
                        rows[i, j] -= factor * rows[k, j]
        for j in range(d, 2 * d + 1):
            for i in range(d - 1, -1, -1):
                total = rows[i, j]
                for l in range(i + 1, d):
                    total -= rows[i, l] * rows[l, j]
                rows[i, j] = total / rows[i, i]
        for i in range(d):
            for j in range(d):
                K[a, i, j] = rows[i, d + j]
            c[a, i] = rows[i, 2 * d]
    return K, c, -1


@njit(cache=True)
def add_shares(S, unknowns, h, K):
    """Add h_a^T K_a h_a of every contact to S (n, n): h (nc, d, k) on the unknowns (nc, k), -1 where a contact has fewer; K (nc, d, d)."""
    nc, d, k = h.shape
    Kh = np.empty((d, k))
    for a in range(nc):
        for i in range(d):
            for j in range(k):
                total = 0.0
                for l in range(d):
                    total += K[a, i, l] * h[a, l, j]
                Kh[i, j] = total
        for i in range(k):
            row = unknowns[a, i]
            if row < 0:
                break
            for j in range(k):
                column = unknowns[a, j]
                if column < 0:
                    break
                total = 0.0
                for l in range(d):
                    total += h[a, l, i] * Kh[l, j]
                S[row, column] += total


@njit(cache=True)
def places(indptr, indices, unknowns):
    """Where the pattern (sorted rows) stores the pairs (nc, k, k) of each contact's unknowns (nc, k); -1 for absent ones."""
    nc, k = unknowns.shape
    found = np.full((nc, k, k), -1)
    for a in range(nc):
        for i in range(k):
            row = unknowns[a, i]
            if row < 0:
                break
            columns = indices[indptr[row] : indptr[row + 1]]
            for j in range(k):
                if unknowns[a, j] < 0:
                    break
                found[a, i, j] = indptr[row] + np.searchsorted(columns, unknowns[a, j])
    return found


@njit(cache=True)
def add_shares_to_rows(values, places, h, K):
    """As `add_shares` to a sparse matrix whose `values` have these places (nc, k, k); contacts that are open (K = 0) are passed over."""
    nc, d, k = h.shape
    Kh = np.empty((d, k))
    for a in range(nc):
        if not np.any(K[a] != 0.0):
            continue
        own = h[a]
        for i in range(d):
            for j in range(k):
                Kh[i, j] = 0.0
            for l in range(d):
                f = K[a, i, l]
                for j in range(k):
                    Kh[i, j] += f * own[l, j]
        for i in range(k):
            if places[a, i, 0] < 0:
                break
            to = places[a, i]
            for j in range(k):
                if to[j] < 0:
                    break
                total = 0.0
                for l in range(d):
                    total += own[l, i] * Kh[l, j]
                values[to[j]] += total
