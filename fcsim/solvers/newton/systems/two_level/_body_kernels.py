"""Joints' blocks and motions from bodies' compliances, without entries of W, compiled.

pairs (nc, 2), bodies (nc, 2): the pairs of h that belong to a contact, and their bodies, -1 for none; begins, unknowns, weights: h as in
`_shares_kernels`; matrices of different sizes stand one after the other in one array, that of body b from place[b] on, of size[b] rows.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def modes_of_contacts(pairs, bodies, begins, unknowns, weights, L, place, G):
    """Write h L of the contacts' bodies to G (nc, d, 2 k), zero before; place[b]: where L (size[b], k) of body b begins."""
    d, k = G.shape[1], G.shape[2] // 2
    for a in range(len(pairs)):
        for s in range(2):
            p = pairs[a, s]
            if p < 0:
                continue
            own = L[place[bodies[a, s]] :]
            for e in range(begins[p], begins[p + 1]):
                for j in range(d):
                    weight, row = weights[e, j], own[unknowns[e] * k : (unknowns[e] + 1) * k]
                    for c in range(k):
                        G[a, j, s * k + c] += weight * row[c]


@njit(cache=True, nogil=True)
def _add_body(on, of_pair, h, compliance, work, block):
    """Add h C h^T of one body to block (n, d, n, d), at the contacts `on` (count,) of its pairs, below the diagonal: with C on the unknowns
    that these are at alone. compliance: C, its place and size; work: of `joint_blocks_of_bodies`, `among` -1 before and after."""
    begins, unknowns, weights = h
    C, place, size = compliance
    among, used, rows, across, sums = work
    count, d, m = len(on), block.shape[1], 0
    for i in range(count):
        for e in range(begins[of_pair[i]], begins[of_pair[i] + 1]):
            if among[unknowns[e]] < 0:
                among[unknowns[e]] = m
                used[m] = unknowns[e]
                m += 1
    part = np.empty((m, m))
    for i in range(m):
        at = place + used[i] * size
        for j in range(m):
            part[i, j] = C[at + used[j]]
    for i in range(count):
        row0, row1, row2 = rows[i, 0], rows[i, 1], rows[i, 2]
        row0[:m] = 0
        row1[:m] = 0
        row2[:m] = 0
        for e in range(begins[of_pair[i]], begins[of_pair[i] + 1]):
            source = part[among[unknowns[e]]]
            w0, w1, w2 = weights[e, 0], weights[e, 1], weights[e, 2]
            for j in range(m):
                row0[j] += w0 * source[j]
                row1[j] += w1 * source[j]
                row2[j] += w2 * source[j]
        for j in range(m):
            across[j, 3 * i], across[j, 3 * i + 1], across[j, 3 * i + 2] = row0[j], row1[j], row2[j]
    for j in range(count):  # with all contacts from j on at once
        to0, to1, to2 = sums[0, : 3 * (count - j)], sums[1, : 3 * (count - j)], sums[2, : 3 * (count - j)]
        to0[:] = 0
        to1[:] = 0
        to2[:] = 0
        for e in range(begins[of_pair[j]], begins[of_pair[j] + 1]):
            row = across[among[unknowns[e]], 3 * j : 3 * count]
            w0, w1, w2 = weights[e, 0], weights[e, 1], weights[e, 2]
            for i in range(len(row)):
                to0[i] += row[i] * w0
                to1[i] += row[i] * w1
                to2[i] += row[i] * w2
        for i in range(j, count):
            for p in range(d):
                for q in range(d):
                    block[on[i], p, on[j], q] += sums[q, 3 * (i - j) + p]
    among[used[:m]] = -1


@njit(cache=True, nogil=True)
def joint_blocks_of_bodies(pairs, bodies, h, compliances, joints, listing, starts, d, first, last, E):
    """Write the sum of h C h^T over the bodies `listing` of each joint first, ..., last - 1, on its contacts of d rows, to E.

    h: begins, unknowns, weights; compliances: C, place, size; joints: begins and wide; listing: begins and bodies of the joints.
    """
    C, place, size = compliances
    joint_begins, wide = joints
    body_begins, listed = listing
    most, widest = 0, 0
    for k in range(first, last):
        most = max(most, joint_begins[k + 1] - joint_begins[k])
        for b in listed[body_begins[k] : body_begins[k + 1]]:
            widest = max(widest, size[b])
    on, of_pair, rows = np.empty(most, dtype=np.int64), np.empty(most, dtype=np.int64), np.empty((most, 3, widest))
    among, used = np.full(widest, -1), np.empty(widest, dtype=np.int64)  # the unknowns of a body that a joint's contacts are at
    across, sums = np.empty((widest, 3 * most)), np.empty((3, 3 * most))
    for k in range(first, last):
        own = wide[joint_begins[k] : joint_begins[k + 1]]
        n = len(own)
        block = np.zeros((n, d, n, d))
        for b in listed[body_begins[k] : body_begins[k + 1]]:
            count = 0
            for i in range(n):
                for s in range(2):
                    if bodies[own[i], s] == b:
                        on[count], of_pair[count] = i, pairs[own[i], s]
                        count += 1
            _add_body(on[:count], of_pair, h, (C, place[b], size[b]), (among, used, rows, across, sums), block)
        order = n * d
        whole, out = block.reshape(order, order), E[starts[k] : starts[k + 1]].reshape(order, order)
        for i in range(order):  # what was summed is below the diagonal, whole blocks on it: contacts of a body are in the joint's order
            for j in range(i - i % d + d):
                out[i, j] = whole[i, j]
            for j in range(i - i % d):
                out[j, i] = whole[i, j]
