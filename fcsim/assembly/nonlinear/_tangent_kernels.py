"""Sums over quadrature points and over cells, compiled by numba; each has a NumPy twin in the tests."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def cell_tangents(G, A, K):
    """K[c, a i, b k] += sum_q G[c, q, a, J] A[c, q, i, J, k, L] G[c, q, b, L]; i, k, J, L over the d axes of G; A (.., 3, 3, 3, 3)
    weighted."""
    cells, points, nodes, d = G.shape
    V = np.empty((d, d, nodes * d))
    for c in range(cells):
        for q in range(points):
            for i in range(d):
                for J in range(d):
                    for b in range(nodes):
                        for k in range(d):
                            s = 0.0
                            for L in range(d):
                                s += A[c, q, i, J, k, L] * G[c, q, b, L]
                            V[i, J, b * d + k] = s
            for a in range(nodes):
                for i in range(d):
                    row = K[c, a * d + i]
                    for J in range(d):
                        g, v = G[c, q, a, J], V[i, J]
                        for n in range(nodes * d):
                            row[n] += g * v[n]


@njit(cache=True)
def scatter_blocks(K, place, d, blocks):
    """blocks[place[c, a, b]] += K[c, a d ... , b d ...] (d, d): one body's cells into its blocks by rows of nodes."""
    cells, nodes = place.shape[:2]
    for c in range(cells):
        for a in range(nodes):
            for b in range(nodes):
                block = blocks[place[c, a, b]]
                for i in range(d):
                    for k in range(d):
                        block[i, k] += K[c, a * d + i, b * d + k]


@njit(cache=True)
def scatter_nodes(f, cells, nodal):
    """nodal[cells[c, a]] += f[c, a] (d,)."""
    for c in range(len(cells)):
        for a in range(cells.shape[1]):
            for i in range(f.shape[2]):
                nodal[cells[c, a], i] += f[c, a, i]
