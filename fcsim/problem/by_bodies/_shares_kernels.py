"""Products and parts of W = sum h C h^T by bodies, compiled; first, contacts, begins, unknowns, weights: h by pairs of a body and a
contact, as in `_delassus_kernels`."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def gather_by_bodies(first, contacts, begins, unknowns, weights, begin, count, n, x):
    """Y (count, n) = h^T x of the bodies from `begin` on, for x (3 nc,)."""
    Y = np.zeros((count, n))
    for b in range(count):
        y = Y[b]
        for p in range(first[begin + b], first[begin + b + 1]):
            a = 3 * contacts[p]
            x0, x1, x2 = x[a], x[a + 1], x[a + 2]
            if x0 == 0.0 and x1 == 0.0 and x2 == 0.0:
                continue
            for e in range(begins[p], begins[p + 1]):
                y[unknowns[e]] += weights[e, 0] * x0 + weights[e, 1] * x1 + weights[e, 2] * x2
    return Y


@njit(cache=True, nogil=True)
def spread_by_contacts(first, contacts, begins, unknowns, weights, begin, Z, u):
    """Add h Z of the bodies from `begin` on, Z (count, n), to u (3 nc,)."""
    for b in range(len(Z)):
        z = Z[b]
        for p in range(first[begin + b], first[begin + b + 1]):
            u0, u1, u2 = 0.0, 0.0, 0.0
            for e in range(begins[p], begins[p + 1]):
                value = z[unknowns[e]]
                u0 += weights[e, 0] * value
                u1 += weights[e, 1] * value
                u2 += weights[e, 2] * value
            a = 3 * contacts[p]
            u[a] += u0
            u[a + 1] += u1
            u[a + 2] += u2


@njit(cache=True, nogil=True)
def diagonal_of_shares(first, contacts, begins, unknowns, weights, begin, C, kind, blocks):
    """Add the contacts' own blocks of h C h^T, the lower triangle mirrored, to blocks (nc, 3, 3)."""
    for b in range(len(kind)):
        own = C[kind[b]]
        for p in range(first[begin + b], first[begin + b + 1]):
            block = blocks[contacts[p]]
            for e in range(begins[p], begins[p + 1]):
                row = own[unknowns[e]]
                s0, s1, s2 = 0.0, 0.0, 0.0
                for f in range(begins[p], begins[p + 1]):
                    value = row[unknowns[f]]
                    s0 += value * weights[f, 0]
                    s1 += value * weights[f, 1]
                    s2 += value * weights[f, 2]
                w0, w1, w2 = weights[e, 0], weights[e, 1], weights[e, 2]
                block[0, 0] += w0 * s0
                block[1, 0] += w1 * s0
                block[1, 1] += w1 * s1
                block[2, 0] += w2 * s0
                block[2, 1] += w2 * s1
                block[2, 2] += w2 * s2
    for block in blocks:
        block[0, 1], block[0, 2], block[1, 2] = block[1, 0], block[2, 0], block[2, 1]


@njit(cache=True, nogil=True)
def rows_of_shares(first, contacts, begins, unknowns, weights, begin, C, kind, wanted, place, values):
    """Add h C h^T of the contacts a with wanted[a] >= 0 as rows and b with place[b] >= 0 as columns to `values`."""
    n = C.shape[1]
    rows = np.empty((3, n))
    for b in range(len(kind)):
        own = C[kind[b]]
        for p in range(first[begin + b], first[begin + b + 1]):
            at = 3 * wanted[contacts[p]]
            if at < 0:
                continue
            rows[:] = 0
            for e in range(begins[p], begins[p + 1]):
                source = own[unknowns[e]]
                for i in range(3):
                    row, w = rows[i], weights[e, i]
                    for j in range(n):
                        row[j] += w * source[j]
            row0, row1, row2 = rows[0], rows[1], rows[2]
            for q in range(first[begin + b], first[begin + b + 1]):
                column = 3 * place[contacts[q]]
                if column < 0:
                    continue
                for e in range(begins[q], begins[q + 1]):
                    j = unknowns[e]
                    x, y, z = row0[j], row1[j], row2[j]
                    for i in range(3):
                        w = weights[e, i]
                        values[at, column + i] += x * w
                        values[at + 1, column + i] += y * w
                        values[at + 2, column + i] += z * w
