"""Loops over contacts of the reduction, compiled by numba.

W while it is summed: `values` flat, of blocks (d, d) in rows `starts` (nc + 1,) of contacts `columns`, sorted; of a dense W where
`starts` is empty. A body's share of W is h C h^T with its compliance C and its part h of H^T, stored by contacts: the p-th of all
pairs of a body and a contact has the `weights` (entries, 3) begins[p] to begins[p + 1] of h's columns `unknowns`; a weight belongs
to the three rows of the contact, in the plane the last is zero, so that rows are combined three at a time. `axes` is (0, 1[, 2]), whose
length d the compiler knows: it unrolls the loops over a block's entries.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def union_of_neighbours(first, contacts, nc):
    """Return starts (nc + 1,) and sorted columns of the block rows of W: contacts that share a body with contact a.

    Body b is on contacts[first[b]:first[b + 1]].
    """
    place = np.zeros(nc + 1, dtype=np.int64)
    for a in contacts:
        place[a + 1] += 1
    for a in range(nc):
        place[a + 1] += place[a]
    body = np.empty(len(contacts), dtype=np.int64)  # by contact; place[a] ends where contact a + 1 begins
    for b in range(len(first) - 1):
        for a in contacts[first[b] : first[b + 1]]:
            body[place[a]] = b
            place[a] += 1
    most = 0
    for b in range(len(first) - 1):
        most += (first[b + 1] - first[b]) ** 2
    starts, columns = np.zeros(nc + 1, dtype=np.int64), np.empty(most, dtype=np.int32)
    row, other = np.empty(nc, dtype=np.int32), np.empty(nc, dtype=np.int32)
    for a in range(nc):
        count = np.int64(0)  # 0 alone is a type of its own to numba, for which `merge` is compiled once more
        for b in body[place[a - 1] if a else 0 : place[a]]:
            count = merge(row, count, contacts[first[b] : first[b + 1]], other)
            row, other = other, row
        starts[a + 1] = starts[a] + count
        for k in range(count):
            columns[starts[a] + k] = row[k]
    return starts, columns[: starts[nc]].copy()


@njit(cache=True)
def merge(a, count, b, union):
    """Write the sorted union of the sorted numbers a[:count] and b to `union`; returns how many they are."""
    i, j, k = 0, 0, 0
    while i < count or j < len(b):
        if j == len(b) or (i < count and a[i] <= b[j]):
            j += j < len(b) and a[i] == b[j]
            union[k] = a[i]
            i += 1
        else:
            union[k] = b[j]
            j += 1
        k += 1
    return k


@njit(cache=True, nogil=True)
def of_one_pattern(indptr, indices, d, some):
    """Of each of `some` contacts (k,) whether its d columns of H have entries in the same rows, ascending (k,)."""
    found = np.empty(len(some), dtype=np.bool_)
    for a in range(len(found)):
        c = d * some[a]
        begin, n, same = indptr[c], indptr[c + 1] - indptr[c], True
        for i in range(1, d):
            same = same and indptr[c + i + 1] - indptr[c + i] == n
        for k in range(n if same else 0):
            row = indices[begin + k]
            same = same and (k == 0 or row > indices[begin + k - 1])
            for i in range(1, d):
                same = same and indices[begin + i * n + k] == row
        found[a] = same
    return found


@njit(cache=True, nogil=True)
def bodies_of_contacts(indptr, indices, body, d):
    """The bodies (nc, 2) of each contact, ascending, -1 where it has one alone or none, and whether some contact has more.

    H (n, d nc) by columns (csc); body (n,) as in `entries_by_body`.
    """
    nc = (len(indptr) - 1) // d
    bodies, more = np.full((nc, 2), -1), False
    alike = of_one_pattern(indptr, indices, d, np.arange(nc))
    for a in range(nc):
        first = second = last = -1
        for e in range(indptr[d * a], indptr[d * a + (1 if alike[a] else d)]):
            b = body[indices[e]]
            if b < 0 or b == last:
                continue
            last = b
            if first < 0:
                first = b
            elif b != first and second < 0:
                second = b
            elif b != first and b != second:
                more = True
        bodies[a, 0], bodies[a, 1] = (second, first) if 0 <= second < first else (first, second)
    return bodies, more


@njit(cache=True, nogil=True)
def entries_by_body(indptr, indices, data, body, column, count, d, some):
    """Sort the entries of H by bodies: body b is on contacts[first[b]:first[b + 1]], the rest is h as above.

    H (n, d nc) by columns (csc); body (n,): the body of each unknown, of `count`, -1 where it has no share in W; column (n,): its column of
    h; some (k,): the contacts that count, numbered by their places here. Returns first (count + 1,), contacts (pairs,), begins (pairs+1,),
    unknowns (entries,), weights (entries, 3).
    """
    nc, alike = len(some), of_one_pattern(indptr, indices, d, some)  # contacts of which one column says which unknowns they are on
    first, last = np.zeros(count + 1, dtype=np.int64), np.zeros(count, dtype=np.int64)  # last[b]: 1 + the last contact that met b
    for a in range(nc):
        for e in range(indptr[d * some[a]], indptr[d * some[a] + (1 if alike[a] else d)]):
            b = body[indices[e]]
            if b >= 0 and last[b] <= a:
                last[b] = a + 1
                first[b + 1] += 1
    for b in range(count):
        first[b + 1] += first[b]
        last[b] = 0
    contacts, begins = np.empty(first[count], dtype=np.int64), np.zeros(first[count] + 1, dtype=np.int64)
    pair, used = np.empty(len(indices), dtype=np.int64), np.zeros(count, dtype=np.int64)  # the pair of an entry, the pairs of a body
    met = np.zeros(len(body), dtype=np.int64)  # 1 + the last contact that met an unknown
    for a in range(nc):
        for e in range(indptr[d * some[a]], indptr[d * some[a] + (1 if alike[a] else d)]):
            b = body[indices[e]]
            pair[e] = -1
            if b >= 0:
                if last[b] <= a:
                    last[b] = a + 1
                    contacts[first[b] + used[b]] = a
                    used[b] += 1
                pair[e] = first[b] + used[b] - 1
                if met[indices[e]] <= a:
                    met[indices[e]] = a + 1
                    begins[pair[e] + 1] += 1
    for p in range(len(contacts)):
        begins[p + 1] += begins[p]
    unknowns, weights = np.empty(begins[-1], dtype=np.int64), np.zeros((begins[-1], 3))
    free, place = np.zeros(len(contacts), dtype=np.int64), np.empty(len(body), dtype=np.int64)
    for a in range(nc):
        if alike[a]:
            for e in range(indptr[d * some[a]], indptr[d * some[a] + 1]):
                p = pair[e]
                if p >= 0:
                    at = begins[p] + free[p]
                    unknowns[at] = column[indices[e]]
                    free[p] += 1
                    for i in range(d):
                        weights[at, i] = data[indptr[d * some[a] + i] + e - indptr[d * some[a]]]
            continue
        for i in range(d):
            for e in range(indptr[d * some[a] + i], indptr[d * some[a] + i + 1]):
                dof, p = indices[e], pair[e]
                if p >= 0:
                    if met[dof] <= nc + a:  # none of this contact yet
                        met[dof] = nc + a + 1
                        place[dof] = begins[p] + free[p]
                        unknowns[place[dof]] = column[dof]
                        free[p] += 1
                    weights[place[dof], i] += data[e]
    return first, contacts, begins, unknowns, weights


@njit(cache=True, nogil=True)
def weights_from(sources, data):
    """weights (entries, 3) of `entries_by_body` from H's values where each stands: sources (entries, 3) from 1 on, 0: a zero; less than 0:
    added to a zero, so that no -0 is left."""
    weights = np.empty(sources.shape)
    for e in range(len(sources)):
        for i in range(3):
            at = sources[e, i]
            weights[e, i] = data[at - 1] if at > 0 else 0.0 + data[-at - 1] if at < 0 else 0.0
    return weights


@njit(cache=True)
def combine(unknowns, weights, begin, end, X, since, rows):
    """rows[i, since:] = sum of weights[e, i] X[unknowns[e], since:] for begin <= e < end and i < 3."""
    row0, row1, row2 = rows[0], rows[1], rows[2]
    row0[:] = 0
    row1[:] = 0
    row2[:] = 0
    for e in range(begin, end, 3):  # three at a time, a node's: fewer passes over the rows
        f, g = min(e + 1, end - 1), min(e + 2, end - 1)
        x, y, z = X[unknowns[e]], X[unknowns[f]], X[unknowns[g]]
        f_counts, g_counts = 1.0 if e + 1 < end else 0.0, 1.0 if e + 2 < end else 0.0
        x0, x1, x2 = weights[e, 0], weights[e, 1], weights[e, 2]
        y0, y1, y2 = f_counts * weights[f, 0], f_counts * weights[f, 1], f_counts * weights[f, 2]
        z0, z1, z2 = g_counts * weights[g, 0], g_counts * weights[g, 1], g_counts * weights[g, 2]
        for j in range(since, len(row0)):
            row0[j] += x0 * x[j] + y0 * y[j] + z0 * z[j]
            row1[j] += x1 * x[j] + y1 * y[j] + z1 * z[j]
            row2[j] += x2 * x[j] + y2 * y[j] + z2 * z[j]


@njit(cache=True)
def combine_since(unknowns, weights, begin, end, X, since, rows):
    """`combine` of the columns from `since` on: a loop a row, since the compiler makes vectors of one row of parts, not of three."""
    row0, row1, row2 = rows[0, since:], rows[1, since:], rows[2, since:]
    row0[:] = 0
    row1[:] = 0
    row2[:] = 0
    for e in range(begin, end, 3):
        f, g = min(e + 1, end - 1), min(e + 2, end - 1)
        x, y, z = X[unknowns[e], since:], X[unknowns[f], since:], X[unknowns[g], since:]
        f_counts, g_counts = 1.0 if e + 1 < end else 0.0, 1.0 if e + 2 < end else 0.0
        x0, x1, x2 = weights[e, 0], weights[e, 1], weights[e, 2]
        y0, y1, y2 = f_counts * weights[f, 0], f_counts * weights[f, 1], f_counts * weights[f, 2]
        z0, z1, z2 = g_counts * weights[g, 0], g_counts * weights[g, 1], g_counts * weights[g, 2]
        for j in range(len(row0)):
            row0[j] += x0 * x[j] + y0 * y[j] + z0 * z[j]
        for j in range(len(row1)):
            row1[j] += x1 * x[j] + y1 * y[j] + z1 * z[j]
        for j in range(len(row2)):
            row2[j] += x2 * x[j] + y2 * y[j] + z2 * z[j]


@njit(cache=True)
def transposed_product(begins, unknowns, weights, first, C, axes, panel, product):
    """product (n, d k) = (h C)^T for C (n, n) and the k contacts of h from the pair `first` on; panel (3 c, n) is work space."""
    d = len(axes)
    n, k, step = len(C), product.shape[1] // d, len(panel) // 3
    for begin in range(0, k, step):
        count = min(step, k - begin)
        for p in range(count):
            pair = first + begin + p
            combine(unknowns, weights, begins[pair], begins[pair + 1], C, 0, panel[3 * p : 3 * p + 3])
        for j in range(n):
            for p in range(count):
                for i in range(d):
                    product[j, d * (begin + p) + i] = panel[3 * p + i, j]


@njit(cache=True)
def add_body(starts, columns, values, contacts, begins, unknowns, weights, first, product, symmetric, axes, nc, at, rows):
    """Add h (h C^T)^T to W: product (n, d k) = (h C^T)^T, h from the pair `first` on. Of a symmetric share half is computed.

    at (k,) and rows (3, d k) are work space.
    """
    k, d, dense = len(contacts), len(axes), len(starts) == 0
    stride, row0, row1, row2 = nc * d if dense else d, rows[0], rows[1], rows[2]
    for p in range(k):
        at[p] = 0 if dense else starts[contacts[p]]
    for p in range(k):
        a, own, since = contacts[p], at[p], p if symmetric else 0
        combine_since(unknowns, weights, begins[first + p], begins[first + p + 1], product, d * since, rows)
        for q in range(since, k):
            b = contacts[q]
            if not dense:
                while columns[own] != b:
                    own += 1
            place = np.uint64((a * nc * d + b) * d if dense else own * d * d)  # without a sign: no index counts from the end
            column = np.uint64(d * q)
            for j in range(d):
                x, y, z = column + np.uint64(j), place + np.uint64(j), np.uint64(stride)
                values[y] += row0[x]
                if d > 1:
                    values[y + z] += row1[x]
                if d > 2:
                    values[y + z + z] += row2[x]
        if not symmetric:
            continue
        for q in range(p + 1, k):
            b, across = contacts[q], at[q]
            if not dense:
                while columns[across] != a:
                    across += 1
                at[q] = across
            place = np.uint64((b * nc * d + a) * d if dense else across * d * d)
            column = np.uint64(d * q)
            for j in range(d):
                x, y = column + np.uint64(j), place + np.uint64(j * stride)
                values[y] += row0[x]
                if d > 1:
                    values[y + np.uint64(1)] += row1[x]
                if d > 2:
                    values[y + np.uint64(2)] += row2[x]


@njit(cache=True)
def rounds_of_bodies(first, contacts, nc, begin, count):
    """Numbers (count,) of rounds in which the bodies begin, begin + 1, ... add their shares: two that share a contact have different ones.

    Each takes the least that is free, in their order.
    """
    bodies = np.full((nc, 2), -1)
    rounds = np.full(count, -1)
    taken = np.full(count + 1, -1)
    for k in range(count):
        own = contacts[first[begin + k] : first[begin + k + 1]]
        for a in own:
            for other in bodies[a]:
                if other >= 0:
                    taken[rounds[other]] = k
        free = 0
        while taken[free] == k:
            free += 1
        rounds[k] = free
        for a in own:
            bodies[a, 0 if bodies[a, 0] < 0 else 1] = k
    return rounds


@njit(cache=True, nogil=True)
def add_bodies(starts, columns, values, first, contacts, begins, unknowns, weights, bodies, C, kind, symmetric, axes, nc):
    """Add the shares h C h^T of `bodies` (nb,) to W, with the compliances C[kind[0]], C[kind[1]], ... of C (c, n, n).

    Where they are not symmetric they are given transposed. A block of W belongs to two bodies at most, so that the order in which bodies
    add to it does not count.
    """
    n, k, d = C.shape[1], 0, len(axes)
    for b in bodies:
        k = max(k, first[b + 1] - first[b])
    work, panel, rows, at = np.empty(n * k * d), np.empty((30, n)), np.empty(3 * k * d), np.empty(k, dtype=np.int64)
    for i in range(len(bodies)):
        b = bodies[i]
        own = contacts[first[b] : first[b + 1]]
        m = len(own) * d
        product = work[: n * m].reshape(n, m)
        transposed_product(begins, unknowns, weights, first[b], C[kind[i]], axes, panel, product)
        place = rows[: 3 * m].reshape(3, m)
        add_body(starts, columns, values, own, begins, unknowns, weights, first[b], product, symmetric, axes, nc, at, place)


@njit(cache=True)
def add_diagonal_bodies(starts, columns, values, first, contacts, begins, unknowns, weights, begin, C, group, axes, nc):
    """Add the shares h C h^T of the bodies from `begin` on whose C are diagonal: C[group[k]:group[k + 1]] that of the k-th one."""
    d = len(axes)
    for g in range(len(group) - 1):
        pair = first[begin + g]
        own = contacts[pair : first[begin + g + 1]]
        m = len(own) * d
        if m == 0:
            continue
        product = np.zeros((group[g + 1] - group[g], m))
        for p in range(len(own)):
            for e in range(begins[pair + p], begins[pair + p + 1]):
                for i in range(d):
                    product[unknowns[e], d * p + i] = C[group[g] + unknowns[e]] * weights[e, i]
        at, rows = np.empty(len(own), dtype=np.int64), np.empty((3, m))
        symmetric = np.bool_(True)  # True alone is a type of its own to numba, for which `add_body` is compiled once more
        add_body(starts, columns, values, own, begins, unknowns, weights, pair, product, symmetric, axes, nc, at, rows)
