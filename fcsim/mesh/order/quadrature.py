"""Quadrature on reference cells: products of Gauss rules, for simplices collapsed into one corner.

Source: A. H. Stroud, Approximate Calculation of Multiple Integrals, 1971 (conical product rules: all weights are positive).
"""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.special import roots_jacobi

from fcsim.arrays import FloatArray
from fcsim.mesh.cell_type import CellType


def quadrature(cell: CellType, points: int) -> tuple[FloatArray, FloatArray]:
    """Points (nq, d) and weights (nq,) with `points` Gauss points a direction: exact for polynomials of the degree 2 points - 1, in each
    direction on squares and cubes, in all together on simplices. The weights sum to the reference cell's volume."""
    d = cell.dimension
    if not cell.simplex:
        nodes, weights = np.polynomial.legendre.leggauss(points)
        return np.array(list(product(nodes, repeat=d))), np.array(list(product(weights, repeat=d))).prod(axis=1)
    rules = [roots_jacobi(points, power, 0) for power in range(d - 1, -1, -1)]  # weights (1 - t)^power of the collapsed coordinates
    t = np.array(list(product(*((1 + nodes) / 2 for nodes, _ in rules))))
    weights = np.array(list(product(*(w / 2 ** (power + 1) for (_, w), power in zip(rules, range(d - 1, -1, -1), strict=True)))))
    left = np.cumprod(np.concatenate([np.ones((len(t), 1)), 1 - t[:, :-1]], axis=1), axis=1)
    return t * left, weights.prod(axis=1)
