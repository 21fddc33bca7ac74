"""Loops over contacts of the reduction, compiled by numba."""

from __future__ import annotations

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
