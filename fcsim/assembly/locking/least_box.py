"""The box that fits points most closely, however they are turned: what is straight has its own length and height in it."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from fcsim.arrays import FloatArray

MOST = 200
"""Directions that are tried for the smallest extent: sides of a hull are fewer, but for round bodies, of which any direction is as good."""


def least_box(points: FloatArray) -> FloatArray:
    """Axes (d, d), orthonormal rows, of a box around points (n, d) that do not lie in one plane (2D: on one line).

    The last axis is that of the smallest extent among the normals of the convex hull's facets: of prisms the smallest there is. In 3D the
    others are those of the rectangle of the least area around what is seen along it, which has a side on the hull's (H. Freeman,
    R. Shapira, Commun. ACM 18, 1975); the longer one is first.
    """
    hull = ConvexHull(points)
    corners = points[hull.vertices]
    normal = _smallest(corners, hull.equations[:, :-1])
    if points.shape[1] == 2:
        return np.array([[normal[1], -normal[0]], normal])
    plane = np.linalg.svd(normal[None])[2][1:]  # two axes across it
    seen = corners @ plane.T
    edge = ConvexHull(seen).equations[:, :-1]
    across = np.stack([-edge[:, 1], edge[:, 0]], axis=1)
    widths, lengths = np.ptp(edge @ seen.T, axis=1), np.ptp(across @ seen.T, axis=1)
    least = int(np.argmin(widths * lengths))
    pair = (across[least], edge[least]) if lengths[least] >= widths[least] else (edge[least], across[least])
    return np.stack([pair[0] @ plane, pair[1] @ plane, normal])


def _smallest(corners: FloatArray, normals: FloatArray) -> FloatArray:
    """The normal (d,) of those (nf, d) along which the corners (n, d) extend least."""
    directions = np.unique(np.round(normals, 9), axis=0)
    if len(directions) > MOST:
        thin = np.linalg.svd(corners - corners.mean(axis=0), full_matrices=False)[2][-1]
        directions = directions[np.argsort(-np.abs(directions @ thin), kind="stable")[:MOST]]
    normal: FloatArray = directions[np.argmin(np.ptp(directions @ corners.T, axis=1))]
    return normal / np.linalg.norm(normal)
