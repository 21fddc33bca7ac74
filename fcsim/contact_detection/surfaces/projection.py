"""Closest points on facets, one (point, facet) pair a row: bilinear quadrilaterals, triangles, 2D segments, and their edges."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcsim.arrays import BoolArray, FloatArray
from fcsim.contact_detection.surfaces._projection_kernels import EDGE, closest_on_quadrilaterals


class Projection(NamedTuple):
    """Feet of n points on n facets: weights (n, k), the facet's shape functions at the foot (>= 0, sum 1); unit normal (n, d) of
    the facet there; inside (n,): the foot lies inside the facet, not on its edges. Feet outside were moved onto an edge (not always
    the nearest point of it: closest_on_boundary finds that)."""

    weights: FloatArray
    normal: FloatArray
    inside: BoolArray


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.einsum("nd,nd->n", a, b)


def _unit(a: FloatArray) -> FloatArray:
    return a / np.sqrt(_dot(a, a))[:, None]


def project_on_quadrilaterals(points: FloatArray, corners: FloatArray) -> Projection:
    """Closest points of x(xi, eta) = a + b xi + c eta + e xi eta, -1 <= xi, eta <= 1, to points (n, 3) on facets of corners (n, 4, 3).

    Newton's method on 1/2 |x - p|^2 in (xi, eta), from the centre; for a parallelogram (e = 0) the first step is exact.
    """
    weights, normal, inside = closest_on_quadrilaterals(np.ascontiguousarray(points), np.ascontiguousarray(corners))
    return Projection(weights, normal, inside)


def project_on_triangles(points: FloatArray, corners: FloatArray) -> Projection:
    """Closest points of plane triangles, corners (n, 3, 3), to points (n, 3)."""
    b, c, p = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    bb, cc, bc, pb, pc = _dot(b, b), _dot(c, c), _dot(b, c), _dot(p, b), _dot(p, c)
    det = bb * cc - bc**2
    s, t = (cc * pb - bc * pc) / det, (bb * pc - bc * pb) / det
    weights = np.stack([1 - s - t, s, t], axis=1)
    inside = weights.min(axis=1, initial=1.0) > EDGE
    weights = np.maximum(weights, 0.0)
    return Projection(weights / weights.sum(axis=1)[:, None], _unit(np.cross(b, c)), inside)


def project_on_segments(points: FloatArray, corners: FloatArray) -> Projection:
    """Closest points of 2D segments, corners (n, 2, 2), to points (n, 2)."""
    tangent = corners[:, 1] - corners[:, 0]
    t = _dot(points - corners[:, 0], tangent) / _dot(tangent, tangent)
    inside = np.abs(t - 0.5) < 0.5 - EDGE
    t = np.clip(t, 0.0, 1.0)
    return Projection(np.stack([1 - t, t], axis=1), _unit(np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)), inside)


def project_on_facets(points: FloatArray, corners: FloatArray, triangle: BoolArray) -> Projection:
    """The projection for the kind of each facet; among corners (n, 4, 3) a triangle has its first corner again in the last place."""
    width = corners.shape[1]
    if width == 2:
        return project_on_segments(points, corners)
    if width == 3:
        return project_on_triangles(points, corners)
    if not triangle.any():
        return project_on_quadrilaterals(points, corners)
    feet = Projection(np.zeros((len(points), 4)), np.empty((len(points), 3)), np.empty(len(points), dtype=bool))
    for those, found in (
        (triangle, project_on_triangles(points[triangle], corners[triangle, :3])),
        (~triangle, project_on_quadrilaterals(points[~triangle], corners[~triangle])),
    ):
        feet.weights[those, : found.weights.shape[1]] = found.weights
        feet.normal[those], feet.inside[those] = found.normal, found.inside
    return feet


class BoundaryFoot(NamedTuple):
    """Nearest points of facets' edges to n points: weights (n, k); interior (n,): it lies on an edge or vertex inside the surface;
    away (n, d) [m]: from it to the point, without the part along the edge where the edge ends at the outer boundary."""

    weights: FloatArray
    interior: BoolArray
    away: FloatArray


def closest_on_boundary(
    points: FloatArray, corners: FloatArray, interior_edge: BoolArray, interior_vertex: BoolArray, tolerance: FloatArray
) -> BoundaryFoot:
    """Closest points of the facets' edges (2D: end points) to points that do not project inside them.

    interior_edge, interior_vertex (n, k) as in Topology. A point beyond the end of an edge by less than tolerance (n,) [m] counts as
    beside that edge.
    """
    n, k = corners.shape[:2]
    row = np.arange(n)
    arm = points[:, None] - corners
    if k == 2:
        end = np.argmin(np.einsum("nkd,nkd->nk", arm, arm), axis=1)
        return BoundaryFoot(np.eye(2)[end], interior_vertex[row, end], arm[row, end])
    edge = np.roll(corners, -1, axis=1) - corners
    square = np.einsum("nkd,nkd->nk", edge, edge)
    real = square > 0.0  # a padded triangle closes with an edge of no length
    t = np.einsum("nkd,nkd->nk", arm, edge) / np.where(real, square, 1.0)
    clipped = np.clip(t, 0.0, 1.0)
    off = arm - clipped[:, :, None] * edge
    distance = np.where(real, np.einsum("nkd,nkd->nk", off, off), np.inf)
    vertex = np.where(t > 0.5, np.roll(interior_vertex, -1, axis=1), interior_vertex)
    beyond = (t - clipped) ** 2 * square
    interior = np.where(beyond == 0.0, interior_edge, vertex | (interior_edge & (beyond <= tolerance[:, None] ** 2)))
    # a vertex is the nearest point of two edges, of which one may lie inside the surface
    tied = distance <= distance.min(axis=1, initial=np.inf)[:, None] + 1e-12 * square
    best = np.argmax(np.where(real, 2 * tied + (tied & interior), 0), axis=1)
    weights = np.zeros((n, k))
    weights[row, best], weights[row, (best + 1) % k] = 1.0 - clipped[row, best], clipped[row, best]
    along = np.where(vertex, clipped, t)[row, best]
    return BoundaryFoot(weights, interior[row, best], arm[row, best] - along[:, None] * edge[row, best])
