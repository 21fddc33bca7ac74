"""A skin at given positions: normals, sizes and boxes, vectorised over all bodies."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.contact_detection.skin.skin import Shape, Skin
from fcsim.errors import InputError


def facet_geometry(corners: FloatArray, sides: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Unit normal, centre (nf, 3) and size (nf,) of facets with corners (nf, 4, 3), as `Skin.facets` lists them."""
    area = 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    flat = sides == 2
    if flat.any():
        along = corners[flat, 1] - corners[flat, 0]
        area[flat] = np.stack([along[:, 1], -along[:, 0], np.zeros(len(along))], axis=1)
    measure = np.sqrt(np.einsum("nd,nd->n", area, area))
    centre = np.where((sides == 3)[:, None], corners[:, :3].mean(axis=1), corners.mean(axis=1))
    return area / np.maximum(measure, 1e-300)[:, None], centre, np.where(flat, measure, np.sqrt(measure))


def shape_of(skin: Skin, positions: FloatArray) -> Shape:
    """Return the skin at positions (n_nodes, d) [m]; InputError where a facet has lost its area."""
    points = np.zeros((len(skin.node), 3))
    points[:, : skin.dimension] = positions[skin.node]
    corners = points[skin.facets]
    normal, centre, size = facet_geometry(corners, skin.sides)
    if not np.all(size > 0):
        lost = skin.node[skin.facets[np.argmin(size > 0)]].tolist()
        raise InputError(f"contact of everything: expected facets of positive area, got area 0 at nodes {lost}")
    weight = _angles(corners, skin)
    mean = np.zeros_like(points)
    for l in range(4):
        own = skin.real[:, l]
        for i in range(3):
            mean[:, i] += np.bincount(skin.facets[own, l], weight[own, l] * normal[own, i], len(points))
    mean /= np.maximum(np.sqrt(np.einsum("vd,vd->v", mean, mean)), 1e-300)[:, None]
    body_low, body_high = (reduction.reduceat(points, skin.first_vertex[:-1], axis=0) for reduction in (np.minimum, np.maximum))
    return Shape(points, normal, centre, size, mean, corners.min(axis=1), corners.max(axis=1), body_low, body_high)


def _angles(corners: FloatArray, skin: Skin) -> FloatArray:
    """Angles (nf, 4) of facets at their corners [rad]; 1 for segments. (Angle-weighted normals tell inside from outside: J. A. Baerentzen,
    H. Aanaes, Signed distance computation using the angle weighted pseudonormal, IEEE TVCG 11, 2005.)"""
    if skin.dimension == 2:
        return np.ones((len(corners), 4))
    rows = np.arange(len(corners))[:, None]
    place = np.arange(4)
    following = np.where(place + 1 < skin.sides[:, None], place + 1, 0)
    before = np.where(place > 0, place - 1, skin.sides[:, None] - 1)
    ahead, back = corners[rows, following] - corners, corners[rows, before] - corners
    sine = np.cross(ahead, back)
    return np.arctan2(np.sqrt(np.einsum("fkd,fkd->fk", sine, sine)), np.einsum("fkd,fkd->fk", ahead, back))
