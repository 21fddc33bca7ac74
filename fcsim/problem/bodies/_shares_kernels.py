"""Products and parts of W = sum of h C h^T by bodies, compiled.

first, contacts, begins, unknowns, weights: h by pairs of a body and a contact, as in `_delassus_kernels`; in the plane the third weights
are zero, and vectors and blocks have three rows a contact all the same.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def sides_of_pairs(first, contacts, bodies, side):
    """Write the bodies of each contact to bodies (nc, 2), -1 before, and which of the two each pair is to side (pairs,); False where a
    contact has more than two."""
    for b in range(len(first) - 1):
        for p in range(first[b], first[b + 1]):
            a = contacts[p]
            side[p] = 0 if bodies[a, 0] < 0 else 1
            if bodies[a, side[p]] >= 0:
                return False
            bodies[a, side[p]] = b
    return True


@njit(cache=True)
def pairs_of_contacts(first, contacts, nc):
    """Return starts (nc + 1,), pairs and bodies: those of contact a from starts[a] on, bodies ascending."""
    starts = np.zeros(nc + 1, dtype=np.int64)
    for a in contacts:
        starts[a + 1] += 1
    for a in range(nc):
        starts[a + 1] += starts[a]
    pairs, bodies = np.empty(len(contacts), dtype=np.int64), np.empty(len(contacts), dtype=np.int64)
    free = starts[:-1].copy()
    for b in range(len(first) - 1):
        for p in range(first[b], first[b + 1]):
            i = free[contacts[p]]
            free[contacts[p]] += 1
            pairs[i], bodies[i] = p, b
    return starts, pairs, bodies


@njit(cache=True)
def add_modes(first, contacts, begins, unknowns, weights, begin, kind, L, side, G):
    """Write h L of the bodies begin, begin + 1, ... with the motions L[kind[0]], L[kind[1]], ... (n, k) to G (nc, d, 2 k), zero before."""
    d, k = G.shape[1], L.shape[2]
    for i in range(len(kind)):
        own = L[kind[i]]
        for p in range(first[begin + i], first[begin + i + 1]):
            a, at = contacts[p], k * side[p]
            for e in range(begins[p], begins[p + 1]):
                for j in range(d):
                    weight = weights[e, j]
                    for c in range(k):
                        G[a, j, at + c] += weight * own[unknowns[e], c]


@njit(cache=True, nogil=True)
def gather_forces(first, contacts, begins, unknowns, weights, row, begin, end, x, forces):
    """Add h^T x, for x (3 nc,), of the bodies begin, ..., end - 1 to forces: those of body b stand from row[b] on."""
    for b in range(begin, end):
        own = forces[row[b] :]
        for p in range(first[b], first[b + 1]):
            a = 3 * contacts[p]
            x0, x1, x2 = x[a], x[a + 1], x[a + 2]
            if x0 == 0.0 and x1 == 0.0 and x2 == 0.0:
                continue
            for e in range(begins[p], begins[p + 1]):
                own[unknowns[e]] += weights[e, 0] * x0 + weights[e, 1] * x1 + weights[e, 2] * x2


@njit(cache=True, nogil=True)
def spread_velocities(begins, unknowns, weights, starts, pairs, rows, begin, end, velocities, u):
    """Add h v of the contacts begin, ..., end - 1 to u (3 nc,), the velocities v of their bodies from `rows` on; starts, pairs: see
    `pairs_of_contacts`."""
    for a in range(begin, end):
        for i in range(starts[a], starts[a + 1]):
            v, p = velocities[rows[i] :], pairs[i]
            u0, u1, u2 = 0.0, 0.0, 0.0
            for e in range(begins[p], begins[p + 1]):
                value = v[unknowns[e]]
                u0 += weights[e, 0] * value
                u1 += weights[e, 1] * value
                u2 += weights[e, 2] * value
            u[3 * a] += u0
            u[3 * a + 1] += u1
            u[3 * a + 2] += u2


@njit(cache=True, nogil=True)
def spread_velocities_of(which, begins, unknowns, weights, starts, pairs, rows, velocities, u):
    """`spread_velocities` of the contacts that `which` (nc,) says."""
    for a in range(len(which)):
        if which[a]:
            spread_velocities(begins, unknowns, weights, starts, pairs, rows, a, a + 1, velocities, u)


@njit(cache=True, nogil=True)
def contacts_moved(first, contacts, x):
    """Which contacts (nc,) are on a body that x (3 nc,) pushes at some contact."""
    moved = np.zeros(len(x) // 3, dtype=np.bool_)
    for b in range(len(first) - 1):
        own, pushed = contacts[first[b] : first[b + 1]], False
        for a in own:
            pushed |= x[3 * a] != 0.0 or x[3 * a + 1] != 0.0 or x[3 * a + 2] != 0.0
        if pushed:
            for a in own:
                moved[a] = True
    return moved


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
def add_rows(C, begin, end, unknowns, weights, i, row):
    """Write the sum of the rows C[unknowns[e]] times weights[e, i] for begin <= e < end to `row`, one term after the other; four of them
    while the row is at hand."""
    row[:] = 0.0
    e = begin
    while e + 4 <= end:
        a, b, c, d = C[unknowns[e]], C[unknowns[e + 1]], C[unknowns[e + 2]], C[unknowns[e + 3]]
        p, q, s, t = weights[e, i], weights[e + 1, i], weights[e + 2, i], weights[e + 3, i]
        for j in range(len(row)):
            row[j] = (((row[j] + p * a[j]) + q * b[j]) + s * c[j]) + t * d[j]
        e += 4
    while e < end:
        a, p = C[unknowns[e]], weights[e, i]
        for j in range(len(row)):
            row[j] += p * a[j]
        e += 1


@njit(cache=True, nogil=True)
def rows_of_shares(first, contacts, begins, unknowns, weights, begin, C, kind, some, wanted, place, lower, values):
    """Add h C h^T of the contacts a with wanted[a] >= 0 as rows and b with place[b] >= 0 as columns to `values`, those of the bodies
    begin + b for b in `some`; lower: only of columns up to the row's own place."""
    n = C.shape[1]
    rows = np.empty((3, n))
    for b in some:
        own = C[kind[b]]
        for p in range(first[begin + b], first[begin + b + 1]):
            at = 3 * wanted[contacts[p]]
            if at < 0:
                continue
            for i in range(3):
                add_rows(own, begins[p], begins[p + 1], unknowns, weights, i, rows[i])
            row0, row1, row2 = rows[0], rows[1], rows[2]
            for q in range(first[begin + b], first[begin + b + 1]):
                column = 3 * place[contacts[q]]
                if column < 0 or (lower and column > at):
                    continue
                x0, x1, x2, y0, y1, y2, z0, z1, z2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
                for e in range(begins[q], begins[q + 1]):
                    j = unknowns[e]
                    x, y, z = row0[j], row1[j], row2[j]
                    w0, w1, w2 = weights[e, 0], weights[e, 1], weights[e, 2]
                    x0 += x * w0
                    x1 += x * w1
                    x2 += x * w2
                    y0 += y * w0
                    y1 += y * w1
                    y2 += y * w2
                    z0 += z * w0
                    z1 += z * w1
                    z2 += z * w2
                row = values[at]
                row[column], row[column + 1], row[column + 2] = row[column] + x0, row[column + 1] + x1, row[column + 2] + x2
                row = values[at + 1]
                row[column], row[column + 1], row[column + 2] = row[column] + y0, row[column + 1] + y1, row[column + 2] + y2
                row = values[at + 2]
                row[column], row[column + 1], row[column + 2] = row[column] + z0, row[column + 1] + z1, row[column + 2] + z2


@njit(cache=True, nogil=True)
def mirrored(values):
    """Copy the lower triangle of values (m, m) to the upper one, by tiles that a core's cache holds."""
    m, tile = len(values), 24
    for rows in range(0, m, tile):
        for columns in range(0, rows + 1, tile):
            for i in range(rows, min(rows + tile, m)):
                for j in range(columns, min(columns + tile, i)):
                    values[j, i] = values[i, j]
