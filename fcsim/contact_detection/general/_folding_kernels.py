"""What of one body may touch itself, compiled: a facet that sees another, a vertex and a facet or two edges with void between them."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection._vector_kernels import dot
from fcsim.contact_detection.skin._rim_kernels import FACING

_SEES = -0.5  # facets see each other where -n . n is more: at more than 60 degrees, FACING and what strain may turn them
_LEVEL = 1e-6  # of a facet: a corner less high above another's plane lies in it


@njit(cache=True)
def _above(f: int, g: int, point: FloatArray, normal: FloatArray, centre: FloatArray, size: FloatArray, facets: IntArray, k: int) -> bool:
    """Whether one of the k corners of g lies above the plane of f, or all of them in it while the two oppose each other."""
    highest, lowest, arm = -np.inf, np.inf, np.empty(3)
    for c in range(k):
        for i in range(3):
            arm[i] = point[facets[g, c], i] - centre[f, i]
        height = dot(arm, normal[f])
        highest, lowest = max(highest, height), min(lowest, height)
    level = _LEVEL * (size[f] + size[g])
    return highest > level or (lowest > -level and -dot(normal[f], normal[g]) > -_SEES)


@njit(cache=True)
def sees_itself(
    first: int, last: int, point: FloatArray, normal: FloatArray, centre: FloatArray, size: FloatArray, facets: IntArray, sides: IntArray
) -> bool:
    """Whether two of the facets first ... last - 1 lie before each other and look at each other; ends with the first two found. Facets in
    one plane do where they oppose each other squarely: the sides of a crack."""
    surface = (point, normal, centre, size, facets)
    for f in range(first, last):
        for g in range(f + 1, last):
            if -dot(normal[f], normal[g]) > _SEES and _above(f, g, *surface, sides[g]) and _above(g, f, *surface, sides[f]):
                return True
    return False


@njit(cache=True)
def across_void(
    vertex: IntArray,
    facet: IntArray,
    weights: FloatArray,
    reach: FloatArray,
    near: FloatArray,
    normal: FloatArray,
    mean: FloatArray,
    point: FloatArray,
    before: FloatArray,
    facets: IntArray,
    star: IntArray,
    first_star: IntArray,
) -> BoolArray:
    """Rows (n,) of a vertex and a facet that its surroundings face (normal (nf, 3), mean (nv, 3) as they stand) and that were farther apart
    than reach (n,) [m] in the reference configuration (point (nv, 3), normals before (nf, 3)), or lay before each other there."""
    result, way = np.zeros(len(vertex), dtype=np.bool_), np.empty(3)
    for row in range(len(vertex)):
        v, f = vertex[row], facet[row]
        facing = -dot(mean[v], normal[f]) > FACING
        for i in range(3):
            way[i] = -point[v, i]
        for k in range(4):
            for i in range(3):
                way[i] += weights[row, k] * point[facets[f, k], i]
        apart = dot(way, way) > reach[row] ** 2
        before_it = -dot(way, before[f]) > -near[row]
        for s in range(first_star[v], first_star[v + 1]):
            g = star[s]
            if -dot(normal[g], normal[f]) > FACING:
                facing = True
                apart = apart or (before_it and dot(way, before[g]) > -near[row] and -dot(before[g], before[f]) > FACING)
        result[row] = facing and apart
    return result


@njit(cache=True)
def edges_across_void(
    pair: IntArray,
    place: FloatArray,
    reach: FloatArray,
    near: FloatArray,
    point: FloatArray,
    before: FloatArray,
    edges: IntArray,
    edge_facets: IntArray,
) -> BoolArray:
    """The same of two convex edges, pair (n, 2), at places (n, 2): the way from one to the other leaves both outwards, by their facets'
    mean normals."""
    result = np.zeros(len(pair), dtype=np.bool_)
    for row in range(len(pair)):
        a, b = pair[row]
        s, t = place[row]
        way = (1 - t) * point[edges[b, 0]] + t * point[edges[b, 1]] - (1 - s) * point[edges[a, 0]] - s * point[edges[a, 1]]
        out = dot(way, before[edge_facets[a, 0]] + before[edge_facets[a, 1]])
        back = dot(way, before[edge_facets[b, 0]] + before[edge_facets[b, 1]])
        result[row] = (out > near[row] and -back > near[row]) or dot(way, way) > reach[row] ** 2
    return result
