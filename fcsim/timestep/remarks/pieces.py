"""Meshes of pieces that only look like one: nodes that lie on each other, once for each cell that has them, or on faces of other cells."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.contact_detection.surfaces.broad_phase import near_pairs
from fcsim.mesh.part import Part
from fcsim.witness.skin import boundary_facets

ONE_PLACE = 1e-9
"""Of a part's extent: nodes nearer to each other lie on each other."""
WITHIN = 1e-6
"""Of a facet's size: what is nearer to it lies on it."""


def torn_meshes(model: Model) -> Iterator[str]:
    """Parts whose cells make several pieces that meet in nodes which they do not share: nothing holds these together."""
    for part in {id(body.part): body.part for body in model.deformable}.values():
        piece = _piece_of_node(part)
        count = int(piece.max()) + 1
        if count == 1:
            continue
        extent = float(np.ptp(part.points, axis=0).max())
        pairs = cKDTree(part.points).query_pairs(ONE_PLACE * extent, output_type="ndarray")
        doubled = np.unique(pairs[piece[pairs[:, 0]] != piece[pairs[:, 1]]])
        if doubled.size:
            yield (
                f"the mesh of part {part.name!r} is {count} pieces that share no node, though {doubled.size} of its nodes lie on nodes of "
                "other pieces: nothing but contact, or links, holds them together. If they are one body, merge the nodes (gmsh: "
                "Coherence Mesh; Geometry.Tolerance)"
            )
            return


def hanging_nodes(model: Model) -> Iterator[str]:
    """Parts of one piece with nodes within faces or edges that are not theirs: finer cells beside coarser ones."""
    for part in {id(body.part): body.part for body in model.deformable}.values():
        hanging = _within_faces(part)
        if hanging.size:
            at = ", ".join(f"{c:.4g}" for c in part.points[hanging[0]])
            yield (
                f"{hanging.size} nodes of the mesh of part {part.name!r} lie on faces of cells that do not have them, as ({at}): cells "
                "meet there as if cut, held at common nodes alone. If that is no crack: mesh both sides alike, or tie two parts (Tied)"
            )
            return


def _within_faces(part: Part) -> IntArray:
    """Nodes of the boundary that lie within a facet of it, or on its side, and are no corner of it nor at one."""
    facets, points = boundary_facets(part), part.points
    facets = np.where(facets < 0, facets[:, :1], facets)
    nodes, corners = np.unique(facets), points[facets]
    centres = corners.mean(axis=1)
    reach = np.linalg.norm(corners - centres[:, None], axis=2).max(axis=1)
    i, j = near_pairs(points[nodes], centres, reach)
    other = (facets[j] != nodes[i][:, None]).all(axis=1)
    i, j = nodes[i[other]], j[other]
    halves = ((0, 1, 2), (0, 2, 3)) if facets.shape[1] == 4 else (tuple(range(facets.shape[1])),)
    within = np.zeros(len(i), dtype=bool)
    for half in halves:
        within |= _lies_within(points[i], points[facets[j][:, half]])
    return np.unique(i[within])


def _lies_within(point: FloatArray, corners: FloatArray) -> np.ndarray:
    """Whether points (n, d) lie in simplices (n, d, d) of one dimension less, but for their corners, up to WITHIN of their sizes."""
    along = corners[:, 1:] - corners[:, :1]
    gram = np.einsum("nad,nbd->nab", along, along)
    size = np.linalg.norm(along, axis=2).max(axis=1)
    flat = np.linalg.det(gram) > (WITHIN * size**2) ** along.shape[1]
    gram[~flat] = np.eye(along.shape[1])
    arm = point - corners[:, 0]
    weights = np.linalg.solve(gram, np.einsum("nad,nd->na", along, arm)[..., None])[..., 0]
    off = np.linalg.norm(arm - np.einsum("na,nad->nd", weights, along), axis=1)
    weights = np.column_stack([1 - weights.sum(axis=1), weights])
    found: np.ndarray = flat & (off < WITHIN * size) & (weights > -WITHIN).all(axis=1) & (weights < 1 - WITHIN).all(axis=1)
    return found


def _piece_of_node(part: Part) -> np.ndarray:
    """The number (n_nodes,) of the piece that a node is in: cells with a common node are in one."""
    n, corners = len(part.points), part.cells
    first = np.repeat(corners[:, 0], corners.shape[1])
    graph = sp.coo_array((np.ones(corners.size, dtype=bool), (first, corners.ravel())), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1])
