"""Loops over contacts, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import BoolArray, FloatArray, IntArray


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
def _in_order(nodes: IntArray, weights: FloatArray, real: IntArray) -> int:
    """How many of a contact's nodes (k,) count, and in `real` (k,) their places, sorted by node number (insertion: they are few)."""
    n = 0
    for j in range(len(nodes)):
        if nodes[j] >= 0 and weights[j] != 0.0:
            place = n
            while place > 0 and nodes[real[place - 1]] > nodes[j]:
                real[place] = real[place - 1]
                place -= 1
            real[place] = j
            n += 1
    return n


@njit(cache=True)
def fill_contact_matrix(
    nodes: IntArray, weights: FloatArray, frame: FloatArray, indptr: IntArray, rows: IntArray, data: FloatArray
) -> None:
    """Write row numbers and values of the columns of H (see contact_matrix), given where they start; rows sorted in each column."""
    nc, k = nodes.shape
    d = frame.shape[1]
    real = np.empty(k, dtype=np.int64)
    for a in range(nc):
        n = _in_order(nodes[a], weights[a], real)
        begin, size = indptr[d * a], d * n
        for c in range(d):
            for s in range(n):
                node, weight, at = d * nodes[a, real[s]], weights[a, real[s]], begin + c * size + d * s
                for i in range(d):
                    rows[np.uint64(at + i)] = node + i
                    data[np.uint64(at + i)] = weight * frame[a, c, i]


@njit(cache=True)
def starts_on_bodies(nodes: IntArray, weights: FloatArray, d: int, elastic: int, body: IntArray, k: int) -> tuple[IntArray, int]:
    """As `starts_of_columns` of H on all degrees of freedom, see `fill_on_bodies`: nodes from `elastic` on are points of rigid bodies, body
    (np,) the body of each, with k degrees of freedom each; those of a body stand together."""
    nc = len(nodes)
    starts, largest = np.zeros(d * nc + 1, dtype=np.int64), -1
    for a in range(nc):
        count = 0
        for j in range(nodes.shape[1]):
            node = nodes[a, j]
            largest = max(largest, node)
            if node < 0 or weights[a, j] == 0.0:
                continue
            if node < elastic:
                count += d
                continue
            if node - elastic >= len(body):
                continue
            new = True
            for i in range(j):
                other = nodes[a, i]
                if other >= elastic and weights[a, i] != 0.0 and body[other - elastic] == body[node - elastic]:
                    new = False
            count += k if new else 0
        for c in range(d):
            starts[d * a + c + 1] = starts[d * a + c] + count
    return starts, largest


@njit(cache=True)
def fill_on_bodies(
    nodes: IntArray,
    weights: FloatArray,
    frame: FloatArray,
    elastic: int,
    body: IntArray,
    arm: FloatArray,
    k: int,
    indptr: IntArray,
    rows: IntArray,
    data: FloatArray,
) -> None:
    """As `fill_contact_matrix` on all degrees of freedom: those of nodes below `elastic`, then k of each rigid body, on which a force g at
    its point p acts as (g, arm x g), arm (np, d). rows of no length are known already, and not written."""
    nc, most = nodes.shape
    d, known = frame.shape[1], len(rows) == 0
    real, split = np.empty(most, dtype=np.int64), d * elastic
    for a in range(nc):
        n = _in_order(nodes[a], weights[a], real)
        begin, size = indptr[d * a], indptr[d * a + 1] - indptr[d * a]
        deformable = 0
        while deformable < n and nodes[a, real[deformable]] < elastic:
            deformable += 1
        for c in range(d):
            for s in range(deformable):
                node, weight, at = d * nodes[a, real[s]], weights[a, real[s]], begin + c * size + d * s
                for i in range(d):
                    if not known:
                        rows[np.uint64(at + i)] = node + i
                    data[np.uint64(at + i)] = weight * frame[a, c, i]
            at, last = begin + c * size + d * deformable - k, -1
            for s in range(deformable, n):
                p, weight = nodes[a, real[s]] - elastic, weights[a, real[s]]
                if body[p] != last:
                    last, at = body[p], at + k
                    for i in range(k):
                        data[at + i] = 0.0
                        if not known:
                            rows[at + i] = split + k * last + i
                for i in range(d):
                    g = weight * frame[a, c, i]
                    data[at + i] += g
                    if d == 2:
                        data[at + 2] += arm[p, 0] * g if i == 1 else -arm[p, 1] * g
                    else:
                        after, before = (i + 1) % 3, (i + 2) % 3  # of arm x g e_i
                        data[at + 3 + after] += arm[p, before] * g
                        data[at + 3 + before] -= arm[p, after] * g


@njit(cache=True)
def of_same_nodes(nodes: IntArray, weights: FloatArray, other: IntArray, used: BoolArray) -> bool:
    """Whether contacts are on the nodes `other` (nc, k), those that count as `used` (nc, k) says."""
    for a in range(len(nodes)):
        for j in range(nodes.shape[1]):
            if nodes[a, j] != other[a, j] or (weights[a, j] != 0.0) != used[a, j]:
                return False
    return True


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
