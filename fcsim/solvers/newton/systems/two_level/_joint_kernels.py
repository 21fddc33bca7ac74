"""Loops over joints of the two-level preconditioner, compiled.

Contacts are numbered in the order of their joints: joint k has those from cuts[k] on. Its block is on them and, after them, the neighbours
that share nodes with them: wide[begins[k]:begins[k + 1]]. Blocks of numbers stand one after the other: that of joint k from starts[k] on.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def with_neighbours(first, contacts, begins, unknowns, sizes, position, cuts, most):
    """Return begins (joints + 1,) and `wide`: each joint's contacts and those that have an unknown of a body in common with them, at most
    `most` in all.

    first, contacts, begins, unknowns: the pairs of bodies and contacts as in `BodyShares`; sizes (bodies,): each body's unknowns, 0 for one
    through which no contact becomes another's neighbour; position (nc,): the number of a contact in the order of the joints.
    """
    nc = len(position)
    pairs = np.full((nc, 2), -1)
    body = np.empty(len(contacts), dtype=np.int64)
    listed = np.empty(len(unknowns), dtype=np.int64)
    where = np.zeros(len(first), dtype=np.int64)  # of a body's first unknown among the ends
    for b in range(len(first) - 1):
        where[b + 1] = where[b] + sizes[b]
    ends = np.zeros(where[-1] + 1, dtype=np.int64)
    for b in range(len(first) - 1):
        for p in range(first[b], first[b + 1]):
            a = position[contacts[p]]
            pairs[a, 0 if pairs[a, 0] < 0 else 1] = p
            body[p] = b
            if sizes[b]:
                for e in range(begins[p], begins[p + 1]):
                    ends[where[b] + unknowns[e] + 1] += 1
    for i in range(len(ends) - 1):
        ends[i + 1] += ends[i]
    free = ends[:-1].copy()
    for p in range(len(contacts)):
        if sizes[body[p]]:
            for e in range(begins[p], begins[p + 1]):
                i = where[body[p]] + unknowns[e]
                listed[free[i]] = position[contacts[p]]
                free[i] += 1
    met = np.full(nc, -1)
    places, wide, count = np.zeros(len(cuts), dtype=np.int64), np.empty(max(nc, 1), dtype=np.int64), 0
    for k in range(len(cuts) - 1):
        if count + max(most, cuts[k + 1] - cuts[k]) > len(wide):
            wide = np.concatenate((wide, np.empty(len(wide) + most + cuts[k + 1] - cuts[k], dtype=np.int64)))
        for a in range(cuts[k], cuts[k + 1]):
            met[a] = k
            wide[count] = a
            count += 1
        for a in range(cuts[k], cuts[k + 1]):
            for p in pairs[a]:
                if p < 0 or not sizes[body[p]]:
                    continue
                for e in range(begins[p], begins[p + 1]):
                    i = where[body[p]] + unknowns[e]
                    for b in listed[ends[i] : ends[i + 1]]:
                        if met[b] != k and count - places[k] < most:
                            met[b] = k
                            wide[count] = b
                            count += 1
        places[k + 1] = count
    return places, wide[:count].copy()


@njit(cache=True)
def bodies_of_joints(begins, wide, bodies, count):
    """Return for each joint which bodies its contacts `wide` are on, begins (joints + 1,) and bodies, its own two (or one) first."""
    places, listed, at = np.zeros(len(begins), dtype=np.int64), np.empty(2 * len(wide), dtype=np.int64), 0
    met = np.full(count, -1)
    for k in range(len(begins) - 1):
        for a in wide[begins[k] : begins[k + 1]]:
            for b in bodies[a]:
                if b >= 0 and met[b] != k:
                    met[b] = k
                    listed[at] = b
                    at += 1
        places[k + 1] = at
    return places, listed[:at].copy()


@njit(cache=True, nogil=True)
def modes_of_joint(own, listed, bodies, G, number):
    """G (3 n, bodies k) of the contacts `own` (n,) on the bodies `listed`; number (bodies,): scratch."""
    n, d, k = len(own), G.shape[1], G.shape[2] // 2
    for i in range(len(listed)):
        number[listed[i]] = i
    wide = np.zeros((n, d, len(listed) * k))
    for i in range(n):
        for s in range(2):
            b = bodies[own[i], s]
            if b >= 0:
                at = number[b] * k
                for p in range(d):
                    for c in range(k):
                        wide[i, p, at + c] = G[own[i], p, s * k + c]
    return wide.reshape(n * d, len(listed) * k)


@njit(cache=True, nogil=True)
def put(numbers, into, at):
    """Write numbers (n,) to into[at : at + n], as no assignment of a slice does: with it comes, in all that has one, the text of a refusal,
    which takes longer to compile than these loops."""
    for i in range(len(numbers)):
        into[at + i] = numbers[i]


@njit(cache=True, nogil=True)
def joint_blocks(indptr, indices, blocks, order, position, joints, modes, starts, first, last, E):
    """Write the blocks of W - G G^T of the joints first, ..., last - 1 to E.

    W by block rows; order (nc,): W's contacts in the order of the joints, position its inverse; joints: begins and wide; modes: G (nc, d,
    2 k), the bodies (nc, 2) of each contact, begins and bodies of the joints.
    """
    begins, wide = joints
    G, bodies, body_begins, listed = modes
    d, nc = G.shape[1], len(order)
    place, number = np.full(nc, -1), np.empty(max(1, listed.max() + 1 if len(listed) else 1), dtype=np.int64)
    for k in range(first, last):
        own = wide[begins[k] : begins[k + 1]]
        n = len(own)
        block = np.zeros((n, d, n, d))
        for i in range(n):
            place[own[i]] = i
        for i in range(n):
            a = order[own[i]]
            for e in range(indptr[a], indptr[a + 1]):
                j = place[position[indices[e]]]
                if j >= 0:
                    for p in range(d):
                        for q in range(d):
                            block[i, p, j, q] = blocks[e, p, q]
        for a in own:
            place[a] = -1
        g = modes_of_joint(own, listed[body_begins[k] : body_begins[k + 1]], bodies, G, number)
        rest, known = block.reshape(n * d, n * d), np.dot(g, g.T)
        for i in range(n * d):
            for j in range(n * d):
                E[starts[k] + i * n * d + j] = rest[i, j] - known[i, j]


@njit(cache=True, nogil=True)
def invert_joints(A, B, E, shift, cuts, joints, modes, starts, out, which):
    """Of the joints k in `which` write Q, the rows of its own contacts of (A (E + shift I) + B)^-1, R = Q A G, and T = G_o^T R, G_o the
    rows of its own contacts in the columns of its own bodies. out: Q, where each joint's begins, R and T likewise. Raises LinAlgError where
    a joint is singular.
    """
    begins, wide = joints
    G, bodies, body_begins, all_listed = modes
    Q, Q_starts, R, R_starts, T, T_starts = out
    d, k = G.shape[1], G.shape[2] // 2
    number = np.empty(max(1, all_listed.max() + 1 if len(all_listed) else 1), dtype=np.int64)
    for joint in which:
        own = wide[begins[joint] : begins[joint + 1]]
        listed = all_listed[body_begins[joint] : body_begins[joint + 1]]
        n, inner = len(own), cuts[joint + 1] - cuts[joint]
        g = modes_of_joint(own, listed, bodies, G, number)
        e, G3 = E[starts[joint] : starts[joint + 1]].reshape(n, d, n * d), g.reshape(n, d, -1)
        J, AG = np.zeros((n, d, n * d)), np.zeros(G3.shape)
        for i in range(n):
            for p in range(d):
                row, image = J[i, p], AG[i, p]
                for q in range(d):
                    x = A[own[i], p, q]
                    if x != 0:
                        other, mode = e[i, q], G3[i, q]
                        for c in range(n * d):
                            row[c] += x * other[c]
                        row[i * d + q] += x * shift
                        for c in range(len(mode)):
                            image[c] += x * mode[c]
                    row[i * d + q] += B[own[i], p, q]
        unit = np.zeros((n * d, inner * d))
        for i in range(inner * d):
            unit[i, i] = 1.0
        rows = np.ascontiguousarray(np.linalg.solve(np.ascontiguousarray(J.reshape(n * d, n * d).T), unit).T)
        two = 0
        for b in bodies[own[0]]:
            two += b >= 0
        own_modes = np.ascontiguousarray(g[: inner * d, : two * k].T)
        images = np.dot(rows, AG.reshape(n * d, -1))
        put(rows.ravel(), Q, Q_starts[joint])
        put(images.ravel(), R, R_starts[joint])
        put(np.dot(own_modes, images).ravel(), T, T_starts[joint])


@njit(cache=True)
def add_joints(T, T_starts, places, place_begins, body_begins, S):
    """Add the joints' T to the blocks S (blocks, k, k): block (i, j) of joint n to S[places[place_begins[n] + i times its bodies + j]]."""
    k = S.shape[1]
    for joint in range(len(T_starts) - 1):
        columns = body_begins[joint + 1] - body_begins[joint]
        for e in range(place_begins[joint + 1] - place_begins[joint]):
            i, j = e // columns, e % columns
            block = S[places[place_begins[joint] + e]]
            at = T_starts[joint] + i * k * columns * k + j * k
            for p in range(k):
                for q in range(k):
                    block[p, q] += T[at + p * columns * k + q]


