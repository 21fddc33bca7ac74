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
def joint_blocks_of_bodies(pairs, bodies, h, compliances, joints, listing, starts, d, first, last, E):
    """Write the sum of h C h^T over the bodies `listing` of each joint first, ..., last - 1, on its contacts of d rows, to E.

    h: begins, unknowns, weights; compliances: C, place, size; joints: begins and wide; listing: begins and bodies of the joints.
    """
    begins, unknowns, weights = h
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
    total = np.empty((3, 3))
    for k in range(first, last):
        own = wide[joint_begins[k] : joint_begins[k + 1]]
        n = len(own)
        block = np.zeros((n, d, n, d))
        for b in listed[body_begins[k] : body_begins[k + 1]]:
            count, m = 0, 0
            for i in range(n):
                for s in range(2):
                    if bodies[own[i], s] == b:
                        on[count], of_pair[count] = i, pairs[own[i], s]
                        count += 1
            for i in range(count):
                for e in range(begins[of_pair[i]], begins[of_pair[i] + 1]):
                    if among[unknowns[e]] < 0:
                        among[unknowns[e]] = m
                        used[m] = unknowns[e]
                        m += 1
            part = np.empty((m, m))
            for i in range(m):
                at = place[b] + used[i] * size[b]
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
                for j in range(i + 1):
                    xx = xy = xz = yx = yy = yz = zx = zy = zz = 0.0
                    for e in range(begins[of_pair[j]], begins[of_pair[j] + 1]):
                        u = among[unknowns[e]]
                        x, y, z = row0[u], row1[u], row2[u]
                        w0, w1, w2 = weights[e, 0], weights[e, 1], weights[e, 2]
                        xx += x * w0
                        xy += x * w1
                        xz += x * w2
                        yx += y * w0
                        yy += y * w1
                        yz += y * w2
                        zx += z * w0
                        zy += z * w1
                        zz += z * w2
                    total[0, 0], total[0, 1], total[0, 2] = xx, xy, xz
                    total[1, 0], total[1, 1], total[1, 2] = yx, yy, yz
                    total[2, 0], total[2, 1], total[2, 2] = zx, zy, zz
                    for p in range(d):
                        for q in range(d):
                            block[on[i], p, on[j], q] += total[p, q]
            among[used[:m]] = -1
        for i in range(n):  # what was summed is below the diagonal: contacts of a body are in the joint's order
            for p in range(d):
                for j in range(n):
                    for q in range(d):
                        a, b = (i * d + p) * n * d + j * d + q, starts[k]
                        E[b + a] = block[i, p, j, q] if j <= i else block[j, q, i, p]
