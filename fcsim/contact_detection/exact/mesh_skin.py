"""The skins of meshed bodies as simplices with the features, faces, edges and vertices, that exact shapes touch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.contact_detection.skin.boundary import boundary_of


class MeshSkin(NamedTuple):
    """facets (nf, d) nodes of triangles (2D: segments), outwards; body (nf,); edges (ne, 2) nodes, none in 2D; edge (nf, 3): of the sides
    k, from corner k to k + 1; edge_facets (ne, 2); vertices (nv,) nodes, vertex (nf, d): their numbers at the facets' corners; deforms
    (nf,): whether the body is deformable.

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
    facets, owner = node[facets], body[owner]
    vertices, vertex = np.unique(facets, return_inverse=True)
    vertex = vertex.reshape(facets.shape)
    none = np.empty((0, 2), dtype=np.int64)
    if d == 2:
        return MeshSkin(facets, owner, none, np.empty((len(facets), 0), dtype=np.int64), none, vertices, vertex, deforms)
    sides = np.sort(np.stack([facets, np.roll(facets, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    edges, edge = np.unique(sides, axis=0, return_inverse=True)
    edge = edge.reshape(facets.shape)
    order = np.argsort(edge.ravel(), kind="stable")
    first = np.searchsorted(edge.ravel()[order], np.arange(len(edges)))
    last = np.append(first[1:], len(order)) - 1
    return MeshSkin(facets, owner, edges, edge, np.stack([order[first], order[last]], axis=1) // 3, vertices, vertex, deforms)


def normals(skin: MeshSkin, positions: FloatArray) -> FloatArray:
    """Unit normals (nf, d) at the nodes' positions."""
    x = positions[skin.facets]
    if x.shape[2] == 2:
        t = x[:, 1] - x[:, 0]
        area = np.stack([t[:, 1], -t[:, 0]], axis=1)
    else:
        area = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    return area / np.maximum(np.linalg.norm(area, axis=1), 1e-300)[:, None]
