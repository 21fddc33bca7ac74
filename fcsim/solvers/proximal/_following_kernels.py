"""Paths in the bodies' velocities in one compiled call: what `Regularised.along` does piece by piece with `pieces.InVelocities`.

A piece changes J = M + H K H^T at one contact, by a matrix of low rank, mostly of rank one. With J' = J + p n^T (Sherman, Morrison),

    J'^-1 b = y - g (n . y) / (1 + n . g),    y = J^-1 b,    g = J^-1 p,

and the determinant turns its sign where 1 + n . g < 0. Along the path (way = 1, or -1 where it folds) velocities change by way e,

    J e = H K w + c,    so that a change K_a + l m^T, p = H_a l, n = H_a m, makes    e' = e + g (m . w_a - n . e) / (1 + n . g) :

one solution a piece. c is what the equations have been left with, H P(z) - H P(z_0) - M V (V: the way so far), over what is left of t:
where friction turns, z bends. That is looked at, and what is left of J e solved for again, every `period` pieces, where the matrix is
factored anew, and after a change whose 1 + n . g is a difference of nearly equal numbers, as where a stiff contact opens.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.linear.block_factors._single_factor_kernels import factorise_single, sign_single
from fcsim.linear.block_factors._single_kernels import solve_single
from fcsim.solvers.newton.systems._velocity_kernels import add_shares_to_rows
from fcsim.solvers.proximal._path_kernels import end_of_piece, law, on_its_way

ARRIVED, GIVEN_UP, SINGULAR = 0, 1, 2
"""How `follow_in_velocities` ends."""
NOTHING = 1e-13
"""Share of rho below which what is left of a contact's change is round-off."""
SOLVED_AGAIN = 5
"""How often at most what is left of J e is solved for again: each time the share of it that round-off made is left."""
LEAST_PIVOT = 1e-9
"""1 + n . g below which the matrix is factored anew."""
SMALL_PIVOT = 1e-4
"""1 + n . g below which what is left of J e is looked at."""
TRUSTED = 1e3
"""Times what the last solution that was looked at left over what was there before: as much the next ones with the same factor may leave."""
SHORT = 1e-9
"""Length of a piece that is none."""


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True, fastmath={"contract"})
def speeds(faces, unknowns, h, v, own, u):
    """u (nc, 4) = H^T v of v (n + 1,): h (nc, k, 4), of which d are not 0, for the unknowns (nc, k), n where a contact has fewer. Contacts
    from faces[g] to faces[g + 1] have the same, which are gathered once; own (k,) is room."""
    for g in range(len(faces) - 1):
        for j in range(len(own)):
            own[j] = v[unknowns[faces[g], j]]
        for a in range(faces[g], faces[g + 1]):
            u0 = u1 = u2 = u3 = 0.0
            for j in range(len(own)):
                speed = own[j]
                u0 += h[a, j, 0] * speed
                u1 += h[a, j, 1] * speed
                u2 += h[a, j, 2] * speed
                u3 += h[a, j, 3] * speed  # zeros, so that the compiler makes vectors
            u[a, 0], u[a, 1], u[a, 2], u[a, 3] = u0, u1, u2, u3


@njit(cache=True, nogil=True, fastmath={"contract"})
def rates(faces, unknowns, h, normals, e, w, rho, way, status, own, dz):
    """Into dz (nc, 3) -rho way (H^T e - w), of open contacts the normal one alone: the others are `carried`."""
    for g in range(len(faces) - 1):
        for j in range(len(own)):
            own[j] = e[unknowns[faces[g], j]]
        for a in range(faces[g], faces[g + 1]):
            factor = -rho[a] * way
            if status[a] == 0:
                u0 = 0.0
                for j in range(len(own)):
                    u0 += normals[a, j] * own[j]
                dz[a, 0], dz[a, 1], dz[a, 2] = factor * (u0 - w[a, 0]), 0.0, 0.0
                continue
            u0 = u1 = u2 = u3 = 0.0
            for j in range(len(own)):
                speed = own[j]
                u0 += h[a, j, 0] * speed
                u1 += h[a, j, 1] * speed
                u2 += h[a, j, 2] * speed
                u3 += h[a, j, 3] * speed
            dz[a, 0], dz[a, 1], dz[a, 2] = factor * (u0 - w[a, 0]), factor * (u1 - w[a, 1]), factor * (u2 - w[a, 2])


