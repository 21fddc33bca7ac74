"""Normals interpolated between the vertices of curved surfaces, compiled: one contact of a vertex and a facet a row."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection._vector_kernels import dot

_LEVEL = 1e-12  # of 1: facets whose normals differ by less lie in one plane, and their normal stays what it is


@njit(cache=True)
def _corner(v: int, g: int, point: FloatArray, normals: FloatArray, facets: IntArray, sides: IntArray) -> tuple[float, FloatArray]:
    """The angle [rad] of the facet g at its corner v, 1 of a segment, and its normal there: that of the bilinear quadrilateral where it is
    twisted, whose mean is off that of the surface at its corners, and so at the surface's rim, by O(h)."""
    if sides[g] == 2:
        return 1.0, normals[g]
    at = 0
    while facets[g, at] != v:
        at += 1
    ahead = point[facets[g, at + 1 if at + 1 < sides[g] else 0]] - point[v]
    back = point[facets[g, at - 1 if at > 0 else sides[g] - 1]] - point[v]
    sine = np.cross(ahead, back)
    size = np.sqrt(dot(sine, sine))
    angle = np.arctan2(size, dot(ahead, back))
    if sides[g] < 4 or dot(sine, normals[g]) >= (1.0 - _LEVEL) * size:
        return angle, normals[g]
    return angle, sine / size


@njit(cache=True, error_model="numpy")
def interpolated_normals(
    facet: IntArray,
    weights: FloatArray,
    curved: BoolArray,
    point: FloatArray,
    normals: FloatArray,
    facets: IntArray,
    sides: IntArray,
    patch: IntArray,
    star: IntArray,
    first_star: IntArray,
) -> tuple[BoolArray, FloatArray]:
    """Which rows (n,) have another normal than their facet's, and unit normals (n, 3): sum_k weights_k n_k / |.| with n_k the mean of the
    normals, by their angles, of the facets of the same patch around the facet's corner k. curved (nf,): facets that have them."""
    n = len(facet)
    changed, result = np.zeros(n, dtype=np.bool_), np.zeros((n, 3))
    for row in range(n):
        f = facet[row]
        if not curved[f]:
            continue
        total = np.zeros(3)
        for k in range(sides[f]):
            w = weights[row, k]
            if w == 0.0:
                continue
            v = facets[f, k]
            mean = np.zeros(3)
            for s in range(first_star[v], first_star[v + 1]):
                g = star[s]
                if patch[g] == patch[f]:
                    angle, normal = _corner(v, g, point, normals, facets, sides)
                    for i in range(3):
                        mean[i] += angle * normal[i]
            length = np.sqrt(dot(mean, mean))
            for i in range(3):
                mean[i] /= length
                total[i] += w * mean[i]
            changed[row] = changed[row] or dot(mean, normals[f]) < 1.0 - _LEVEL
        length = np.sqrt(dot(total, total))
        for i in range(3):
            result[row, i] = total[i] / length
    return changed, result