@njit(cache=True, nogil=True)
def is_within(x, before, bound):
    """Whether all entries of x (d, d) are numbers and within `bound` of those of `before`."""
    within = True
    for i in range(len(x)):
        for j in range(len(x)):
            within &= abs(x[i, j] - before[i, j]) <= bound
    return within


@njit(cache=True, nogil=True)
def changed_contacts(A, B, order, share, A_before, B_before, first, last, far):
    """Write to far[a], first <= a < last, whether A of the contact order[a] has changed by more than `share` of its largest entry or its B
    by more than `share`, and then A and B over A_before[a] and B_before[a], which are none at first."""
    d = A.shape[1]
    for a in range(first, last):
        own_A, own_B, largest = A[order[a]], B[order[a]], 0.0
        for i in range(d):
            for j in range(d):
                largest = max(largest, abs(own_A[i, j]))
        far[a] = not (is_within(own_A, A_before[a], share * largest) and is_within(own_B, B_before[a], share))
        if far[a]:
            for i in range(d):
                for j in range(d):
                    A_before[a, i, j], B_before[a, i, j] = own_A[i, j], own_B[i, j]


@njit(cache=True, nogil=True)
def moved(diagonal, before, share):
    """Whether a contact's `diagonal` (nc, d) has changed by more than `share` of the largest entry that it had `before`."""
    for a in range(len(diagonal)):
        change, largest = 0.0, 0.0
        for i in range(diagonal.shape[1]):
            change, largest = max(change, abs(diagonal[a, i] - before[a, i])), max(largest, before[a, i])
        if change > share * largest:
            return True
    return False


