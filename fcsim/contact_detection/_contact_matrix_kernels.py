"""Loops over contacts, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import FloatArray, IntArray


@njit(cache=True)
def starts_of_columns(nodes: IntArray, weights: FloatArray, d: int) -> tuple[IntArray, int]:
    """Where the columns of H begin (d nc + 1,), see contact_matrix, and the largest node number, -1 where there is none."""
    nc, k = nodes.shape
    starts, largest = np.zeros(d * nc + 1, dtype=np.int64), -1
    for a in range(nc):
        count = 0
        for j in range(k):
            largest = max(largest, nodes[a, j])
            if nodes[a, j] >= 0 and weights[a, j] != 0.0:
                count += d
        for c in range(d):
            starts[d * a + c + 1] = starts[d * a + c] + count
    return starts, largest


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
        begin, size = indptr[d * a], d * n
        for c in range(d):
            for s in range(n):
                node, weight, at = d * nodes[a, real[s]], weights[a, real[s]], begin + c * size + d * s
                for i in range(d):
                    rows[np.uint64(at + i)] = node + i
                    data[np.uint64(at + i)] = weight * frame[a, c, i]


@njit(cache=True)
def along_normals(nodes: IntArray, weights: FloatArray, frame: FloatArray, vectors: FloatArray) -> FloatArray:
    """See `Contacts.along_normals`, in space."""
    along = np.zeros(len(nodes))
    for a in range(len(nodes)):
        x, y, z = frame[a, 0, 0], frame[a, 0, 1], frame[a, 0, 2]
        s = 0.0
        for k in range(nodes.shape[1]):
            w, node = weights[a, k], nodes[a, k]
            if node >= 0:
                s += w * vectors[node, 0] * x
                s += w * vectors[node, 1] * y
                s += w * vectors[node, 2] * z
        along[a] = s
    return along
