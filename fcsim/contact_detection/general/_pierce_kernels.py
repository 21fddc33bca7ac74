"""What goes through what, compiled: edges through facets, and points inside closed surfaces."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection._vector_kernels import dot


@njit(cache=True)
def pierced(
    p: FloatArray, q: FloatArray, f: int, near: float, point: FloatArray, normals: FloatArray, facets: IntArray, sides: IntArray
) -> bool:
    """Whether the segment from p to q goes through the facet f."""
    n, origin = normals[f], point[facets[f, 0]]
    high, low = dot(p - origin, n), dot(q - origin, n)
    if not (min(high, low) < 0.0 < max(high, low)):
        return False
    at = p + high / (high - low) * (q - p)
    if sides[f] == 2:
        start, along = point[facets[f, 0]], point[facets[f, 1]] - point[facets[f, 0]]
        place, whole = dot(at - start, along), dot(along, along)
        margin = near * np.sqrt(whole)
        return -margin <= place <= whole + margin
    inside = True
    for l in range(sides[f]):
        a = point[facets[f, l]]
        along = point[facets[f, l + 1 if l + 1 < sides[f] else 0]] - a
        inside = inside and dot(np.cross(n, along), at - a) >= -near * np.sqrt(dot(along, along))
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
        f, p, q = facet[row], point[edges[edge[row], 0]], point[edges[edge[row], 1]]
        high, low = dot(p - point[facets[f, 0]], normals[f]), dot(q - point[facets[f, 0]], normals[f])
        end[row] = 0 if high < low else 1
        if min(high, low) < -near[row] and max(high, low) > near[row]:
            through[row] = pierced(p, q, f, -near[row], point, normals, facets, sides)
    return through, end


@njit(cache=True)
def _lies_on(p: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray, near: float) -> bool:
    """Whether a point lies within `near` of a triangle's plane, above the triangle."""
    n = np.cross(b - a, c - a)
    size = np.sqrt(dot(n, n))
    if not abs(dot(p - a, n)) <= near * size:
        return False
    above = True
    for start, end in ((a, b), (b, c), (c, a)):
        along = end - start
        above = above and dot(np.cross(n, along), p - start) >= -near * size * np.sqrt(dot(along, along))
    return above


@njit(cache=True)
def inside(
    at: FloatArray,
    body: IntArray,
    times: IntArray,
    near: FloatArray,
    first_facet: IntArray,
    point: FloatArray,
    facets: IntArray,
    sides: IntArray,
) -> BoolArray:
    """Whether points (n, 3) lie inside bodies (n,), off their surface by `near` (n,) [m]: the solid angle under which they see the closed
    surface is 4 pi there, 0 outside, and 4 pi `times` (n,) where so many parts of one body overlap.

    Source: A. Van Oosterom, J. Strackee, The solid angle of a plane triangle, IEEE Trans. Biomed. Eng. 30, 1983.
    """
    result = np.empty(len(at), dtype=np.bool_)
    for row in range(len(at)):
        angle, touches = 0.0, False
        for f in range(first_facet[body[row]], first_facet[body[row] + 1]):
            for k in range(1, sides[f] - 1):
                corners = point[facets[f, 0]], point[facets[f, k]], point[facets[f, k + 1]]
                touches = touches or _lies_on(at[row], corners[0], corners[1], corners[2], near[row])
                a, b, c = corners[0] - at[row], corners[1] - at[row], corners[2] - at[row]
                la, lb, lc = np.sqrt(dot(a, a)), np.sqrt(dot(b, b)), np.sqrt(dot(c, c))
                angle += 2.0 * np.arctan2(dot(a, np.cross(b, c)), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb)
        result[row] = angle > (4.0 * times[row] - 2.0) * np.pi and not touches
    return result


@njit(cache=True)
def inside_polygon(at: FloatArray, body: IntArray, first_facet: IntArray, point: FloatArray, facets: IntArray) -> BoolArray:
    """Whether points (n, 3) of the plane lie inside bodies (n,): their sides turn once around them."""
    result = np.empty(len(at), dtype=np.bool_)
    for row in range(len(at)):
        angle = 0.0
        for f in range(first_facet[body[row]], first_facet[body[row] + 1]):
            a, b = point[facets[f, 0]] - at[row], point[facets[f, 1]] - at[row]
            angle += np.arctan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1])
        result[row] = abs(angle) > np.pi
    return result