@njit(cache=True, nogil=True)
def carried(unknowns, h, a, V, t, w, factor, z):
    """Add factor (H_a^T V - t w_a) to the tangential z of contact a: while it is open z lacks that, with its rho, from the path's begin."""
    u1, u2 = -t * w[a, 1], -t * w[a, 2]
    for j in range(h.shape[1]):
        u1 += h[a, j, 1] * V[unknowns[a, j]]
        u2 += h[a, j, 2] * V[unknowns[a, j]]
    z[a, 1] += factor * u1
    z[a, 2] += factor * u2


@njit(cache=True, nogil=True, fastmath={"contract"})
def push(unknowns, h, a, f0, f1, f2, b):
    """Add H_a f of contact a to b (n + 1,)."""
    for j in range(h.shape[1]):
        b[unknowns[a, j]] += h[a, j, 0] * f0 + h[a, j, 1] * f1 + h[a, j, 2] * f2


@njit(cache=True, nogil=True)
def push_all(unknowns, h, r, b):
    """Add H r to b (n + 1,), r (nc, 3)."""
    for a in range(len(r)):
        if r[a, 0] != 0.0 or r[a, 1] != 0.0 or r[a, 2] != 0.0:
            push(unknowns, h, a, r[a, 0], r[a, 1], r[a, 2], b)


@njit(cache=True, nogil=True, fastmath={"contract"})
def add_product(mass, v, factor, b):
    """Add factor M v to b, M by rows."""
    starts, places, values = mass
    for i in range(len(starts) - 1):
        total = 0.0
        for e in range(starts[i], starts[i + 1]):
            total += values[e] * v[places[e]]
        b[i] += factor * total


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def take_changes(y, changes, count):
    """Make y = J_0^-1 b (n,) J_k^-1 b in place: k = count changes g (k, n), n (k, .) on the unknowns `columns`, pivots 1 + n . g."""
    columns, n, g, pivots = changes
    for i in range(count):
        total = 0.0
        for j in range(columns.shape[1]):
            total += n[i, j] * y[columns[i, j]]
        total /= pivots[i]
        if total != 0.0:
            own = g[i]
            for l in range(g.shape[1]):
                y[l] -= total * own[l]


@njit(cache=True, nogil=True)
def solved(fronts, changes, count, b, room):
    """Into the last array of `room` J^-1 b (n + 1,), with the changes since the fronts were factored; returns it."""
    x, buffer, y = room
    solve_single(*fronts, b, x, buffer, y)
    take_changes(y, changes, count)
    return y


@njit(cache=True, nogil=True)
def change(C, least, unknowns, h, a, w, fronts, changes, count, e, b, room):
    """Add C (3, 3) at contact a to the changes (columns, n, g, pivots) and to e (n + 1,): (their number, the sign of their determinant, the
    least 1 + n . g); the number is -1 where there is no room, or a pivot is too small."""
    columns, n, g, pivots = changes
    rank, left, right = by_ranks(C, least)
    turned, smallest, last = 1, np.inf, g.shape[1]
    if count + rank > len(g):
        return -1, turned, smallest
    for q in range(rank):
        b[:] = 0.0
        push(unknowns, h, a, left[q, 0], left[q, 1], left[q, 2], b)
        y = solved(fronts, changes, count, b, room)
        pivot, left_out = 1.0, right[q, 0] * w[a, 0] + right[q, 1] * w[a, 1] + right[q, 2] * w[a, 2]
        for j in range(h.shape[1]):
            column = unknowns[a, j]
            value = h[a, j, 0] * right[q, 0] + h[a, j, 1] * right[q, 1] + h[a, j, 2] * right[q, 2]
            columns[count, j], n[count, j] = column, value
            pivot += value * y[column]
            left_out -= value * e[column]
        if not abs(pivot) > LEAST_PIVOT:
            return -1, turned, smallest
        pivots[count] = pivot
        for l in range(last):
            g[count, l] = y[l]
        left_out /= pivot
        for l in range(last):
            e[l] += left_out * y[l]
        count += 1
        smallest = min(smallest, abs(pivot))
        if pivot < 0:
            turned = -turned
    return count, turned, smallest


