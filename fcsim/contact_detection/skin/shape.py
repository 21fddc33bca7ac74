"""A skin at given positions: normals, sizes and boxes of all bodies."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.contact_detection.skin._shape_kernels import boxes, facet_geometry, mean_normals, sines_and_cosines
from fcsim.contact_detection.skin.skin import Shape, Skin
from fcsim.errors import InputError


def shape_of(skin: Skin, positions: FloatArray) -> Shape:
    """Return the skin at positions (n_nodes, d) [m]; InputError where a facet has lost its area."""
    points = np.zeros((len(skin.node), 3))
    points[:, : skin.dimension] = positions[skin.node]
    normal, centre, size = facet_geometry(points, skin.facets, skin.sides)
    if not np.all(size > 0):
        lost = skin.node[skin.facets[np.argmin(size > 0)]].tolist()
        raise InputError(f"contact of everything: expected facets of positive area, got area 0 at nodes {lost}")
    mean = mean_normals(len(points), skin.facets, skin.sides, _angles(points, skin), normal)
    body_low, body_high = (reduction.reduceat(points, skin.first_vertex[:-1], axis=0) for reduction in (np.minimum, np.maximum))
    (low, high), (edge_low, edge_high) = boxes(points, skin.facets), boxes(points, skin.edges)
    return Shape(points, normal, centre, size, mean, low, high, edge_low, edge_high, body_low, body_high)


def _angles(points: FloatArray, skin: Skin) -> FloatArray:
    """Angles (nf, 4) of facets at their corners [rad]; 1 for segments. (Angle-weighted normals tell inside from outside: J. A. Baerentzen,
    H. Aanaes, Signed distance computation using the angle weighted pseudonormal, IEEE TVCG 11, 2005.)"""
    if skin.dimension == 2:
        return np.ones((len(skin.facets), 4))
    return np.arctan2(*sines_and_cosines(points, skin.facets, skin.sides))
