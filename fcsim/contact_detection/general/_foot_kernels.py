"""The nearest point of a facet, compiled: 2D segments, triangles and bilinear quadrilaterals, one (point, facet) pair a row."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import FloatArray, IntArray

INSIDE, EDGE, VERTEX = 0, 1, 5  # where a foot lies: inside, on side l (EDGE + l), on corner l (VERTEX + l)
_ROUND = 1e-12  # parameters nearer to an end than this are there
_MAX_NEWTON = 20


@njit(cache=True)
def dot(a: FloatArray, b: FloatArray) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def _solve_2x2(m00: float, m01: float, m11: float, r0: float, r1: float) -> tuple[float, float]:
    det = m00 * m11 - m01 * m01
    if det <= 0.0:
        return 0.0, 0.0
    return (m11 * r0 - m01 * r1) / det, (m00 * r1 - m01 * r0) / det


@njit(cache=True)
def _inside_triangle(p: FloatArray, x: FloatArray, weights: FloatArray) -> bool:
    b, c, q = x[1] - x[0], x[2] - x[0], p - x[0]
    s, t = _solve_2x2(dot(b, b), dot(b, c), dot(c, c), dot(q, b), dot(q, c))
    weights[0], weights[1], weights[2], weights[3] = 1.0 - s - t, s, t, 0.0
    return min(s, t, 1.0 - s - t) >= 0.0


@njit(cache=True)
def _inside_quadrilateral(p: FloatArray, x: FloatArray, weights: FloatArray, normal: FloatArray) -> bool:
    """Newton's method on |x(xi, eta) - p|^2 from the centre; exact in one step on a parallelogram."""
    a = 0.25 * (x[0] + x[1] + x[2] + x[3])
    b = 0.25 * (x[1] + x[2] - x[0] - x[3])
    c = 0.25 * (x[2] + x[3] - x[0] - x[1])
    e = 0.25 * (x[0] + x[2] - x[1] - x[3])
    plane = dot(e, e) <= 1e-24 * (dot(b, b) + dot(c, c))
    xi, eta, converged = 0.0, 0.0, False
    for _ in range(_MAX_NEWTON):
        u, v = b + eta * e, c + xi * e
        r = p - a - xi * b - eta * c - xi * eta * e
        d_xi, d_eta = _solve_2x2(dot(u, u), dot(u, v), dot(v, v), dot(r, u), dot(r, v))
        xi, eta = min(max(xi + d_xi, -3.0), 3.0), min(max(eta + d_eta, -3.0), 3.0)
        if plane or abs(d_xi) + abs(d_eta) < 1e-12:
            converged = True
            break
    if not (converged and abs(xi) <= 1.0 and abs(eta) <= 1.0):
        return False
    weights[0], weights[1] = 0.25 * (1 - xi) * (1 - eta), 0.25 * (1 + xi) * (1 - eta)
    weights[2], weights[3] = 0.25 * (1 + xi) * (1 + eta), 0.25 * (1 - xi) * (1 + eta)
    if not plane:
        n = np.cross(b + eta * e, c + xi * e)
        normal[:] = n / np.sqrt(dot(n, n))
    return True


@njit(cache=True)
def _on_boundary(p: FloatArray, x: FloatArray, sides: int, weights: FloatArray) -> int:
    """The nearest point of the sides; returns where it lies."""
    best, feature = np.inf, EDGE
    for l in range(sides):
        k = l + 1 if l + 1 < sides else 0
        along, arm = x[k] - x[l], p - x[l]
        t = min(max(dot(arm, along) / dot(along, along), 0.0), 1.0)
        off = arm - t * along
        distance = dot(off, off)
        if distance < best:
            best = distance
            weights[:] = 0.0
            weights[l], weights[k] = 1.0 - t, t
            feature = VERTEX + l if t <= _ROUND else (VERTEX + k if t >= 1.0 - _ROUND else EDGE + l)
    return feature


@njit(cache=True)
def feet(
    vertex: IntArray, facet: IntArray, point: FloatArray, facets: IntArray, sides: IntArray, normals: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, IntArray]:
    """Nearest points of facets to vertices, row by row.

    Returns their weights (n, 4) on the facet's corners, the facet's unit normal there (n, 3), the height of the vertex above its tangent
    plane and its distance (n,) [m], and where the foot lies (n,).
    """
    n = len(vertex)
    weights, normal = np.zeros((n, 4)), np.empty((n, 3))
    height, distance, feature = np.empty(n), np.empty(n), np.empty(n, dtype=np.int64)
    for row in range(n):
        f = facet[row]
        p, k = point[vertex[row]], sides[f]
        x = point[facets[f]]
        w = weights[row]
        normal[row] = normals[f]
        if k == 2:
            along = x[1] - x[0]
            t = dot(p - x[0], along) / dot(along, along)
            inside = 0.0 <= t <= 1.0
            w[1] = min(max(t, 0.0), 1.0)
            w[0] = 1.0 - w[1]
            feature[row] = INSIDE if inside else (VERTEX if t < 0.0 else VERTEX + 1)
        else:
            inside = _inside_triangle(p, x, w) if k == 3 else _inside_quadrilateral(p, x, w, normal[row])
            feature[row] = INSIDE if inside else _on_boundary(p, x, k, w)
        arm = p - w[0] * x[0] - w[1] * x[1] - w[2] * x[2] - w[3] * x[3]
        height[row] = dot(arm, normal[row])
        distance[row] = np.sqrt(dot(arm, arm))
    return weights, normal, height, distance, feature
