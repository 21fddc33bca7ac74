"""Sharp edges that lie on a face of a deformable body: a plate on knife-edges, a sheet over the rim of a table.

Between rigid bodies the corners of a patch hold all of it. A face that bends sinks between them on to what is sharp, and bears all along
it: where the sharp edge crosses the edges within the face, and at the face's vertices that lie on it. The normal is the face's. The
vertices of a sharp edge that is no longer than the face's facets bear the face by themselves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.general.near import NearBodies, edges_of_both
from fcsim.contact_detection.skin.skin import Shape, Skin

_LONGER = 1.5  # of the longest side of a face's facets: the sharp edges that have contacts across the face's edges
_STRAIGHT = 0.9  # cosine between edges of a rim that goes on through a vertex


class FaceEdges(NamedTuple):
    """Of a skin's ne edges in the reference configuration: within (n,) numbers of those within a face of a deformable body, sorted; longer
    (ne,) [m] how long a sharp edge is to bear there; goes_on (ne, 2) whether that face, or the rim that a sharp one is of, goes straight
    on beyond an end; length (ne,) [m]; the first `bending` vertices are those of deformable bodies."""

    within: IntArray
    longer: FloatArray
    goes_on: BoolArray
    length: FloatArray
    bending: int


def face_edges(skin: Skin, reference: Shape, deformable: int) -> FaceEdges:
    """Of a skin whose first so many bodies are deformable."""
    first, second = reference.point[skin.edges].swapaxes(0, 1)
    length = np.linalg.norm(second - first, axis=1)
    none, bending = np.zeros(len(length), dtype=bool), int(skin.first_vertex[deformable])
    if skin.dimension == 2:
        return FaceEdges(np.flatnonzero(none), length, np.column_stack([none, none]), length, bending)
    sides = np.where(skin.facet_edges < 0, 0.0, length[skin.facet_edges]).max(axis=1)
    ours = np.arange(len(length)) < skin.first_edge[deformable]
    along, vertices = (second - first) / length[:, None], len(skin.node)
    sharp, rims = (np.bincount(skin.edges[kind].ravel(), minlength=vertices) for kind in (skin.sharp | ~skin.smooth, skin.rim))
    towards = np.zeros((vertices, 3))  # sum of the directions away from a vertex, none where a rim goes straight on
    np.add.at(towards, skin.edges[skin.rim], along[skin.rim, None] * np.array([1.0, -1.0])[:, None])
    straight = (sharp == 2) & (rims == 2) & (np.einsum("vd,vd->v", towards, towards) < 2.0 - 2.0 * _STRAIGHT)
    goes_on = np.where(skin.sharp[:, None], straight[skin.edges], (sharp == 0)[skin.edges] & ours[:, None])
    within = np.flatnonzero(ours & ~skin.sharp & skin.smooth)
    return FaceEdges(within, _LONGER * sides[skin.edge_facets].max(axis=1), goes_on, length, bending)


def near_edges_across_faces(skin: Skin, shape: Shape, near: NearBodies, faces: FaceEdges) -> IntArray:
    """Rows (edge of the first body, edge of the second, pair), one sharp and long enough for the other one, which is within a face."""
    number = np.flatnonzero(~near.itself)
    two, sharp = near.take(number), skin.sharp_edges[faces.length[skin.sharp_edges] > faces.longer[faces.within].min()]
    rows = np.concatenate([edges_of_both(skin, shape, two, sharp, faces.within), edges_of_both(skin, shape, two, faces.within, sharp)])
    rows[:, 2] = number[rows[:, 2]]
    is_sharp = skin.sharp[rows[:, :2]]
    return rows[faces.length[rows[:, :2][is_sharp]] > faces.longer[rows[:, :2][~is_sharp]]]
