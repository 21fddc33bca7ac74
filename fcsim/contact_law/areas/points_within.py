"""Points within the overlaps of flat faces of rigid bodies, for joints whose nodes are all at their rims."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.contacts import WITHIN
from fcsim.contact_detection.frames import frames
from fcsim.contact_detection.integral._overlap_kernels import gauss_points, overlap_polygons
from fcsim.contact_detection.integral.segment_to_segment import CENTRE, Configuration, Segments, intervals
from fcsim.contact_detection.surfaces.surface import OPPOSING
from fcsim.contact_law.areas.flat_faces import Patches
from fcsim.contact_law.areas.moments import Points

_PLACES = np.stack(np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]), axis=2).reshape(-1, 2)
"""Of the points of an overlap, over its radii of gyration: their number is always the same, and they move as the overlap changes."""
_THREE_PLACES = 0.5 + np.array([-1.0, 0.0, 1.0]) / np.sqrt(12)
"""Those in 2D, in [0, 1]."""
_SLIVER = 1e-4
"""Of the smaller facet's area: overlaps that are smaller have no points of their own."""
_LEAST = 1e-6
"""Of an even share of the area of a joint: what a point that is no more within an overlap keeps."""


def points_within(patches: Patches, coarse: BoolArray) -> tuple[Segments, IntArray, IntArray]:
    """Points within the overlaps of coarse patches (n,), with even shares of their areas as weights; their patch (nq,), identity (nq,)."""
    found, faces = patches.found, patches.faces
    size, now = faces.now.slave.size, faces.now
    smaller = np.minimum(size[found.slave], size[found.master]) ** (now.x.shape[1] - 1)
    pairs = np.flatnonzero(coarse[patches.pair] & (found.area > _SLIVER * smaller))
    one, other = found.slave[pairs], found.master[pairs]
    if now.x.shape[1] == 2:
        points = intervals(now, one, other, _THREE_PLACES)
    else:
        points = _of_polygons(now, one, other, (faces.facets.nodes >= 0).sum(axis=1))
    couple = faces.number[one] * faces.every + faces.number[other]
    return points, patches.pair[pairs[points.row]], WITHIN + couple[points.row] * len(_PLACES) + points.number


def _of_polygons(now: Configuration, slave: IntArray, master: IntArray, sides: IntArray) -> Segments:
    """c + L z for each z of `_PLACES`, c the centroid of the overlap of two facets, L L^T its second moments over its area: within it,
    since a convex K in the plane has c + sqrt(2) L B in it, B the unit disc (R. Kannan, L. Lovasz, M. Simonovits, Isoperimetric problems
    for convex bodies and a localization lemma, Discrete Comput. Geom. 13, 1995)."""
    frame, every = frames(now.slave.normal), np.full(len(slave), np.inf)
    ours, theirs = (now.slave.corners, sides, frame, now.slave.centre), (now.master.corners, sides)
    polygon, corners, area = overlap_polygons(slave, master, *ours, now.slave.size, *theirs, now.master.normal, OPPOSING, every)
    arm = polygon - polygon[:, :1]
    a, b = arm[:, :-1], arm[:, 1:]  # of triangles from the first corner
    part = np.where(np.arange(1, polygon.shape[1]) < corners[:, None], 0.5 * (a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]), 0.0)
    part /= np.where(area > 0, area, 1.0)[:, None]
    middle = np.einsum("pk,pki->pi", part, a + b) / 3
    second = sum(np.einsum("pk,pki,pkj->pij", part, z, z) for z in (a, b, a + b)) / 12 - middle[:, :, None] * middle[:, None, :]
    second[area <= 0] = np.eye(2)
    places = (polygon[:, 0] + middle)[:, None] + np.einsum("pij,qj->pqi", np.linalg.cholesky(second), _PLACES)
    row, number = np.divmod(np.flatnonzero(np.repeat(area > 0, len(_PLACES))), len(_PLACES))
    alone = np.repeat(places[row, number][:, None], 3, axis=1)  # a triangle that is a point
    at = gauss_points(slave[row], master[row], alone, np.full(len(row), 3), np.arange(len(row) + 1), *ours, *theirs, *CENTRE)
    return Segments(slave, master, area, row, number, area[row] / len(_PLACES), *at[1:])


def areas_of_flat_faces(patches: Patches | None, count: int, with_points: BoolArray, identity: IntArray) -> tuple[FloatArray, FloatArray]:
    """Areas (count,) [m^2; 2D: m] of contacts, nan of those that are in no patch, and of points within faces of that identity (k,).

    with_points (count,): contacts whose patches have such points, whether these are near enough to be contacts or not."""
    area, of_points = np.full(count, np.nan), np.zeros(len(identity))
    if patches is None:
        return area, of_points
    alone, flagged = patches.areas(), np.zeros(len(patches.codes), dtype=bool)
    own = alone[: len(patches.own)]
    flagged[patches.patch[with_points[patches.own]]] = True
    of_points[:] = _LEAST * own.mean() if len(own) else 0.0
    if flagged.any():
        coarse = np.where(flagged, patches.coarse(alone), 0.0)
        found, patch, known = points_within(patches, coarse > 0)
        places = np.einsum("nk,nkd->nd", found.phi, patches.faces.now.slave.corners[found.slave[found.row]])
        both = patches.areas(Points(places, found.weight, patch))
        order = np.argsort(known)
        if len(known):
            at = order[np.minimum(np.searchsorted(known, identity, sorter=order), len(known) - 1)]
            of_points = np.where(known[at] == identity, (coarse[patch] * both[len(alone) :])[at], of_points)
        own = own + coarse[patches.patch] * (both[: len(own)] - own)
    area[patches.own] = np.where(own > 0, own, np.nan)
    return area, of_points
