"""Loops over contacts, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import FloatArray, IntArray


@njit(cache=True)
def fill_contact_matrix(
    nodes: IntArray, weights: FloatArray, frame: FloatArray, indptr: IntArray, rows: IntArray, data: FloatArray
) -> None:
    """Write row numbers and values of the columns of H (see contact_matrix), given where they start; rows sorted in each column."""
    nc, k = nodes.shape
    d = frame.shape[1]
    real = np.empty(k, dtype=np.int64)
    for a in range(nc):
        n = 0
        for j in range(k):  # insertion sort by node number of the few nodes that count
            if nodes[a, j] >= 0 and weights[a, j] != 0.0:
                place = n
                while place > 0 and nodes[a, real[place - 1]] > nodes[a, j]:
                    real[place] = real[place - 1]
                    place -= 1
                real[place] = j
                n += 1
        for c in range(d):
            at = indptr[d * a + c]
            for s in range(n):
                for i in range(d):
                    rows[at] = d * nodes[a, real[s]] + i
                    data[at] = weights[a, real[s]] * frame[a, c, i]
                    at += 1
