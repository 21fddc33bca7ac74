"""Loops over contacts of the reduction, compiled by numba."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def add_tile(W, contacts, tile, d):
    """W[d a + i, d b + j] += tile[d p + i, d q + j] for a = contacts[p], b = contacts[q], in place."""
    k = len(contacts)
    for p in range(k):
        for i in range(d):
            row = W[contacts[p] * d + i]
            source = tile[p * d + i]
            for q in range(k):
                column = contacts[q] * d
                for j in range(d):
                    row[column + j] += source[q * d + j]


@njit(cache=True)
def union_of_neighbours(first_tile, tile_of, first, contacts, nc):
    """Return indptr (nc + 1,) and sorted columns of the block rows of W: contacts that share a tile with contact a.

    Contact a lies in the tiles tile_of[first_tile[a]:first_tile[a + 1]], tile t on contacts[first[t]:first[t + 1]].
    """
    indptr = np.zeros(nc + 1, dtype=np.int64)
    seen = np.full(nc, -1, dtype=np.int64)
    for a in range(nc):
        count = 0
        for s in range(first_tile[a], first_tile[a + 1]):
            for q in range(first[tile_of[s]], first[tile_of[s] + 1]):
                if seen[contacts[q]] != a:
                    seen[contacts[q]] = a
                    count += 1
        indptr[a + 1] = indptr[a] + count
    columns = np.empty(indptr[nc], dtype=np.int32)
    seen[:] = -1
    for a in range(nc):
        at = indptr[a]
        for s in range(first_tile[a], first_tile[a + 1]):
            for q in range(first[tile_of[s]], first[tile_of[s] + 1]):
                if seen[contacts[q]] != a:
                    seen[contacts[q]] = a
                    columns[at] = contacts[q]
                    at += 1
        columns[indptr[a] : at].sort()
    return indptr, columns


@njit(cache=True)
def add_tile_to_block_rows(indptr, columns, blocks, contacts, tile, d, place):
    """blocks of rows a and columns b += tile[d p + i, d q + j] for a = contacts[p], b = contacts[q]; place (nc,) is work space."""
    for p in range(len(contacts)):
        a = contacts[p]
        for k in range(indptr[a], indptr[a + 1]):
            place[columns[k]] = k
        for q in range(len(contacts)):
            block = blocks[place[contacts[q]]]
            for i in range(d):
                for j in range(d):
                    block[i, j] += tile[d * p + i, d * q + j]


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
def congruence(indptr, indices, data, C):
    """h C h^T (k, k) for a symmetric C (n, n) and sparse rows h (k, n), half of it computed and the other half mirrored."""
    k, n, step = len(indptr) - 1, len(C), 32  # rows that stay in the cache while they are written as columns
    columns, panel, tile = np.empty((n, k)), np.empty((step, n)), np.empty((k, k))
    for begin in range(0, k, step):
        count = min(step, k - begin)
        for p in range(count):
            combine(indices, data, indptr[begin + p], indptr[begin + p + 1], C, 0, panel[p])
        for j in range(n):
            for p in range(count):
                columns[j, begin + p] = panel[p, j]
    for p in range(k):
        combine(indices, data, indptr[p], indptr[p + 1], columns, p, tile[p])
    for begin in range(0, k, step):
        for p in range(begin, k):
            for q in range(begin, min(begin + step, p)):
                tile[p, q] = tile[q, p]
    return tile
