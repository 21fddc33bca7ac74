"""Facets of second order as linear ones: what detection, overlap and pictures work with.

A facet is cut at its nodes into linear pieces, so that every node is a corner of one: segments, triangles or quadrilaterals.
"""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.mesh.cell_type import CELL_TYPES, CellType

PIECES = MappingProxyType(
    {
        "line3": np.array([[0, 2], [2, 1]]),
        "triangle6": np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]),
        "quadrilateral9": np.array([[0, 4, 8, 7], [4, 1, 5, 8], [8, 5, 2, 6], [7, 8, 6, 3]]),
    }
)
"""Local nodes of the pieces of each kind of facet."""

_LINE = np.array([[-1.0], [1.0], [0.0]])  # reference nodes of line3


def linear_facets(facets: IntArray, cell: CellType) -> IntArray:
    """Facets (nf, kf) of cells as linear ones, pieces of one facet after another; those of first order as they are."""
    if cell.order == 1:
        return facets
    pieces = PIECES[cell.facet_type]
    return facets[:, pieces].reshape(-1, pieces.shape[1])


def places_in_facet(kind: str) -> FloatArray:
    """Reference coordinates (pieces, k, d - 1) in a facet of second order of the corners of its pieces."""
    nodes = _LINE if kind == "line3" else CELL_TYPES[kind].nodes
    return np.asarray(nodes[PIECES[kind]], dtype=np.float64)


def facet_shape(kind: str, at: FloatArray) -> FloatArray:
    """Shape functions (n, kf) of a facet of second order at reference points (n, d - 1)."""
    if kind == "line3":
        s = at[:, 0]
        return np.stack([0.5 * s * (s - 1), 0.5 * s * (s + 1), 1 - s * s], axis=1)
    return CELL_TYPES[kind].shape(at)
