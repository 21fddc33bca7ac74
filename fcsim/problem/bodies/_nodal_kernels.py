"""Products with h where its rows are a facet's shape values times a frame, compiled.

Of a pair of a body and a contact whose entries are nodes with three unknowns each, one after the other, the weights of node i are s_i F, F
(3, 3) one for all nodes: F and the s_i are a quarter of the numbers that the weights are. h by pairs is that of `_delassus_kernels`:
entries begins[p], ..., begins[p + 1] - 1 belong to pair p, its nodes stand from begins[p] // 3 on.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

ROUND_OFF = 16 * np.finfo(np.float64).eps
"""Of s F, relative to its largest entry, up to which the weights are that."""


@njit(cache=True, nogil=True)
def largest_of_nodes(begin, end, unknowns, weights):
    """Where the node's three entries begin, of the entries begin, ..., end - 1, that hold the largest weight; -1: they are no nodes."""
    largest, at = 0.0, -1
    if (end - begin) % 3 != 0:
        return -1
    for e in range(begin, end, 3):
        if unknowns[e + 1] != unknowns[e] + 1 or unknowns[e + 2] != unknowns[e] + 2:
            return -1
        for k in range(3):
            for j in range(3):
                if abs(weights[e + k, j]) > largest:
                    largest, at = abs(weights[e + k, j]), e
    return at


@njit(cache=True, nogil=True)
def shape_values(F, begin, end, weights, shapes):
    """Write s of each node of the entries begin, ..., end - 1 to shapes; False where some weights are not s F."""
    row, column = 0, 0
    for k in range(3):
        for j in range(3):
            if abs(F[k, j]) > abs(F[row, column]):
                row, column = k, j
    for e in range(begin, end, 3):
        s = weights[e + row, column] / F[row, column]
        bound = ROUND_OFF * abs(weights[e + row, column])
        for k in range(3):
            for j in range(3):
                if not abs(weights[e + k, j] - s * F[k, j]) <= bound:
                    return False
        shapes[begin // 3 + (e - begin) // 3] = s
    return True


@njit(cache=True, nogil=True)
def nodes_of_pairs(begins, unknowns, weights, starts, pairs, rows, begin, end, frames, frame_of, nodes, shapes):
    """Of the pairs of the contacts begin, ..., end - 1 write F to frames (2, nc, 3, 3), each node's first unknown and s to nodes and shapes
    (entries // 3,), and to frame_of (pairs,) which of the 2 nc frames is theirs, -1 for pairs that are not of this kind; both bodies of a
    contact have one frame where they may. starts, pairs: see `pairs_of_contacts`; rows (pairs,): in that order, of a body's first unknown.
    """
    nc = len(starts) - 1
    for a in range(begin, end):
        known = 0  # frames of this contact
        for i in range(starts[a], starts[a + 1]):
            p = pairs[i]
            frame_of[p] = -1
            largest = largest_of_nodes(begins[p], begins[p + 1], unknowns, weights)
            if largest < 0:
                continue
            for which in range(min(known + 1, 2)):
                F = frames[which, a]
                if which == known:
                    for k in range(3):
                        for j in range(3):
                            F[k, j] = weights[largest + k, j]
                if not shape_values(F, begins[p], begins[p + 1], weights, shapes):
                    continue
                for e in range(begins[p], begins[p + 1], 3):
                    nodes[begins[p] // 3 + (e - begins[p]) // 3] = rows[i] + unknowns[e]
                frame_of[p], known = which * nc + a, max(known, which + 1)
                break


@njit(cache=True, nogil=True)
def gather_nodal_forces(first, contacts, begins, unknowns, weights, row, nodal, begin, end, x, forces):
    """`gather_forces`; nodal: frames (2 nc, 9), frame_of, nodes and shapes as `nodes_of_pairs` gives them."""
    frames, frame_of, nodes, shapes = nodal
    for b in range(begin, end):
        own = forces[row[b] :]
        for p in range(first[b], first[b + 1]):
            a = 3 * contacts[p]
            x0, x1, x2 = x[a], x[a + 1], x[a + 2]
            if x0 == 0.0 and x1 == 0.0 and x2 == 0.0:
                continue
            if frame_of[p] < 0:
                for e in range(begins[p], begins[p + 1]):
                    own[unknowns[e]] += weights[e, 0] * x0 + weights[e, 1] * x1 + weights[e, 2] * x2
                continue
            F = frames[frame_of[p]]
            f0 = F[0] * x0 + F[1] * x1 + F[2] * x2
            f1 = F[3] * x0 + F[4] * x1 + F[5] * x2
            f2 = F[6] * x0 + F[7] * x1 + F[8] * x2
            for e in range(begins[p] // 3, begins[p + 1] // 3):
                s, i = shapes[e], nodes[e]
                forces[i] += s * f0
                forces[i + np.uint32(1)] += s * f1
                forces[i + np.uint32(2)] += s * f2


@njit(cache=True, nogil=True)
def nodes_by_contacts(begins, starts, pairs, nodal, begin, end, begins_here, frame_here, nodes_here, shapes_here):
    """Write once more which frame, nodes and shape values the pairs of the contacts begin, ..., end - 1 have, those of pairs[i] from
    begins_here[i] on: what is read contact by contact then stands one after the other."""
    _, frame_of, nodes, shapes = nodal
    for i in range(starts[begin], starts[end]):
        first = begins[pairs[i]] // 3
        frame_here[i] = frame_of[pairs[i]]
        for e in range(begins_here[i + 1] - begins_here[i]):
            nodes_here[begins_here[i] + e], shapes_here[begins_here[i] + e] = nodes[first + e], shapes[first + e]


@njit(cache=True, nogil=True)
def spread_nodal_velocities(begins, unknowns, weights, starts, pairs, rows, nodal, begin, end, velocities, u):
    """`spread_velocities`; nodal: frames and, by contacts, begins, which frame, nodes and shape values, see `nodes_by_contacts`."""
    frames, begins_here, frame_here, nodes, shapes = nodal
    for a in range(begin, end):
        u0, u1, u2 = u[3 * a], u[3 * a + 1], u[3 * a + 2]
        for i in range(starts[a], starts[a + 1]):
            if frame_here[i] < 0:
                v, p = velocities[rows[i] :], pairs[i]
                for e in range(begins[p], begins[p + 1]):
                    value = v[unknowns[e]]
                    u0 += weights[e, 0] * value
                    u1 += weights[e, 1] * value
                    u2 += weights[e, 2] * value
                continue
            v0, v1, v2 = 0.0, 0.0, 0.0
            for e in range(begins_here[i], begins_here[i + 1]):
                s, j = shapes[e], nodes[e]
                v0 += s * velocities[j]
                v1 += s * velocities[j + np.uint32(1)]
                v2 += s * velocities[j + np.uint32(2)]
            F = frames[frame_here[i]]
            u0 += F[0] * v0 + F[3] * v1 + F[6] * v2
            u1 += F[1] * v0 + F[4] * v1 + F[7] * v2
            u2 += F[2] * v0 + F[5] * v1 + F[8] * v2
        u[3 * a], u[3 * a + 1], u[3 * a + 2] = u0, u1, u2


@njit(cache=True, nogil=True)
def spread_nodal_velocities_of(which, begins, unknowns, weights, starts, pairs, rows, nodal, velocities, u):
    """`spread_nodal_velocities` of the contacts that `which` (nc,) says."""
    for a in range(len(which)):
        if which[a]:
            spread_nodal_velocities(begins, unknowns, weights, starts, pairs, rows, nodal, a, a + 1, velocities, u)
