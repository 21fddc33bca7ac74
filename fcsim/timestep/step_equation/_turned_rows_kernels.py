"""Loops over the entries of the contact matrix, compiled by numba."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def turned_rows(indptr, indices, data, body, rotation):
    """T^T H for H by columns with sorted row numbers, where T turns the d rows of node k by rotation[body[k]] (d, d).

    body: of the first nodes, all of one size d; rows of what follows them stay as they are. Columns get all d rows of a node that they
    touch. Returns indptr, indices, data.
    """
    d, columns = rotation.shape[1], len(indptr) - 1
    elastic = d * len(body)
    count = 0
    starts = np.zeros(columns + 1, dtype=indptr.dtype)
    for c in range(columns):
        last = -1
        for e in range(indptr[c], indptr[c + 1]):
            if indices[e] >= elastic:
                count += 1
            elif indices[e] // d != last:
                last = indices[e] // d
                count += d
        starts[c + 1] = count
    rows, values = np.empty(count, dtype=indices.dtype), np.zeros(count)
    at = 0
    for c in range(columns):
        last, first = -1, 0
        for e in range(indptr[c], indptr[c + 1]):
            row = indices[e]
            if row >= elastic:
                rows[at], values[at] = row, data[e]
                at += 1
                continue
            node, component = row // d, row % d
            if node != last:
                last, first = node, at
                for i in range(d):
                    rows[at] = d * node + i
                    at += 1
            R = rotation[body[node]]
            for i in range(d):
                values[first + i] += R[component, i] * data[e]
    return starts, rows, values
