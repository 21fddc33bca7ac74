"""Pressure on facets that deform: nodal forces -int p N_a n da on the facets as they stand, and their derivative.

With shape functions N_a on the reference facet, x_,s = sum_a N_a,s x_a and n da = x_,1 x x_,2 (3D), (y_,1, -x_,1) (2D, outwards where the
body lies on the left)

    F_a = -p int N_a x_,1 x x_,2,   dF_a/dx_b = -p int N_a (N_b,2 [x_,1] - N_b,1 [x_,2]),  [t] w = t x w              (3D)
    F_a = -p t int N_a E x_,1,      dF_a/dx_b = -p t int N_a N_b,1 E,  E = ((0, 1), (-1, 0)), t the thickness             (2D)

by quadratures that are exact: these are polynomials. On a closed surface F is -p times the gradient of the volume inside, exactly, so that
it has no resultant and no moment and its derivative is symmetric. Of an open one the part that is not symmetric belongs to its rim.
Source: P. Wriggers, Nonlinear Finite Element Methods, Springer, 2008, section 4.2.5 (loads that depend on the deformation).
"""

from __future__ import annotations

from functools import cache

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.order.quadrature import quadrature

_TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])
_CROSS = np.zeros((3, 3, 3))  # [t]_ik = _CROSS_ijk t_j
_CROSS[[0, 1, 2], [1, 2, 0], [2, 0, 1]], _CROSS[[0, 1, 2], [2, 0, 1], [1, 2, 0]] = 1, -1


@cache
def _rule(d: int, nodes: int) -> tuple[FloatArray, FloatArray]:
    """N (nq, k) times the weights, and dN (nq, k, d - 1), of facets with k nodes in d dimensions."""
    if d == 2:
        s, weight = np.polynomial.legendre.leggauss(nodes)
        linear, first = np.stack([1 - s, 1 + s], axis=1) / 2, np.tile([-0.5, 0.5], (len(s), 1))
        if nodes == 2:
            return weight[:, None] * linear, first[:, :, None]
        shape = np.stack([s * (s - 1) / 2, s * (s + 1) / 2, 1 - s**2], axis=1)
        return weight[:, None] * shape, np.stack([s - 0.5, s + 0.5, -2 * s], axis=1)[:, :, None]
    kind = CELL_TYPES[{3: "triangle", 4: "quadrilateral", 6: "triangle6", 9: "quadrilateral9"}[nodes]]
    at, weights = quadrature(kind, 2 if kind.order == 1 else 3)
    return weights[:, None] * kind.shape(at), kind.gradient(at)


def facet_forces(points: FloatArray) -> FloatArray:
    """Nodal forces (nf, k, d) of p t = -1, that is int N_a n da, for facets with nodes at points (nf, k, d) [m]."""
    d = points.shape[2]
    shape, gradient = _rule(d, points.shape[1])
    along = np.einsum("fai,qas->sfqi", points, gradient)
    normal = along[0] @ _TURN.T if d == 2 else np.cross(along[0], along[1])
    forces: FloatArray = np.einsum("qa,fqi->fai", shape, normal, optimize=True)
    return forces


def facet_areas(points: FloatArray) -> FloatArray:
    """int N_a da (nf, k) [m^2] over facets in space with nodes at points (nf, k, 3) [m]."""
    shape, gradient = _rule(3, points.shape[1])
    along = np.einsum("fai,qas->sfqi", points, gradient)
    areas: FloatArray = np.einsum("qa,fq->fa", shape, np.linalg.norm(np.cross(along[0], along[1]), axis=2))
    return areas


def line_lengths(points: FloatArray) -> FloatArray:
    """int N_a ds (n, k) [m] over lines with nodes at points (n, k, d) [m], the middle last."""
    shape, gradient = _rule(2, points.shape[1])
    lengths: FloatArray = np.einsum("qa,fq->fa", shape, np.linalg.norm(np.einsum("fai,qa->fqi", points, gradient[:, :, 0]), axis=2))
    return lengths


def facet_tangents(points: FloatArray) -> FloatArray:
    """Derivatives (nf, k, k, d, d) [m] of `facet_forces` (f, a, ., i, .) by the nodes' places (f, ., b, ., k)."""
    d = points.shape[2]
    shape, gradient = _rule(d, points.shape[1])
    if d == 2:
        pairs = np.einsum("qa,qb->ab", shape, gradient[:, :, 0])
        return np.broadcast_to(pairs[:, :, None, None] * _TURN, (len(points), *pairs.shape, 2, 2))
    along = np.einsum("fai,qas->sfqi", points, gradient)
    first, second = np.einsum("ijk,sfqj->sfqik", _CROSS, along)
    tangents: FloatArray = np.einsum("qa,qb,fqik->fabik", shape, gradient[:, :, 1], first, optimize=True)
    tangents -= np.einsum("qa,qb,fqik->fabik", shape, gradient[:, :, 0], second, optimize=True)
    return tangents


def nodal_sum(values: FloatArray, facets: IntArray, n_nodes: int) -> FloatArray:
    """Sums (n_nodes, d) of the facets' values (nf, k, d) at their nodes (nf, k)."""
    d, flat = values.shape[2], values.reshape(-1, values.shape[2])
    return np.stack([np.bincount(facets.ravel(), flat[:, i], n_nodes) for i in range(d)], axis=1)