@njit(cache=True, nogil=True)
def diagonal_alone(A, B):
    """Whether A (d, d) has a regular diagonal and no other entry, and B none, as the equations of a contact that sticks."""
    alone = True
    for i in range(len(A)):
        for j in range(len(A)):
            alone &= B[i, j] == 0 and (A[i, j] != 0) == (i == j)
    return alone


@njit(cache=True)
def normalised(A, B, rhs, compliance):
    """A, B and rhs as `normalise` makes them, which stay as they are."""
    A, B, rhs = A.copy(), B.copy(), rhs.copy()
    normalise(A, B, rhs, compliance)
    return A, B, rhs


@njit(cache=True)
def normalise(A, B, rhs, compliance):
    """Multiply A, B (nc, d, d) and rhs (nc, d), contact by contact, by (A c + B)^-1 for the compliances c (nc,): Gauss' elimination with
    pivots.

    Where A c + B is singular A, B and rhs stay as they are.
    """
    nc, d = rhs.shape
    rows = np.empty((d, 3 * d + 1))
    for a in range(nc):
        if diagonal_alone(A[a], B[a]):  # most contacts stick: what the elimination comes to
            for i in range(d):
                pivot = A[a, i, i] * compliance[a]
                A[a, i, i], rhs[a, i] = A[a, i, i] / pivot, rhs[a, i] / pivot
            continue
        for i in range(d):
            for j in range(d):
                rows[i, j] = A[a, i, j] * compliance[a] + B[a, i, j]
                rows[i, d + j], rows[i, 2 * d + j] = A[a, i, j], B[a, i, j]
            rows[i, 3 * d] = rhs[a, i]
        regular = True
        for k in range(d):
            best = k
            for i in range(k + 1, d):
                if abs(rows[i, k]) > abs(rows[best, k]):
                    best = i
            if rows[best, k] == 0:
                regular = False
                break
            for j in range(k, 3 * d + 1):
                rows[k, j], rows[best, j] = rows[best, j], rows[k, j]
            for j in range(3 * d, k - 1, -1):
                rows[k, j] /= rows[k, k]
            for i in range(d):
                if i != k and rows[i, k] != 0:
                    for j in range(3 * d, k - 1, -1):
                        rows[i, j] -= rows[i, k] * rows[k, j]
        if regular:
            for i in range(d):
                for j in range(d):
                    A[a, i, j], B[a, i, j] = rows[i, d + j], rows[i, 2 * d + j]
                rhs[a, i] = rows[i, 3 * d]
