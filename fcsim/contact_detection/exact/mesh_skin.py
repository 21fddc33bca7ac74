"""The skins of meshed bodies as simplices with the features, faces, edges and vertices, that exact shapes touch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.contact_detection.skin.boundary import boundary_of

_BLUNT = 0.4  # [rad] 23 degrees, up to which facets are chords of a curve


class MeshSkin(NamedTuple):
    """facets (nf, d) nodes of triangles (2D: segments), outwards; body (nf,); edges (ne, 2) nodes, none in 2D; edge (nf, 3): of the sides
    k, from corner k to k + 1; edge_facets (ne, 2); vertices (nv,) nodes, vertex (nf, d): their numbers at the facets' corners; deforms
    (nf,): whether the body is deformable; hollow (nv,) [1/m]: see `_hollow`.

    A feature is a face, an edge or a vertex, numbered in this order.
    """

    facets: IntArray
    body: IntArray
    edges: IntArray
    edge: IntArray
    edge_facets: IntArray
    vertices: IntArray
    vertex: IntArray
    deforms: BoolArray
    hollow: FloatArray

    @property
    def n_features(self) -> int:
        return len(self.facets) + len(self.edges) + len(self.vertices)


def mesh_skin(meshed: Model, node: IntArray, body: IntArray) -> MeshSkin:
    """Return the skin of a model of meshed bodies; node, body: their numbers in the whole model."""
    boundary = boundary_of(meshed)
    d = meshed.dimension
    facets = boundary.facets[:, :d]
    owner = boundary.body
    if d == 3:
        four = boundary.sides == 4
        facets = np.concatenate([facets, boundary.facets[four][:, [0, 2, 3]]])
        owner = np.concatenate([owner, owner[four]])
    deforms = owner < len(meshed.deformable)
    corners = meshed.reference[facets]
    facets, owner = node[facets], body[owner]
    vertices, vertex = np.unique(facets, return_inverse=True)
    vertex = vertex.reshape(facets.shape)
    none = np.empty((0, 2), dtype=np.int64)
    if d == 2:
        skin = MeshSkin(facets, owner, none, np.empty((len(facets), 0), dtype=np.int64), none, vertices, vertex, deforms, np.empty(0))
        return skin._replace(hollow=_hollow(skin, corners))
    sides = np.sort(np.stack([facets, np.roll(facets, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    edges, edge = np.unique(sides, axis=0, return_inverse=True)
    edge = edge.reshape(facets.shape)
    order = np.argsort(edge.ravel(), kind="stable")
    first = np.searchsorted(edge.ravel()[order], np.arange(len(edges)))
    last = np.append(first[1:], len(order)) - 1
    between = np.stack([order[first], order[last]], axis=1) // 3
    skin = MeshSkin(facets, owner, edges, edge, between, vertices, vertex, deforms, np.empty(0))
    return skin._replace(hollow=_hollow(skin, corners))


def _hollow(skin: MeshSkin, corners: FloatArray) -> FloatArray:
    """The curvature (nv,) [1/m] at its vertices of the hollow curve whose chords the facets, corners (nf, d, d) [m] in the reference, are:
    2 phi / (l_1 + l_2), largest of the edges there, phi [rad] the angle at which two facets meet, l [m] their heights over the edge (2D:
    lengths). Edges of more than 23 degrees belong to no curve. 0 where the surface is bent outwards as well, or flat.
    """
    d = corners.shape[2]
    if d == 2:  # a vertex is its own edge
        facet, ends = np.argsort(skin.vertex, axis=None, kind="stable") // 2, np.bincount(skin.vertex.ravel())
        shared = np.flatnonzero(ends == 2)
        first = (np.cumsum(ends) - ends)[shared]
        beside, at = np.stack([facet[first], facet[first + 1]], axis=1), shared[:, None]
    else:
        beside, at = skin.edge_facets, np.searchsorted(skin.vertices, skin.edges)
    normal = _units(corners)
    one, other = normal[beside[:, 0]], normal[beside[:, 1]]
    middle = corners.mean(axis=1)
    across = middle[beside[:, 1]] - middle[beside[:, 0]]
    if d == 3:
        place = np.zeros((len(skin.vertices), d))
        place[skin.vertex] = corners
        edge = place[at[:, 1]] - place[at[:, 0]]
        across = across - (np.einsum("ed,ed->e", across, edge) / np.einsum("ed,ed->e", edge, edge))[:, None] * edge
    inwards = np.sign(np.einsum("ed,ed->e", one - other, across))  # normals come together over a hollow
    angle = np.arccos(np.clip(np.einsum("ed,ed->e", one, other), -1.0, 1.0))
    # the middles of triangles are a third of their height off the edge, those of segments half their length
    bend = inwards * angle / np.maximum(np.linalg.norm(across, axis=1) * (1.0 if d == 2 else 1.5), 1e-300)
    bend = np.where(angle <= _BLUNT, bend, 0.0)
    largest, least = np.zeros(len(skin.vertices)), np.zeros(len(skin.vertices))
    for side in range(at.shape[1]):
        np.maximum.at(largest, at[:, side], bend)
        np.minimum.at(least, at[:, side], bend)
    return np.where(least >= -0.1 * largest, largest, 0.0)


def normals(skin: MeshSkin, positions: FloatArray) -> FloatArray:
    """Unit normals (nf, d) at the nodes' positions."""
    return _units(positions[skin.facets])


def _units(x: FloatArray) -> FloatArray:
    """Unit normals (nf, d) of facets of corners x (nf, d, d)."""
    if x.shape[2] == 2:
        t = x[:, 1] - x[:, 0]
        area = np.stack([t[:, 1], -t[:, 0]], axis=1)
    else:
        area = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    return area / np.maximum(np.linalg.norm(area, axis=1), 1e-300)[:, None]
