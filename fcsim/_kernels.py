"""Loops over contacts of the reduction, compiled by numba.

W while it is summed: `values` flat, of blocks (d, d) in rows `starts` (nc + 1,) of contacts `columns`, sorted; of a dense W where
`starts` is empty. A body's share of W is h C h^T: its compliance C between the columns of h, whose rows are those of its contacts.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
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
    seen = np.full(nc, -1, dtype=np.int64)
    starts = np.zeros(nc + 1, dtype=np.int64)
    columns = np.empty(0, dtype=np.int32)
    for filling in (False, True):
        if filling:
            columns = np.empty(starts[nc], dtype=np.int32)
            seen[:] = -1
        for a in range(nc):
            at = starts[a]
            for b in body[place[a - 1] if a else 0 : place[a]]:
                for other in contacts[first[b] : first[b + 1]]:
                    if seen[other] != a:
                        seen[other] = a
                        if filling:
                            columns[at] = other
                        at += 1
            if filling:
                columns[starts[a] : at].sort()
            else:
                starts[a + 1] = at
    return starts, columns


@njit(cache=True)
def alike_in_contacts(indptr, indices, n, unknowns, d):
    """Where a new group begins in the unknowns (k,) so that those of a group touch the same contacts of H (n, d nc; csc): (groups + 1,).

    Neighbours alone are compared, and by a hash: what is grouped by mistake only makes the group's share of W larger.
    """
    signature, last = np.zeros(n, dtype=np.int64), np.full(n, -1)
    for a in range((len(indptr) - 1) // d):
        for e in range(indptr[a * d], indptr[a * d + d]):
            if last[indices[e]] != a:
                last[indices[e]] = a
                signature[indices[e]] = 1000003 * (signature[indices[e]] ^ (a + 1))
    begin, groups = np.empty(len(unknowns) + 1, dtype=np.int64), 0
    for k in range(len(unknowns)):
        if k == 0 or signature[unknowns[k]] != signature[unknowns[k - 1]]:
            begin[groups] = k
            groups += 1
    begin[groups] = len(unknowns)
    return begin[: groups + 1]


@njit(cache=True)
def rows_by_body(indptr, indices, data, body, place, count, d):
    """H^T sorted by bodies: body b is on contacts[first[b]:first[b + 1]], and the p-th of all `contacts` has the rows d p ... of h.

    H (n, d nc) by columns (csc); body (n,): the body of each unknown, of `count`; place (n,): its column of h.
    Returns first (count + 1,), contacts and the csr arrays of h.
    """
    first, last = np.zeros(count + 1, dtype=np.int64), np.full(count, -1, dtype=np.int64)
    nc = (len(indptr) - 1) // d
    for a in range(nc):
        for e in range(indptr[d * a], indptr[d * a + d]):
            b = body[indices[e]]
            if last[b] != a:
                last[b] = a
                first[b + 1] += 1
    for b in range(count):
        first[b + 1] += first[b]
    contacts, free = np.empty(first[count], dtype=np.int64), first.copy()
    last[:] = -1
    row = np.empty(len(indices), dtype=np.int64)
    starts = np.zeros(d * len(contacts) + 1, dtype=np.int64)
    for a in range(nc):
        for i in range(d):
            for e in range(indptr[d * a + i], indptr[d * a + i + 1]):
                b = body[indices[e]]
                if last[b] != a:
                    last[b] = a
                    contacts[free[b]] = a
                    free[b] += 1
                row[e] = d * (free[b] - 1) + i
                starts[row[e] + 1] += 1
    for k in range(d * len(contacts)):
        starts[k + 1] += starts[k]
    at = starts[:-1].copy()
    columns, values = np.empty(len(indices), dtype=np.int64), np.empty(len(indices))
    for e in range(len(indices)):
        k = at[row[e]]
        at[row[e]] += 1
        columns[k], values[k] = place[indices[e]], data[e]
    return first, contacts, starts, columns, values


@njit(cache=True)
def combine(indices, data, first, last, X, begin, row):
    """row[begin:] = sum of data[e] X[indices[e], begin:] for first <= e < last, four at a time: fewer passes over the row."""
    row[begin:] = 0
    for e in range(first, last, 4):
        e1, e2, e3 = min(e + 1, last - 1), min(e + 2, last - 1), min(e + 3, last - 1)
        x0, x1, x2, x3 = X[indices[e]], X[indices[e1]], X[indices[e2]], X[indices[e3]]
        c0, c1, c2, c3 = data[e], data[e1], data[e2], data[e3]
        if e + 1 >= last:
            c1 = 0.0
        if e + 2 >= last:
            c2 = 0.0
        if e + 3 >= last:
            c3 = 0.0
        for j in range(begin, len(row)):
            row[j] += c0 * x0[j] + c1 * x1[j] + c2 * x2[j] + c3 * x3[j]


@njit(cache=True)
def transposed_product(indptr, indices, data, first, C, panel, product):
    """product (n, k) = (h C)^T for C (n, n) and the k rows of h from `first` on; panel (rows, n) is work space that fits the cache."""
    n, k = product.shape
    for begin in range(0, k, len(panel)):
        count = min(len(panel), k - begin)
        for p in range(count):
            row = first + begin + p
            combine(indices, data, indptr[row], indptr[row + 1], C, 0, panel[p])
        for j in range(n):
            for p in range(count):
                product[j, begin + p] = panel[p, j]


@njit(cache=True)
def mirror(A):
    """Copy the upper triangle of A (n, n) to the lower one, in place."""
    step = 32  # rows that stay in the cache while they are written as columns
    for begin in range(0, len(A), step):
        for p in range(begin, len(A)):
            for q in range(begin, min(begin + step, p)):
                A[p, q] = A[q, p]


@njit(cache=True)
def congruence(indptr, indices, data, C):
    """h C h^T (k, k) for a symmetric C (n, n) and sparse rows h (k, n), half of it computed and the other half mirrored."""
    k, n = len(indptr) - 1, len(C)
    product, tile = np.empty((n, k)), np.empty((k, k))
    transposed_product(indptr, indices, data, 0, C, np.empty((32, n)), product)
    for p in range(k):
        combine(indices, data, indptr[p], indptr[p + 1], product, p, tile[p])
    mirror(tile)
    return tile


@njit(cache=True)
def add_tile(starts, columns, values, contacts, tile, d, nc):
    """Add a tile (k d, k d) between the contacts (k,), sorted, to W."""
    stride, at = d if len(starts) else nc * d, np.empty(len(contacts), dtype=np.int64)
    for p in range(len(contacts)):
        a = contacts[p]
        k = starts[a] if len(starts) else 0
        for q in range(len(contacts)):
            if len(starts):
                while columns[k] != contacts[q]:
                    k += 1
                at[q] = k * d * d
            else:
                at[q] = (a * nc * d + contacts[q]) * d
        for i in range(d):
            for q in range(len(contacts)):
                for j in range(d):
                    values[at[q] + i * stride + j] += tile[p * d + i, q * d + j]


@njit(cache=True)
def _add_body(starts, columns, values, contacts, indptr, indices, data, first, product, symmetric, d, nc, at, panel):
    """Add h (h C^T)^T to W: product (n, k d) = (h C^T)^T, h the rows from `first` on. Of a symmetric share half is computed."""
    k, stride = len(contacts), d if len(starts) else nc * d
    for p in range(k):
        at[p] = starts[contacts[p]] if len(starts) else 0
    for p in range(k):
        begin = p if symmetric else 0
        for i in range(d):
            row = first + d * p + i
            combine(indices, data, indptr[row], indptr[row + 1], product, d * begin, panel[i])
        a, own = contacts[p], at[p]
        for q in range(begin, k):
            b = contacts[q]
            if len(starts):
                while columns[own] != b:
                    own += 1
                place = own * d * d
            else:
                place = (a * nc * d + b) * d
            for i in range(d):
                for j in range(d):
                    values[place + i * stride + j] += panel[i, d * q + j]
            if symmetric and q > p:
                if len(starts):
                    while columns[at[q]] != a:
                        at[q] += 1
                    place = at[q] * d * d
                else:
                    place = (b * nc * d + a) * d
                for i in range(d):
                    for j in range(d):
                        values[place + j * stride + i] += panel[i, d * q + j]


@njit(cache=True)
def add_bodies(starts, columns, values, first, contacts, indptr, indices, data, begin, end, C, symmetric, d, nc):
    """Add the shares h C h^T of bodies begin ... end - 1, given as by `rows_by_body`, that have one compliance C (n, n).

    Where C is not symmetric it is given transposed.
    """
    n, k = len(C), 0
    for b in range(begin, end):
        k = max(k, first[b + 1] - first[b])
    work, panel, rows, at = np.empty(n * k * d), np.empty((32, n)), np.empty(k * d * d), np.empty(k, dtype=np.int64)
    for b in range(begin, end):
        own = contacts[first[b] : first[b + 1]]
        product = work[: n * len(own) * d].reshape(n, len(own) * d)
        transposed_product(indptr, indices, data, first[b] * d, C, panel, product)
        part = rows[: len(own) * d * d].reshape(d, len(own) * d)
        _add_body(starts, columns, values, own, indptr, indices, data, first[b] * d, product, symmetric, d, nc, at, part)


@njit(cache=True)
def add_diagonal_bodies(starts, columns, values, first, contacts, indptr, indices, data, begin, C, group, d, nc):
    """Add the shares h C h^T of the bodies from `begin` on whose C are diagonal: C[group[k]:group[k + 1]] that of the k-th one."""
    for g in range(len(group) - 1):
        own = contacts[first[begin + g] : first[begin + g + 1]]
        if len(own) == 0:
            continue
        product = np.zeros((group[g + 1] - group[g], len(own) * d))
        row = first[begin + g] * d
        for p in range(len(own) * d):
            for e in range(indptr[row + p], indptr[row + p + 1]):
                product[indices[e], p] += C[group[g] + indices[e]] * data[e]
        at, panel = np.empty(len(own), dtype=np.int64), np.empty((d, len(own) * d))
        _add_body(starts, columns, values, own, indptr, indices, data, row, product, True, d, nc, at, panel)