@njit(cache=True, nogil=True, fastmath={"contract"})
def left_of(faces, unknowns, h, mass, K, w, rest, z, mu, p0, V, status, e, room, b):
    """Into b (n + 1,) what J e = H K w + rest (H P(z) - p0 - M V) is left with, in one pass over the contacts; returns its square. room:
    (n + 1,), (k,), (k,)."""
    n, (total, own, pushed) = len(b) - 1, room
    for i in range(n):
        total[i] = e[i] + rest * V[i]
        b[i] = -rest * p0[i]
    add_product(mass, total, -1.0, b)
    for g in range(len(faces) - 1):
        for j in range(len(own)):
            own[j], pushed[j] = e[unknowns[faces[g], j]], 0.0
        for a in range(faces[g], faces[g + 1]):
            if status[a] == 0:
                continue
            u0 = u1 = u2 = u3 = 0.0
            for j in range(len(own)):
                speed = own[j]
                u0 += h[a, j, 0] * speed
                u1 += h[a, j, 1] * speed
                u2 += h[a, j, 2] * speed
                u3 += h[a, j, 3] * speed
            u0, u1, u2, share = w[a, 0] - u0, w[a, 1] - u1, w[a, 2] - u2, 1.0
            if status[a] == 2:
                size = np.sqrt(z[a, 1] * z[a, 1] + z[a, 2] * z[a, 2])
                share = mu[a] * z[a, 0] / size if size > 0.0 else 0.0
            f0 = K[a, 0, 0] * u0 + K[a, 0, 1] * u1 + K[a, 0, 2] * u2 + rest * z[a, 0]
            f1 = K[a, 1, 0] * u0 + K[a, 1, 1] * u1 + K[a, 1, 2] * u2 + rest * share * z[a, 1]
            f2 = K[a, 2, 0] * u0 + K[a, 2, 1] * u1 + K[a, 2, 2] * u2 + rest * share * z[a, 2]
            for j in range(len(own)):
                pushed[j] += h[a, j, 0] * f0 + h[a, j, 1] * f1 + h[a, j, 2] * f2
        for j in range(len(own)):
            b[unknowns[faces[g], j]] += pushed[j]
    b[n] = 0.0
    square = 0.0
    for i in range(n):
        square += b[i] * b[i]
    return square


@njit(cache=True, nogil=True)
def looked_at(
    faces, unknowns, h, mass, K, w, rest, z, mu, p0, V, status, fronts, changes, count, accuracy, solution, e, b, looking, room
):  # fmt: skip
    """Make e (n + 1,) the solution of J e = H K w + rest (H P(z) - p0 - M V), of which at most accuracy is left, by what is left of the e
    given. solution: share that the last solution was seen to leave of what was there before, `TRUSTED` times which the next one is
    trusted with; returns it, as seen anew where that was looked at."""
    before = 1.0
    for k in range(SOLVED_AGAIN + 1):
        square = left_of(faces, unknowns, h, mass, K, w, rest, z, mu, p0, V, status, e, looking, b)
        if k > 0:
            solution = np.sqrt(square / before)
        if square <= accuracy * accuracy:
            break
        if not square < np.inf:
            e[:], before, solution = 0.0, 1.0, np.inf
            continue
        y, before = solved(fronts, changes, count, b, room), square
        for i in range(len(b) - 1):
            e[i] += y[i]
        if TRUSTED * solution * np.sqrt(square) <= accuracy:
            break
    return solution


