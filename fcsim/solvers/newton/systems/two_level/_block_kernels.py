"""The blocks Q and R of the two-level preconditioner and what it does with them, compiled; contacts and joints as in `_joint_kernels`."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.linear._front_kernels import dot


@njit(cache=True)
def blocks_of(values, starts, which):
    """The blocks values[starts[k] : starts[k + 1]] of each k in `which`, one after the other."""
    size = 0
    for k in which:
        size += starts[k + 1] - starts[k]
    blocks, at = np.empty(size, dtype=values.dtype), 0
    for k in which:
        n = starts[k + 1] - starts[k]
        blocks[at : at + n] = values[starts[k] : starts[k + 1]]
        at += n
    return blocks


@njit(cache=True)
def put_blocks(values, starts, which, blocks):
    """Write what `blocks_of` gave back to its place."""
    at = 0
    for k in which:
        n = starts[k + 1] - starts[k]
        values[starts[k] : starts[k + 1]] = blocks[at : at + n]
        at += n


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
        at, total = Q_starts[k], sums[k]
        total[:] = 0
        for a in range(cuts[k], cuts[k + 1]):
            for p in range(d):
                value, motions = dot(Q[at : at + n], given[:n]), G[a, p]
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
        at = R_starts[joint]
        for a in range(cuts[joint], cuts[joint + 1]):
            for p in range(d):
                out[order[a], p] = z[a, p] - dot(R[at : at + n], given[:n])
                at += n
