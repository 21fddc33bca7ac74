"""The nearest point of a facet, compiled: 2D segments, triangles and bilinear quadrilaterals, one (point, facet) pair a row."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import FloatArray, IntArray
from fcsim.contact_detection._vector_kernels import Vector, at, cross, dot, length, minus, plus, times, unit

INSIDE, EDGE, VERTEX = 0, 1, 5  # where a foot lies: inside, on side l (EDGE + l), on corner l (VERTEX + l)
_ROUND = 1e-12  # parameters nearer to an end than this are there
_MAX_NEWTON = 20


@njit(cache=True)
def _solve_2x2(m00: float, m01: float, m11: float, r0: float, r1: float) -> tuple[float, float]:
    det = m00 * m11 - m01 * m01
    if det <= 0.0:
        return 0.0, 0.0
    return (m11 * r0 - m01 * r1) / det, (m00 * r1 - m01 * r0) / det


@njit(cache=True)
def _in_triangle(p: Vector, x0: Vector, x1: Vector, x2: Vector) -> tuple[float, float]:
    """The parameters s, t of the foot x0 + s (x1 - x0) + t (x2 - x0) in the triangle's plane."""
    b, c, q = minus(x1, x0), minus(x2, x0), minus(p, x0)
    return _solve_2x2(dot(b, b), dot(b, c), dot(c, c), dot(q, b), dot(q, c))


@njit(cache=True)
def _in_quadrilateral(p: Vector, x0: Vector, x1: Vector, x2: Vector, x3: Vector) -> tuple[bool, float, float, bool, Vector]:
    """Whether the foot lies inside, its xi, eta, whether the facet is warped and, if so, its normal there.

    Newton's method on |x(xi, eta) - p|^2 from the centre; exact in one step on a parallelogram.
    """
    a = times(0.25, plus(plus(x0, x1), plus(x2, x3)))
    b = times(0.25, minus(plus(x1, x2), plus(x0, x3)))
    c = times(0.25, minus(plus(x2, x3), plus(x0, x1)))
    e = times(0.25, minus(plus(x0, x2), plus(x1, x3)))
    warped = dot(e, e) > 1e-24 * (dot(b, b) + dot(c, c))
    xi, eta, converged = 0.0, 0.0, False
    arm = minus(p, a)
    for _ in range(_MAX_NEWTON):
        u, v = plus(b, times(eta, e)), plus(c, times(xi, e))
        r = minus(arm, plus(times(xi, b), times(eta, v)))  # p - a - xi b - eta c - xi eta e
        d_xi, d_eta = _solve_2x2(dot(u, u), dot(u, v), dot(v, v), dot(r, u), dot(r, v))
        xi, eta = min(max(xi + d_xi, -3.0), 3.0), min(max(eta + d_eta, -3.0), 3.0)
        if not warped or abs(d_xi) + abs(d_eta) < 1e-12:
            converged = True
            break
    inside = converged and abs(xi) <= 1.0 and abs(eta) <= 1.0
    normal = a
    if inside and warped:
        normal = unit(cross(plus(b, times(eta, e)), plus(c, times(xi, e))))
    return inside, xi, eta, warped, normal


@njit(cache=True)
def normal_on_side(l: int, t: float, x0: Vector, x1: Vector, x2: Vector, x3: Vector) -> Vector:
    """Unit normal of the bilinear quadrilateral at the share t of its side l: that to which the normals inside run."""
    s = t if l == 0 else (1.0 if l == 1 else (1.0 - t if l == 2 else 0.0))
    q = 0.0 if l == 0 else (t if l == 1 else (1.0 if l == 2 else 1.0 - t))
    u = plus(times(1.0 - q, minus(x1, x0)), times(q, minus(x2, x3)))
    v = plus(times(1.0 - s, minus(x3, x0)), times(s, minus(x2, x1)))
    return unit(cross(u, v))


@njit(cache=True)
def _on_boundary(p: Vector, f: int, point: FloatArray, facets: IntArray, sides: int) -> tuple[int, int, float, int]:
    """The nearest point of the sides: from corner l to corner k by the share t of the side, and where that lies."""
    best, of, to, share, feature = np.inf, 0, 0, 0.0, EDGE
    for l in range(sides):
        k = l + 1 if l + 1 < sides else 0
        start = at(point, facets[f, l])
        along, arm = minus(at(point, facets[f, k]), start), minus(p, start)
        t = min(max(dot(arm, along) / dot(along, along), 0.0), 1.0)
        off = minus(arm, times(t, along))
        distance = dot(off, off)
        if distance < best:
            best, of, to, share = distance, l, k, t
            feature = VERTEX + l if t <= _ROUND else (VERTEX + k if t >= 1.0 - _ROUND else EDGE + l)
    return of, to, share, feature


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
        p, k, N = at(point, vertex[row]), sides[f], at(normals, f)
        x0, x1 = at(point, facets[f, 0]), at(point, facets[f, 1])
        foot, inside, warped = x0, False, False
        if k == 2:
            along = minus(x1, x0)
            t = dot(minus(p, x0), along) / dot(along, along)
            place = min(max(t, 0.0), 1.0)
            weights[row, 0], weights[row, 1] = 1.0 - place, place
            feature[row] = INSIDE if 0.0 <= t <= 1.0 else (VERTEX if t < 0.0 else VERTEX + 1)
            foot, inside = plus(x0, times(place, along)), True
        elif k == 3:
            x2 = at(point, facets[f, 2])
            s, t = _in_triangle(p, x0, x1, x2)
            inside = min(s, t, 1.0 - s - t) >= 0.0
            if inside:
                weights[row, 0], weights[row, 1], weights[row, 2] = 1.0 - s - t, s, t
                foot = plus(x0, plus(times(s, minus(x1, x0)), times(t, minus(x2, x0))))
                feature[row] = INSIDE
        else:
            x2, x3 = at(point, facets[f, 2]), at(point, facets[f, 3])
            inside, xi, eta, warped, there = _in_quadrilateral(p, x0, x1, x2, x3)
            if inside:
                w0, w1 = 0.25 * (1 - xi) * (1 - eta), 0.25 * (1 + xi) * (1 - eta)
                w2, w3 = 0.25 * (1 + xi) * (1 + eta), 0.25 * (1 - xi) * (1 + eta)
                weights[row, 0], weights[row, 1], weights[row, 2], weights[row, 3] = w0, w1, w2, w3
                foot = plus(plus(times(w0, x0), times(w1, x1)), plus(times(w2, x2), times(w3, x3)))
                feature[row] = INSIDE
                N = there if warped else N
        if not inside:
            l, to, t, feature[row] = _on_boundary(p, f, point, facets, k)
            if warped:  # the normal goes on to the rim: with the facet's mean it would jump there, by as much as the facet is twisted
                N = normal_on_side(l, t, x0, x1, at(point, facets[f, 2]), at(point, facets[f, 3]))
            weights[row, l], weights[row, to] = 1.0 - t, t
            foot = plus(times(1.0 - t, at(point, facets[f, l])), times(t, at(point, facets[f, to])))
        arm = minus(p, foot)
        normal[row, 0], normal[row, 1], normal[row, 2] = N
        height[row], distance[row] = dot(arm, N), length(arm)
    return weights, normal, height, distance, feature