@njit(cache=True, nogil=True)
def follow_in_velocities(
    faces, unknowns, h, normals, rows, places, masses, plan, fronts, mass, z, status, w, mu, rho, d, least, most, turn, back,
    least_rest, room, accuracy, period,
):  # fmt: skip
    """`Regularised.along` from z, status on (nc, 3), (nc,) for w (nc, 3): (how it ended, pieces, z, H r (n,), status), all new; in 2D
    (d = 2) the last of three numbers are zeros. r and z are those of the path where it arrives alone.

    faces, unknowns (nc, k), h (nc, k, 4): as of `speeds`; normals (nc, k): of h; rows (nc, d, k), places (nc, k, k): h and places of
    `Bodies`; masses: M in the pattern of the bodies' matrix, whose `planned` is `plan`, factored into `fronts` (see `Bodies.fronts`);
    mass: M by rows (starts, columns, values); least, most: see `on_its_way`; room: changes before the matrix is factored anew; accuracy:
    what J e may be left with; period: pieces after which it is looked at.
    Long because it is one piece from its elimination to the next.
    """
    nc, n, k = len(status), len(mass[0]) - 1, h.shape[1]
    t, pieces, short, way, since = 0.0, np.int64(0), np.int64(0), 1, 0
    count, contact = np.int64(-1), np.int64(-1)  # a number alone is a type of its own to numba, compiled for once more
    z, status, dz, own, solution = z.copy(), status.copy(), np.empty((nc, 3)), np.empty(k), np.inf
    found, K = law(z, mu, rho, status)
    changes = np.empty((room, k), dtype=unknowns.dtype), np.empty((room, k)), np.empty((room, n)), np.empty(room)
    e, V, b, p0, C = np.zeros(n + 1), np.zeros(n + 1), np.zeros(n + 1), np.zeros(n + 1), np.empty((3, 3))
    push_all(unknowns, h, found, p0)
    buffers, looking = (np.empty(n), np.empty(n), np.zeros(n + 1)), (np.zeros(n + 1), own, np.empty(k))
    _, first, starts, _, offsets, values, borders, pivots = fronts
    reached = np.zeros(max(least, most) + 1)
    while on_its_way(pieces, least, most, t, short, reached[pieces // 2]):
        pieces += 1
        look = since >= period
        if contact >= 0 and count >= 0:
            _, new = law(z[contact : contact + 1], mu[contact : contact + 1], rho[contact : contact + 1], status[contact : contact + 1])
            for i in range(3):
                for j in range(3):
                    C[i, j] = new[0, i, j] - K[contact, i, j] if i < d and j < d else 0.0
                    K[contact, i, j] = new[0, i, j]
            count, turned, pivot = change(C, NOTHING * rho[contact], unknowns, h, contact, w, fronts, changes, count, e, b, buffers)
            way *= turned
            if pivot < SMALL_PIVOT:
                look, solution = True, np.inf
        else:
            count = np.int64(-1)
        if count < 0:
            found, K = law(z, mu, rho, status)
            shares = masses.copy()
            add_shares_to_rows(shares, places, rows, K)
            if not factorise_single(plan, first, starts, offsets, shares, values, borders, pivots):
                return SINGULAR, pieces, z, V, status
            count, way, look = np.int64(0), sign_single(first, starts, offsets, values, pivots), True
            solution = np.inf
        if look:
            rest, since = 1.0 / max(1.0 - t, least_rest), 0
            solution = looked_at(
                faces, unknowns, h, mass, K, w, rest, z, mu, p0, V, status, fronts, changes, count, accuracy, solution, e, b, looking,
                buffers,
            )  # fmt: skip
        since += 1
        rates(faces, unknowns, h, normals, e, w, rho, way, status, own, dz)
        length, contact, to = end_of_piece(z, dz, mu, status, turn)
        if way > 0 and t + length >= 1:
            for i in range(n + 1):
                V[i] += (1 - t) * e[i]
            for a in range(nc):
                for i in range(3):
                    z[a, i] += (1 - t) * dz[a, i]
                if status[a] == 0:
                    carried(unknowns, h, a, V, 1.0, w, -rho[a], z)
            add_product(mass, V, 1.0, p0)
            return ARRIVED, pieces, z, p0[:n], status
        t += way * length
        reached[pieces] = t
        if not back < t < np.inf:
            break
        if length < SHORT:
            short += 1
        for a in range(nc):
            for i in range(3):
                z[a, i] += length * dz[a, i]
        for i in range(n + 1):
            V[i] += (length * way) * e[i]
        if contact >= 0:
            if to == 0 or status[contact] == 0:
                carried(unknowns, h, contact, V, t, w, rho[contact] if to == 0 else -rho[contact], z)
            status[contact] = to
    return GIVEN_UP, pieces, z, V, status
