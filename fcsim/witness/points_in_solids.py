"""Points of skins and of cylinders within planes and cylinders: the depth of each in closed form."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from fcsim.arrays import FloatArray, IntArray
from fcsim.mesh.exact_shape import across

_AROUND = 24  # points of a rim
_ALONG = np.linspace(-1.0, 1.0, 9)  # shares of the core at which circles are looked at


def points_in_planes(
    points: FloatArray, owner: IntArray, body: IntArray, centre: FloatArray, normal: FloatArray
) -> list[tuple[IntArray, FloatArray, FloatArray]]:
    """For each plane, of bodies body (n,), the pairs of bodies (k, 2) of points (np, d) below it, how deep the deepest is, and where."""
    return [_deepest(points, owner, -(points - centre[k]) @ normal[k], int(body[k])) for k in range(len(body))]


def points_in_cylinders(
    points: FloatArray, owner: IntArray, body: IntArray, centre: FloatArray, along: FloatArray, radius: FloatArray, half: FloatArray
) -> list[tuple[IntArray, FloatArray, FloatArray]]:
    """The same of points of bodies, and of the cylinders' own sides and rims, in cylinders."""
    if not len(body):
        return []
    rings = circles(centre, along, radius, half)
    points = np.concatenate([points, rings.reshape(-1, 3)])
    owner = np.concatenate([owner, np.repeat(body, rings.shape[1])])
    near = cKDTree(points).query_ball_point(centre, np.hypot(radius, half))
    return [
        _deepest(points[rows], owner[rows], depth_in_cylinder(points[rows], centre[k], along[k], radius[k], half[k]), int(body[k]))
        for k, rows in enumerate(near)
    ]


def depth_in_cylinder(points: FloatArray, centre: FloatArray, axis: FloatArray, radius: float, half: float) -> FloatArray:
    """How deep points (n, 3) lie in a cylinder [m]; negative outside."""
    arm = points - centre
    s = arm @ axis
    return np.asarray(np.minimum(radius - np.linalg.norm(arm - s[:, None] * axis, axis=1), half - np.abs(s)))


def circles(centre: FloatArray, along: FloatArray, radius: FloatArray, half: FloatArray) -> FloatArray:
    """Points (ns, 9 x 24, 3) of the sides and rims of cylinders."""
    first, second = across(along)
    angle = 2 * np.pi * np.arange(_AROUND) / _AROUND
    out = np.cos(angle)[:, None] * first[:, None] + np.sin(angle)[:, None] * second[:, None]
    middle = centre[:, None] + (_ALONG * half[:, None])[..., None] * along[:, None]
    ring = middle[:, :, None] + radius[:, None, None, None] * out[:, None]
    return ring.reshape(len(centre), -1, 3)


def _deepest(points: FloatArray, owner: IntArray, depth: FloatArray, other: int) -> tuple[IntArray, FloatArray, FloatArray]:
    """Of each body the deepest of its points."""
    inside = np.flatnonzero((depth > 0) & (owner != other))
    order = inside[np.lexsort((-depth[inside], owner[inside]))]
    rows = order[np.append(len(order) > 0, np.diff(owner[order]) != 0)[: len(order)]]
    return np.column_stack([owner[rows], np.full(len(rows), other)]), depth[rows], points[rows]
