"""Polygons with corners on their edges, cut into triangles that all have an area and use every corner."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray

STRAIGHT = 1e-9
"""A corner is straight where its two edges span less than this share of the polygon's size squared."""


def with_corners_on_edges(p: FloatArray, normal: FloatArray) -> IntArray | None:
    """Return the triangles (n - 2, 3) of a plane polygon p (n, 3), counter-clockwise about `normal`, convex or not; None where it crosses
    or touches itself.

    Ears are cut off (G. H. Meisters, Amer. Math. Monthly 82, 1975) that hold no other corner, not on their sides either: the opposite of
    an edge with corners on it is so never cut first, and no triangle is left flat. O(n^3) for the few corners of a stone's face.
    """
    least = STRAIGHT * float(np.abs(p).max()) ** 2
    left = list(range(len(p)))
    found = []
    while len(left) > 2:
        for k in range(len(left)):
            ear = [left[k - 1], left[k], left[(k + 1) % len(left)]]
            others = p[[i for i in left if i not in ear]]
            sides = [np.cross(p[b] - p[a], others - p[a]) @ normal for a, b in zip(ear, ear[1:] + ear[:1], strict=True)]
            if np.cross(p[ear[1]] - p[ear[0]], p[ear[2]] - p[ear[1]]) @ normal > least and not (np.min(sides, axis=0) >= -least).any():
                found.append(ear)
                del left[k]
                break
        else:
            return None
    return np.array(found)
