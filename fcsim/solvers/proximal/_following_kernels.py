"""Paths in the bodies' velocities in one compiled call: what `Regularised.along` does piece by piece with `pieces.InVelocities`.

A piece changes J = M + H K H^T at one contact, by a matrix of low rank, mostly of rank one. With J_k+1 = J_k + p n^T (Sherman, Morrison),

    J_k+1^-1 b = y - g (n . y) / (1 + n . g),    y = J_k^-1 b,    g = J_k^-1 p,

and the determinant turns its sign where 1 + n . g < 0. Where a stiff contact opens that is a difference of nearly equal numbers:
M dv = H dr is looked at, and what is left of it is solved for again.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.linear.block_factors._lu_kernels import factorise, sign, solve
from fcsim.solvers.newton.systems._velocity_kernels import add_shares_to_rows
from fcsim.solvers.proximal._path_kernels import end_of_piece, law, on_its_way

ARRIVED, GIVEN_UP, SINGULAR = 0, 1, 2
"""How `follow_in_velocities` ends."""
NOTHING = 1e-13
"""Share of rho below which what is left of a contact's change is round-off."""
SOLVED_AGAIN = 5
"""How often at most what is left of the equations of motion is solved for again: each time the share of it that round-off made is left."""
LEAST_PIVOT = 1e-9
"""1 + n . g below which the matrix is factored anew."""
SHORT = 1e-9
"""Length of a piece that is none."""


@njit(cache=True)
def by_ranks(C, least):
    """C (d, d) = sum of p_k n_k^T by elimination with full pivoting, C is overwritten: (their number, p, n); pivots above least count."""
    d = len(C)
    p, n = np.zeros((d, d)), np.zeros((d, d))
    for k in range(d):
        pivot, row, column = least, -1, -1
        for i in range(d):
            for j in range(d):
                if abs(C[i, j]) > pivot:
                    pivot, row, column = abs(C[i, j]), i, j
        if row < 0:
            return k, p, n
        for i in range(d):
            p[k, i] = C[i, column] / C[row, column]
            n[k, i] = C[row, i]
        for i in range(d):
            for j in range(d):
                C[i, j] = 0.0 if i == row or j == column else C[i, j] - p[k, i] * n[k, j]
    return d, p, n


@njit(cache=True)
def take_changes(y, columns, n, g, pivots, count):
    """Make y = J_0^-1 b (n,) J_k^-1 b in place: k = count changes g (k, n), n (k, .) on the unknowns `columns`, pivots 1 + n . g."""
    for i in range(count):
        total = 0.0
        for j in range(columns.shape[1]):
            if columns[i, j] < 0:
                break
            total += n[i, j] * y[columns[i, j]]
        total /= pivots[i]
        if total != 0.0:
            own = g[i]
            for l in range(len(y)):
                y[l] -= total * own[l]


@njit(cache=True)
def change(C, least, unknowns, h, factor, changes, count):
    """Add C (d, d) at a contact with h (d, k) on the unknowns (k,) to the changes (columns, n, g, pivots): (their number, the sign of
    their determinant); the number is -1 where there is no room, or a pivot is too small."""
    columns, n, g, pivots = changes
    rank, left, right = by_ranks(C, least)
    turned = 1
    if count + rank > len(g):
        return -1, turned
    b = np.zeros(g.shape[1])
    for q in range(rank):
        b[:] = 0.0
        columns[count] = unknowns
        for j in range(len(unknowns)):
            if unknowns[j] < 0:
                break
            n[count, j] = 0.0
            for i in range(len(C)):
                b[unknowns[j]] += h[i, j] * left[q, i]
                n[count, j] += h[i, j] * right[q, i]
        y = solve(*factor, 1, b)
        take_changes(y, columns, n, g, pivots, count)
        pivot = 1.0
        for j in range(len(unknowns)):
            if unknowns[j] < 0:
                break
            pivot += n[count, j] * y[unknowns[j]]
        if not abs(pivot) > LEAST_PIVOT:
            return -1, turned
        g[count], pivots[count] = y, pivot
        count += 1
        if pivot < 0:
            turned = -turned
    return count, turned


@njit(cache=True)
def idle(status, r, a):
    """Whether contact a is open and has nothing left of its reaction, of r (nc, d)."""
    if status != 0:
        return False
    return r[a, 0] == 0.0 and r[a, 1] == 0.0 and (r.shape[1] == 2 or r[a, 2] == 0.0)


