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
