"""Normals, boxes and angles of facets at given positions, compiled: a detection asks for them some five times a step."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import FloatArray, IntArray
from fcsim.contact_detection._vector_kernels import Vector, at, cross, minus


@njit(cache=True)
def _scalar(a: Vector, b: Vector) -> float:
    """a . b, the terms added in the order in which NumPy adds three: results keep the last bits that they had from it."""
    return (a[0] * b[0] + a[2] * b[2]) + a[1] * b[1]


@njit(cache=True)
def facet_geometry(points: FloatArray, facets: IntArray, sides: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Unit normal, centre (nf, 3) and size (nf,) of facets (nf, 4) with corners among the points (n, 3), as `Skin.facets` lists them; size:
    the square root of the area, in 2D the length."""
    n = len(facets)
    normal, centre, size = np.empty((n, 3)), np.empty((n, 3)), np.empty(n)
    for f in range(n):
        a, b = at(points, facets[f, 0]), at(points, facets[f, 1])
        c, d = at(points, facets[f, 2]), at(points, facets[f, 3])
        if sides[f] == 2:
            along = minus(b, a)
            area = (along[1], -along[0], 0.0)
        else:
            twice = cross(minus(c, a), minus(d, b))
            area = (0.5 * twice[0], 0.5 * twice[1], 0.5 * twice[2])
        measure = np.sqrt(_scalar(area, area))
        size[f] = measure if sides[f] == 2 else np.sqrt(measure)
        most = max(measure, 1e-300)
        for i in range(3):
            normal[f, i] = area[i] / most
            three = (a[i] + b[i]) + c[i]
            centre[f, i] = three / 3.0 if sides[f] == 3 else (three + d[i]) / 4.0
    return normal, centre, size


@njit(cache=True)
def boxes(points: FloatArray, items: IntArray) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest coordinates (n, 3) of the points of each item (n, k)."""
    low, high = np.empty((len(items), 3)), np.empty((len(items), 3))
    for k in range(len(items)):
        for i in range(3):
            least = most = points[items[k, 0], i]
            for c in range(1, items.shape[1]):
                least, most = min(least, points[items[k, c], i]), max(most, points[items[k, c], i])
            low[k, i], high[k, i] = least, most
    return low, high


@njit(cache=True)
def sines_and_cosines(points: FloatArray, facets: IntArray, sides: IntArray) -> tuple[FloatArray, FloatArray]:
    """Of the facets' angles at their corners (nf, 4), times the product of the sides' lengths; 0, 1 where there is no corner."""
    sine, cosine = np.zeros(facets.shape), np.ones(facets.shape)
    for f in range(len(facets)):
        for l in range(sides[f]):
            here = at(points, facets[f, l])
            ahead = minus(at(points, facets[f, l + 1 if l + 1 < sides[f] else 0]), here)
            back = minus(at(points, facets[f, l - 1 if l > 0 else sides[f] - 1]), here)
            normal = cross(ahead, back)
            sine[f, l], cosine[f, l] = np.sqrt(_scalar(normal, normal)), _scalar(ahead, back)
    return sine, cosine


@njit(cache=True)
def mean_normals(count: int, facets: IntArray, sides: IntArray, weight: FloatArray, normal: FloatArray) -> FloatArray:
    """Unit means (count, 3) of the normals of the facets around each vertex, with weights (nf, 4)."""
    mean, share = np.zeros((count, 3)), np.empty((count, 3))
    for l in range(4):
        share[:] = 0.0
        for f in range(len(facets)):
            if l < sides[f]:
                for i in range(3):
                    share[facets[f, l], i] += weight[f, l] * normal[f, i]
        mean += share
    for v in range(count):
        length = max(np.sqrt(_scalar(at(mean, v), at(mean, v))), 1e-300)
        for i in range(3):
            mean[v, i] /= length
    return mean
