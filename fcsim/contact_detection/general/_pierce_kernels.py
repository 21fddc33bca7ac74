"""What goes through what, compiled: edges through facets, and points inside closed surfaces."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection._vector_kernels import Vector, at, cross, dot, length, minus, plus, times


@njit(cache=True)
def pierced(p: Vector, q: Vector, f: int, near: float, point: FloatArray, normals: FloatArray, facets: IntArray, sides: IntArray) -> bool:
    """Whether the segment from p to q goes through the facet f."""
    n, origin = at(normals, f), at(point, facets[f, 0])
    high, low = dot(minus(p, origin), n), dot(minus(q, origin), n)
    if not (min(high, low) < 0.0 < max(high, low)):
        return False
    there = plus(p, times(high / (high - low), minus(q, p)))
    if sides[f] == 2:
        along = minus(at(point, facets[f, 1]), origin)
        place, whole = dot(minus(there, origin), along), dot(along, along)
        margin = near * np.sqrt(whole)
        return -margin <= place <= whole + margin
    inside = True
    for l in range(sides[f]):
        a = at(point, facets[f, l])
        along = minus(at(point, facets[f, l + 1 if l + 1 < sides[f] else 0]), a)
        inside = inside and dot(cross(n, along), minus(there, a)) >= -near * np.sqrt(dot(along, along))
    return inside


@njit(cache=True)
def piercing(
    edge: IntArray,
    facet: IntArray,
    near: FloatArray,
    point: FloatArray,
    normals: FloatArray,
    edges: IntArray,
    facets: IntArray,
    sides: IntArray,
) -> tuple[BoolArray, IntArray]:
    """Whether edges go through facets by more than `near` (rows,) [m], well inside them, and which end (rows,) is less deep behind."""
    through, end = np.zeros(len(edge), dtype=np.bool_), np.zeros(len(edge), dtype=np.int64)
    for row in range(len(edge)):
        f, p, q = facet[row], at(point, edges[edge[row], 0]), at(point, edges[edge[row], 1])
        n, origin = at(normals, f), at(point, facets[f, 0])
        high, low = dot(minus(p, origin), n), dot(minus(q, origin), n)
        end[row] = 0 if high < low else 1
        if min(high, low) < -near[row] and max(high, low) > near[row]:
            through[row] = pierced(p, q, f, -near[row], point, normals, facets, sides)
    return through, end


@njit(cache=True)
def _lies_on(p: Vector, a: Vector, b: Vector, c: Vector, near: float) -> bool:
    """Whether a point lies within `near` of a triangle's plane, above the triangle."""
    n = cross(minus(b, a), minus(c, a))
    size = length(n)
    if not abs(dot(minus(p, a), n)) <= near * size:
        return False
    above = True
    for start, end in ((a, b), (b, c), (c, a)):
        along = minus(end, start)
        above = above and dot(cross(n, along), minus(p, start)) >= -near * size * length(along)
    return above


@njit(cache=True)
def inside(
    places: FloatArray,
    body: IntArray,
    times_inside: IntArray,
    near: FloatArray,
    first_facet: IntArray,
    point: FloatArray,
    facets: IntArray,
    sides: IntArray,
) -> BoolArray:
    """Whether points (n, 3) lie inside bodies (n,), off their surface by `near` (n,) [m]: the solid angle under which they see the closed
    surface is 4 pi there, 0 outside, and 4 pi `times_inside` (n,) where so many parts of one body overlap.

    Source: A. Van Oosterom, J. Strackee, The solid angle of a plane triangle, IEEE Trans. Biomed. Eng. 30, 1983.
    """
    result = np.empty(len(places), dtype=np.bool_)
    for row in range(len(places)):
        p, angle, touches = at(places, row), 0.0, False
        for f in range(first_facet[body[row]], first_facet[body[row] + 1]):
            x0 = at(point, facets[f, 0])
            for k in range(1, sides[f] - 1):
                x1, x2 = at(point, facets[f, k]), at(point, facets[f, k + 1])
                touches = touches or _lies_on(p, x0, x1, x2, near[row])
                a, b, c = minus(x0, p), minus(x1, p), minus(x2, p)
                la, lb, lc = length(a), length(b), length(c)
                angle += 2.0 * np.arctan2(dot(a, cross(b, c)), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb)
        result[row] = angle > (4.0 * times_inside[row] - 2.0) * np.pi and not touches
    return result


@njit(cache=True)
def inside_polygon(places: FloatArray, body: IntArray, first_facet: IntArray, point: FloatArray, facets: IntArray) -> BoolArray:
    """Whether points (n, 3) of the plane lie inside bodies (n,): their sides turn once around them."""
    result = np.empty(len(places), dtype=np.bool_)
    for row in range(len(places)):
        angle = 0.0
        for f in range(first_facet[body[row]], first_facet[body[row] + 1]):
            a0, a1 = point[facets[f, 0], 0] - places[row, 0], point[facets[f, 0], 1] - places[row, 1]
            b0, b1 = point[facets[f, 1], 0] - places[row, 0], point[facets[f, 1], 1] - places[row, 1]
            angle += np.arctan2(a0 * b1 - a1 * b0, a0 * b0 + a1 * b1)
        result[row] = abs(angle) > np.pi
    return result
