"""The blocks Q and R of the two-level preconditioner and what it does with them, compiled; contacts and joints as in `_joint_kernels`."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.linear._front_kernels import dot
from fcsim.solvers.newton.systems.two_level._joint_kernels import diagonal_alone


@njit(cache=True)
def blocks_of(values, starts, which):
    """The blocks values[starts[k] : starts[k + 1]] of each k in `which`, one after the other."""
    size = 0
    for k in which:
        size += starts[k + 1] - starts[k]
    blocks, at = np.empty(size, dtype=values.dtype), 0
    for k in which:
        n = starts[k + 1] - starts[k]
        for e in range(n):
            blocks[at + e] = values[starts[k] + e]
        at += n
    return blocks


@njit(cache=True)
def put_blocks(values, starts, which, blocks):
    """Write what `blocks_of` gave back to its place."""
    at = 0
    for k in which:
        n = starts[k + 1] - starts[k]
        for e in range(n):
            values[starts[k] + e] = blocks[at + e]
        at += n


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def three_dots(a, b, c, x):
    """a . x, b . x, c . x, each as `dot` sums it: rows of joints are short, and three at once wait for each other's sums no more than one
    does."""
    first = second = third = a.dtype.type(0)
    for i in range(len(x)):
        first += a[i] * x[i]
        second += b[i] * x[i]
        third += c[i] * x[i]
    return first, second, third


@njit(cache=True, nogil=True)
def solve_joints(Q, Q_starts, cuts, begins, wide, G, first, last, x, z, sums):
    """z of the own contacts of the joints first, ..., last - 1: Q x; sums (joints, 2 k): G_o^T z. x, z (nc, d) and G of Q's precision."""
    d = x.shape[1]
    most = 0
    for k in range(first, last):
        most = max(most, begins[k + 1] - begins[k])
    given = np.empty(most * d, dtype=x.dtype)
    for k in range(first, last):
        own = wide[begins[k] : begins[k + 1]]
        n = len(own) * d
        for i in range(len(own)):
            for p in range(d):
                given[i * d + p] = x[own[i], p]
        at, total, there = Q_starts[k], sums[k], given[:n]
        total[:] = 0
        for a in range(cuts[k], cuts[k + 1]):
            if d == 3:
                x0, x1, x2 = three_dots(Q[at : at + n], Q[at + n : at + 2 * n], Q[at + 2 * n : at + 3 * n], there)
                motions0, motions1, motions2 = G[a, 0], G[a, 1], G[a, 2]
                z[a, 0], z[a, 1], z[a, 2] = x0, x1, x2
                for c in range(len(total)):
                    total[c] = ((total[c] + motions0[c] * x0) + motions1[c] * x1) + motions2[c] * x2
                at += 3 * n
                continue
            for p in range(d):
                value, motions = dot(Q[at : at + n], there), G[a, p]
                z[a, p] = value
                for c in range(len(total)):
                    total[c] += motions[c] * value
                at += n


@njit(cache=True)
def add_to_bodies(sums, cuts, bodies, c):
    """Add the joints' sums (joints, 2 k) to c (bodies, k) of their own bodies; bodies (nc, 2), -1 for none."""
    k = c.shape[1]
    for joint in range(len(sums)):
        at = 0
        for body in bodies[cuts[joint]]:
            if body >= 0:
                for j in range(k):
                    c[body, j] += sums[joint, at + j]
                at += k


@njit(cache=True, nogil=True)
def in_order(x, order, first, last, out):
    """out[a] = x[order[a]] (nc, d) for first <= a < last, in the precision of `out`."""
    for a in range(first, last):
        for i in range(x.shape[1]):
            out[a, i] = x[order[a], i]


@njit(cache=True, nogil=True)
def less_motions(R, R_starts, cuts, body_begins, listed, c, first, last, z, order, out):
    """out[order[a]] = z[a] - R c (nc, d) of the own contacts of the joints first, ..., last - 1, for c (bodies, k) of R's precision."""
    d, k = z.shape[1], c.shape[1]
    most = 0
    for joint in range(first, last):
        most = max(most, body_begins[joint + 1] - body_begins[joint])
    given = np.empty(most * k, dtype=c.dtype)
    for joint in range(first, last):
        bodies = listed[body_begins[joint] : body_begins[joint + 1]]
        n = len(bodies) * k
        for i in range(len(bodies)):
            for j in range(k):
                given[i * k + j] = c[bodies[i], j]
        at, there = R_starts[joint], given[:n]
        for a in range(cuts[joint], cuts[joint + 1]):
            to = order[a]
            if d == 3:
                x0, x1, x2 = three_dots(R[at : at + n], R[at + n : at + 2 * n], R[at + 2 * n : at + 3 * n], there)
                out[to, 0], out[to, 1], out[to, 2] = z[a, 0] - x0, z[a, 1] - x1, z[a, 2] - x2
                at += 3 * n
                continue
            for p in range(d):
                out[to, p] = z[a, p] - dot(R[at : at + n], there)
                at += n


@njit(cache=True, nogil=True)
def diagonals(A, B):
    """Which contacts (nc,) have a diagonal A and no B, and A's diagonal (nc, d)."""
    nc, d = len(A), A.shape[1]
    alone, diagonal = np.empty(nc, dtype=np.bool_), np.empty((nc, d))
    for a in range(nc):
        alone[a] = diagonal_alone(A[a], B[a])
        for i in range(d):
            diagonal[a, i] = A[a, i, i]
    return alone, diagonal


@njit(cache=True, nogil=True)
def apply_most_diagonal(A, B, alone, diagonal, y, x, first, last, z):
    """z = A y + B x (nc, d) of the contacts first, ..., last - 1, as `apply_blocks`; alone and diagonal: see `diagonals`. The blocks of A
    and B, six times what is written, are read for few."""
    d = x.shape[1]
    for a in range(first, last):
        if alone[a]:
            for i in range(d):
                z[a, i] = diagonal[a, i] * y[a, i]
            continue
        for i in range(d):
            s = A[a, i, 0] * y[a, 0]
            for j in range(1, d):
                s += A[a, i, j] * y[a, j]
            for j in range(d):
                s += B[a, i, j] * x[a, j]
            z[a, i] = s
