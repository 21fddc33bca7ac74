"""Surfaces that cross themselves: pairs of triangles, of which an edge of one goes through the inside of the other."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray

_CLEAR = 1e-9
"""Of a triangle's size: crossings nearer to rims and ends are touches, as neighbours do."""
_PAIRS = 2_000_000
"""Pairs of boxes that are looked at in one go."""


def crossing_triangles(points: FloatArray, triangles: IntArray) -> IntArray:
    """Return pairs (k, 2) of triangles that cross: an edge of the one pierces the other in its inside.

    Triangles that share a corner are neighbours and left out where the edge begins there. Boxes are swept along x, so that pairs are few.
    """
    corners = points[triangles]
    low, high = corners.min(axis=1), corners.max(axis=1)
    order = np.argsort(low[:, 0], kind="stable")
    starts = low[order, 0]
    until = np.searchsorted(starts, high[order, 0], side="right")
    count = until - np.arange(len(order)) - 1
    found = []
    begin = 0
    while begin < len(order):
        end = begin + max(1, int(np.searchsorted(np.cumsum(count[begin:]), _PAIRS)))
        rows = np.repeat(np.arange(begin, min(end, len(order))), count[begin:end])
        offset = np.arange(len(rows)) - np.repeat(np.cumsum(count[begin:end]) - count[begin:end], count[begin:end])
        a, b = order[rows], order[rows + 1 + offset]
        near = ((low[a] <= high[b]) & (low[b] <= high[a])).all(axis=1)
        a, b = a[near], b[near]
        pierced = _pierces(points, triangles, a, b) | _pierces(points, triangles, b, a)
        found.append(np.stack([a[pierced], b[pierced]], axis=1))
        begin = end
    return np.concatenate(found) if found else np.empty((0, 2), dtype=np.int64)


def _pierces(points: FloatArray, triangles: IntArray, a: IntArray, b: IntArray) -> np.ndarray:
    """Whether an edge of triangle a goes through the inside of triangle b (arrays of pairs)."""
    hit = np.zeros(len(a), dtype=bool)
    if not len(a):
        return hit
    p = points[triangles[b]]
    u, v = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    normal = np.cross(u, v)
    area = np.linalg.norm(normal, axis=1)
    size = np.sqrt(np.maximum(np.einsum("kd,kd->k", u, u), np.einsum("kd,kd->k", v, v)))
    normal = normal / np.maximum(area, 1e-300)[:, None]
    for one, other in ((0, 1), (1, 2), (2, 0)):
        s, t = points[triangles[a, one]], points[triangles[a, other]]
        hs, ht = np.einsum("kd,kd->k", s - p[:, 0], normal), np.einsum("kd,kd->k", t - p[:, 0], normal)
        clear = _CLEAR * size
        across = ((hs > clear) & (ht < -clear)) | ((hs < -clear) & (ht > clear))
        along = np.where(across, hs / np.where(across, hs - ht, 1.0), 0.0)
        x = s + along[:, None] * (t - s) - p[:, 0]
        beta = np.einsum("kd,kd->k", np.cross(x, v), normal) / np.maximum(area, 1e-300)
        gamma = np.einsum("kd,kd->k", np.cross(u, x), normal) / np.maximum(area, 1e-300)
        hit |= across & (beta > _CLEAR) & (gamma > _CLEAR) & (beta + gamma < 1 - _CLEAR)
    return hit
