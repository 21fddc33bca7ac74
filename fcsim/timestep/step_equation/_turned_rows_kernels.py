"""Loops over the entries of the contact matrix, compiled by numba."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def turned_rows(axes, indptr, indices, data, body, rotation):
    """T^T H for H by columns with sorted row numbers, where T turns the d rows of node k by rotation[body[k]] (d, d).

    body: of the first nodes, all of one size d; rows of what follows them stay as they are. Columns get all d rows of a node that they
    touch. axes: range(d) as a tuple, whose length the compiler knows. Returns indptr, indices, data.
    """
    d, columns = len(axes), len(indptr) - 1
    elastic = d * len(body)
    count = 0
    starts = np.zeros(columns + 1, dtype=indptr.dtype)
    for c in range(columns):
        last = -d
        for e in range(indptr[c], indptr[c + 1]):
            if indices[e] >= elastic:
                count += 1
            elif not last <= indices[e] < last + d:  # another node; a division would take as long as all else
                last = indices[e] - indices[e] % d
                count += d
        starts[c + 1] = count
    rows, values = np.empty(count, dtype=indices.dtype), np.zeros(count)
    at = 0
    for c in range(columns):
        last, first, b = -d, 0, 0
        for e in range(indptr[c], indptr[c + 1]):
            row, value = indices[e], data[e]
            if row >= elastic:
                rows[at], values[at] = row, value
                at += 1
                continue
            if not last <= row < last + d:
                last, first = row - row % d, at
                b = body[last // d]
                for i in range(d):
                    rows[at + i] = last + i
                at += d
            for i in range(d):
                values[first + i] += rotation[b, row - last, i] * value
    return starts, rows, values