@njit(cache=True)
def direction(unknowns, h, mass, K, w, rest, found, status, r, rho, way, factor, changes, count, accuracy, dz, dr):
    """Along the path: dz, dr (nc, d) of (1 + K W) dr = way (K w + rest (found - r)), dz = -rho (W dr - way w).

    Idle contacts have K = 0 and no part in dr. mass: M by rows. M dv = H dr holds up to accuracy.
    Long because what is left of that is solved for again with the same loop.
    """
    nc, d, k = h.shape
    starts, places, values = mass
    columns, n, g, pivots = changes
    b, dv = np.zeros(len(starts) - 1), np.zeros(len(starts) - 1)
    for again in range(SOLVED_AGAIN + 2):
        if again > 0:
            y = solve(*factor, 1, b)
            take_changes(y, columns, n, g, pivots, count)
            for i in range(len(dv)):
                dv[i] += y[i]
        for i in range(len(dv)):
            total = 0.0
            for e in range(starts[i], starts[i + 1]):
                total += values[e] * dv[places[e]]
            b[i] = -total
        for a in range(nc):
            u0, u1, u2 = -way * w[a, 0], -way * w[a, 1], -way * w[a, 2] if d == 3 else 0.0
            for j in range(k if again > 0 else 0):  # dv is zero before: half of what a piece's first look would take
                if unknowns[a, j] < 0:
                    break
                speed = dv[unknowns[a, j]]
                u0 += h[a, 0, j] * speed
                u1 += h[a, 1, j] * speed
                if d == 3:
                    u2 += h[a, 2, j] * speed
            dz[a, 0], dz[a, 1] = -rho[a] * u0, -rho[a] * u1
            if d == 3:
                dz[a, 2] = -rho[a] * u2
            if idle(status[a], r, a):
                for i in range(d):
                    dr[a, i] = 0.0
                continue
            for i in range(d):
                total = way * rest * (found[a, i] - r[a, i]) - K[a, i, 0] * u0 - K[a, i, 1] * u1
                dr[a, i] = total - K[a, i, 2] * u2 if d == 3 else total
            for j in range(k):
                if unknowns[a, j] < 0:
                    break
                total = h[a, 0, j] * dr[a, 0] + h[a, 1, j] * dr[a, 1]
                b[unknowns[a, j]] += total + h[a, 2, j] * dr[a, 2] if d == 3 else total
        left = 0.0
        for i in range(len(b)):
            left += b[i] * b[i]
        if left <= accuracy * accuracy:
            break


@njit(cache=True)
def follow_in_velocities(
    unknowns, h, places, masses, pattern, factor, mass, z, status, w, mu, rho, least, most, turn, back, least_rest, room, accuracy
):  # fmt: skip
    """`Regularised.along` from z, status on (nc, d), (nc,) for w (nc, d): (how it ended, pieces, z, r, status), all new.

    unknowns (nc, k), h (nc, d, k), places (nc, k, k): as of `Bodies`; masses: M in the pattern (indptr, indices, mirror) of the bodies'
    matrix, whose fronts are in `factor`; mass: M by rows (starts, columns, values); least, most: see `on_its_way`; room: changes before
    the matrix is factored anew; accuracy: what M dv = H dr may be left with.
    Long because it is one piece from its elimination to the next.
    """
    nc, d, k = h.shape
    n, t, pieces, short, count, way, contact = len(mass[0]) - 1, 0.0, 0, 0, -1, 1, -1
    z, status = z.copy(), status.copy()
    found, now = law(z, mu, rho, status)
    r, K, dz, dr = found.copy(), now.copy(), np.empty((nc, d)), np.empty((nc, d))
    changes = np.empty((room, k), dtype=np.int64), np.empty((room, k)), np.empty((room, n)), np.empty(room)
    width, border, offsets, values, pivots = factor[5:]
    while on_its_way(pieces, least, most, t, short):
        pieces += 1
        if contact >= 0 and count >= 0:
            C = now[contact] - K[contact]
            K[contact] = now[contact]
            count, turned = change(C, NOTHING * rho[contact], unknowns[contact], h[contact], factor, changes, count)
            way *= turned
        else:
            count = -1
        if count < 0:
            K[:] = now
            shares = masses.copy()
            add_shares_to_rows(shares, places, h, K)
            if not factorise(*pattern, shares.reshape(-1, 1, 1), *factor):
                return SINGULAR, pieces, z, r, status
            count, way = 0, sign(width, border, offsets, values, pivots, 1)
        direction(
            unknowns, h, mass, K, w, 1.0 / max(1.0 - t, least_rest), found, status, r, rho, way, factor, changes, count, accuracy, dz, dr
        )
        length, contact, to = end_of_piece(z, dz, mu, status, turn)
        if way > 0 and t + length >= 1:
            return ARRIVED, pieces, z + (1 - t) * dz, r + (1 - t) * dr, status
        t += way * length
        if not back < t < np.inf:
            break
        if length < SHORT:
            short += 1
        for a in range(nc):
            for i in range(d):
                z[a, i] += length * dz[a, i]
                r[a, i] += length * dr[a, i]
        if contact >= 0:
            status[contact] = to
        found, now = law(z, mu, rho, status)
    return GIVEN_UP, pieces, z, r, status
