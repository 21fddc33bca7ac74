"""How deep two convex bodies overlap, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import FloatArray, IntArray
from fcsim.contact_detection._vector_kernels import at, dot, minus


@njit(cache=True)
def _lowest(facets: IntArray, vertices: IntArray, normal: FloatArray, centre: FloatArray, point: FloatArray) -> tuple[float, float]:
    """Over facets, numbers from facets[0] to facets[1] - 1, the highest of their lowest vertices, of those from vertices[0] on; and the
    highest vertex of all."""
    best, top = -np.inf, -np.inf
    for f in range(facets[0], facets[1]):
        n, c = at(normal, f), at(centre, f)
        low = np.inf
        for v in range(vertices[0], vertices[1]):
            height = dot(minus(at(point, v), c), n)
            low, top = min(low, height), max(top, height)
        best = max(best, low)
    return best, top


@njit(cache=True)
def shallowest_overlaps(
    bodies: IntArray,
    near: FloatArray,
    first_facet: IntArray,
    first_vertex: IntArray,
    normal: FloatArray,
    centre: FloatArray,
    point: FloatArray,
    most: int,
) -> FloatArray:
    """Of pairs of bodies (np, 2) the least way [m] along a facet's normal that parts them; infinite where one is not convex to within
    `near` (np,) [m], or where both have more than `most` pairs of a facet and a vertex."""
    result = np.full(len(bodies), np.inf)
    for row in range(len(bodies)):
        a, b = bodies[row]
        facets_a, facets_b = first_facet[a : a + 2], first_facet[b : b + 2]
        vertices_a, vertices_b = first_vertex[a : a + 2], first_vertex[b : b + 2]
        if (facets_a[1] - facets_a[0] + facets_b[1] - facets_b[0]) * (vertices_a[1] - vertices_a[0] + vertices_b[1] - vertices_b[0]) > most:
            continue
        if _lowest(facets_a, vertices_a, normal, centre, point)[1] > near[row]:
            continue
        if _lowest(facets_b, vertices_b, normal, centre, point)[1] > near[row]:
            continue
        over_a, over_b = _lowest(facets_a, vertices_b, normal, centre, point)[0], _lowest(facets_b, vertices_a, normal, centre, point)[0]
        result[row] = max(0.0, -max(over_a, over_b))
    return result
