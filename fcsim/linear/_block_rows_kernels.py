"""Block rows of W from other storages, and products by them, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def block_rows_of_dense(W, d):
    """Return dense W by block rows: indptr (nc + 1,), block columns, blocks (nnz, d, d) that are diagonal or not zero."""
    m = W.shape[0]
    nc = m // d
    nonzero = np.zeros((nc, nc), dtype=np.bool_)
    indptr = np.zeros(nc + 1, dtype=np.int64)
    touched = np.empty(m, dtype=np.bool_)
    for a in range(nc):
        touched[:] = False
        touched[d * a] = True
        for i in range(d * a, d * a + d):
            for j in range(m):  # without a branch: this pass reads all of W
                touched[j] |= W[i, j] != 0.0
        for b in range(nc):
            for j in range(d * b, d * b + d):
                nonzero[a, b] |= touched[j]
        indptr[a + 1] = indptr[a] + np.count_nonzero(nonzero[a])
    column = np.empty(indptr[nc], dtype=np.int64)
    blocks = np.empty((indptr[nc], d, d))
    for a in range(nc):
        k = indptr[a]
        for b in range(nc):
            if nonzero[a, b]:
                column[k] = b
                for i in range(d):
                    for j in range(d):
                        blocks[k, i, j] = W[d * a + i, d * b + j]
                k += 1
    return indptr, column, blocks


@njit(cache=True)
def block_rows_of_columns(starts, rows, values, d):
    """Return W by block rows, as `block_rows_of_dense`, from its compressed columns (repeated entries are added); columns come sorted."""
    nc = (len(starts) - 1) // d
    contact = np.repeat(np.arange(nc), d)  # of a row: a table is quicker than a division
    indptr = np.zeros(nc + 1, dtype=np.int64)
    seen = np.full(nc, -1)
    for b in range(nc):
        indptr[b + 1] += 1
        seen[b] = b
        first = -d
        for k in range(starts[d * b], starts[d * b + d]):
            if not first <= rows[k] < first + d:  # another block than the entry's before
                a = contact[rows[k]]
                first = d * a
                if seen[a] != b:
                    seen[a] = b
                    indptr[a + 1] += 1
    indptr = np.cumsum(indptr)
    column = np.empty(indptr[nc], dtype=np.int64)
    blocks = np.zeros((indptr[nc], d, d))
    following = indptr[:-1].copy()  # the place of a row's next block
    seen[:] = -1
    for b in range(nc):
        seen[b] = b
        column[following[b]] = b
        following[b] += 1
        for j in range(d):
            first, place = -d, 0
            for k in range(starts[d * b + j], starts[d * b + j + 1]):
                if not first <= rows[k] < first + d:
                    a = contact[rows[k]]
                    first = d * a
                    if seen[a] != b:
                        seen[a] = b
                        column[following[a]] = b
                        following[a] += 1
                    place = following[a] - 1
                blocks[place, rows[k] - first, j] += values[k]
    return indptr, column, blocks


@njit(cache=True)
def block_rows_of_rows(starts, columns, values, d):
    """Return W by block rows, as `block_rows_of_dense`, from its compressed rows (repeated entries are added)."""
    nc = (len(starts) - 1) // d
    contact = np.repeat(np.arange(nc), d)
    column = np.empty(nc + len(columns), dtype=np.int64)
    indptr = np.zeros(nc + 1, dtype=np.int64)
    place = np.full(nc, -1)  # of a column's block in the present row, or before it where there is none
    for a in range(nc):
        end = indptr[a]
        place[a], column[end] = end, a
        end += 1
        first = -d
        for k in range(starts[d * a], starts[d * a + d]):
            if not first <= columns[k] < first + d:
                b = contact[columns[k]]
                first = d * b
                if place[b] < indptr[a]:
                    place[b], column[end] = end, b
                    end += 1
        column[indptr[a] : end].sort()
        indptr[a + 1] = end
    column = column[: indptr[nc]].copy()
    blocks = np.zeros((indptr[nc], d, d))
    for a in range(nc):
        for k in range(indptr[a], indptr[a + 1]):
            place[column[k]] = k
        for i in range(d):
            first, own = -d, 0
            for k in range(starts[d * a + i], starts[d * a + i + 1]):
                if not first <= columns[k] < first + d:
                    b = contact[columns[k]]
                    first, own = d * b, place[b]
                blocks[own, i, columns[k] - first] += values[k]
    return indptr, column, blocks


@njit(cache=True)
def own_blocks(indptr, indices, blocks):
    """The blocks (nc, d, d) on the diagonal of block rows, repeated ones added."""
    d = blocks.shape[1]
    own = np.zeros((len(indptr) - 1, d, d))
    for a in range(len(own)):
        for k in range(indptr[a], indptr[a + 1]):
            if indices[k] == a:
                for i in range(d):
                    for j in range(d):
                        own[a, i, j] += blocks[k, i, j]
    return own


@njit(cache=True)
def product(indptr, indices, blocks, q, r):
    """u = W r + q (nc, 3) from block rows, whose columns of contacts with r = 0 are not read."""
    u = np.empty_like(q)
    rows_of_product(indptr, indices, blocks, q, r, np.int64(0), len(q), u)  # 0 alone is a type of its own to numba: compiled once more
    return u


@njit(cache=True, nogil=True)
def rows_of_product(indptr, indices, blocks, q, r, begin, end, u):
    """The rows begin, ..., end - 1 of u = W r + q, as in `product`."""
    nonzero = np.empty(len(r), dtype=np.bool_)
    for b in range(len(r)):
        nonzero[b] = r[b, 0] != 0.0 or r[b, 1] != 0.0 or r[b, 2] != 0.0
    one, three, flat = np.uint64(1), np.uint64(3), blocks.ravel()
    for a in range(begin, end):
        u0, u1, u2 = q[a, 0], q[a, 1], q[a, 2]
        for k in range(indptr[a], indptr[a + 1]):
            b = indices[k]
            if not nonzero[b]:
                continue
            s0, s1, s2 = r[b, 0], r[b, 1], r[b, 2]
            e = np.uint64(9 * k)  # without a sign: no index counts from the end, which is a quarter of the time
            u0 += flat[e] * s0 + flat[e + one] * s1 + flat[e + one + one] * s2
            e += three
            u1 += flat[e] * s0 + flat[e + one] * s1 + flat[e + one + one] * s2
            e += three
            u2 += flat[e] * s0 + flat[e + one] * s1 + flat[e + one + one] * s2
        u[a, 0], u[a, 1], u[a, 2] = u0, u1, u2


@njit(cache=True, nogil=True)
def row_patterns(starts, columns):
    """How many different patterns rows of blocks have that are coupled with one another, columns in order: contacts of the same two bodies
    are coupled with the same contacts."""
    found = 0
    for a in range(len(starts) - 1):
        size, new = starts[a + 1] - starts[a], True
        for k in range(starts[a], starts[a + 1]):
            b = columns[k]
            if b >= a or starts[b + 1] - starts[b] != size:
                continue
            same = True
            for i in range(size):
                if columns[starts[a] + i] != columns[starts[b] + i]:
                    same = False
                    break
            if same:
                new = False
                break
        found += new
    return found
