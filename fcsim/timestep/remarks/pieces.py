"""Meshes of pieces that only look like one: nodes that lie on each other, once for each cell that has them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fcsim.assembly.model import Model
from fcsim.mesh.part import Part

ONE_PLACE = 1e-9
"""Of a part's extent: nodes nearer to each other lie on each other."""


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


def _piece_of_node(part: Part) -> np.ndarray:
    """The number (n_nodes,) of the piece that a node is in: cells with a common node are in one."""
    n, corners = len(part.points), part.cells
    first = np.repeat(corners[:, 0], corners.shape[1])
    graph = sp.coo_array((np.ones(corners.size, dtype=bool), (first, corners.ravel())), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1])
