"""Which sharp edges may have gone past each other, compiled: a sieve, so that few pairs of edges are left to `wedges`."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection._vector_kernels import Vector, at, cross, dot, length, minus, plus, times, unit

_BY = 1e-9  # of an edge's length: what round-off may change of places, and more
_SURE = 1e-12  # the same of products of unit vectors


@njit(cache=True)
def _between(N: Vector, a: Vector, b: Vector, by: float) -> bool:
    """Whether N lies between the unit vectors a and b, or outside by no more than `by`, see `wedges`."""
    cosine, toward_a, toward_b = dot(a, b), dot(N, a), dot(N, b)
    return toward_a - cosine * toward_b >= -by and toward_b - cosine * toward_a >= -by


@njit(cache=True, error_model="numpy")
def may_pass(
    rows: IntArray,
    near: FloatArray,
    touch: FloatArray,
    along: float,
    outside: float,
    point: FloatArray,
    normal: FloatArray,
    edges: IntArray,
    edge_facets: IntArray,
) -> BoolArray:
    """Which rows (n, 3) of two edges and a pair of bodies may be corners that overlap by more than `touch` (np,) [m]: edges that run along
    each other (sine up to `along`) over more than `near` (np,) [m], and no direction between the faces of both, by no more than `outside`,
    parts them. None that `wedges` would take is left out: what is within round-off of a limit stays.
    """
    may = np.zeros(len(rows), dtype=np.bool_)
    for row in range(len(rows)):
        e, g, pair = rows[row]
        p, q = at(point, edges[e, 0]), at(point, edges[g, 0])
        first, second = minus(at(point, edges[e, 1]), p), minus(at(point, edges[g, 1]), q)
        long = length(first)
        first, second = unit(first), unit(second)
        if length(cross(first, second)) > along + _SURE:
            continue
        start, end = dot(minus(q, p), first), dot(minus(at(point, edges[g, 1]), p), first)
        low, high = max(min(start, end), 0.0), min(max(start, end), long)
        if high - low < near[pair] - _BY * long:
            continue
        on_first = plus(p, times(0.5 * (low + high), first))
        on_second = plus(q, times(dot(minus(on_first, q), second), second))
        way = minus(on_first, on_second)
        a, b = at(normal, edge_facets[e, 0]), at(normal, edge_facets[e, 1])
        c, d = at(normal, edge_facets[g, 0]), at(normal, edge_facets[g, 1])
        some, parted = False, False
        for N in (c, d, times(-1.0, a), times(-1.0, b)):
            back = times(-1.0, N)
            if _between(N, c, d, outside + _SURE) and _between(back, a, b, outside + _SURE):
                some = True
                sure = _between(N, c, d, outside - _SURE) and _between(back, a, b, outside - _SURE)
                parted = parted or (sure and dot(N, way) > -touch[pair] + _BY * long)
        may[row] = some and not parted
    return may
