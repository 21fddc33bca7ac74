"""The parts of a surface that blunt edges connect."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from fcsim.arrays import FloatArray, IntArray

ROUND = np.cos(np.deg2rad(23.0))
"""Faces that meet at less than 23 degrees, as 16 around a circle do, may be those of a curve: few real edges are so blunt."""


def patches(corners: IntArray, normal: FloatArray, least: float) -> IntArray:
    """Numbers (nf,) of the parts that edges, in 2D nodes, connect whose facets' normals have a cosine of `least` or more.

    corners (nf, k) nodes, a triangle's last one among quadrilaterals its first; normal (nf, d).
    """
    first, second = _neighbours(corners)
    smooth = np.einsum("nd,nd->n", normal[first], normal[second]) >= least
    count = len(corners)
    graph = csr_array((np.ones(smooth.sum()), (first[smooth], second[smooth])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _neighbours(nodes: IntArray) -> tuple[IntArray, IntArray]:
    """Pairs of facets that share an edge (in 2D a node)."""
    width = nodes.shape[1]
    facet = np.broadcast_to(np.arange(len(nodes))[:, None], nodes.shape)
    ends = np.stack([nodes, nodes if width == 2 else np.roll(nodes, -1, axis=1)])
    key = ends.min(axis=0) * (1 + nodes.max()) + ends.max(axis=0)
    real = (ends[0] != ends[1]) | (width == 2)  # a padded triangle has an edge of no length
    key, facet = key[real], facet[real]
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(np.diff(key[order]) == 0)
    return facet[order[same]], facet[order[same + 1]]
