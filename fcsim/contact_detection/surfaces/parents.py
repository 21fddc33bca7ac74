"""What the linear pieces of facets of second order are pieces of: the shape functions with which their points move.

Detection sees linear facets (segments, triangles, quadrilaterals). A point on a piece has its weights in the piece's corners, and with
these a place in the facet's reference cell; there the facet's own shape functions are what its displacement is interpolated with.
The rules that integrate over overlaps use them, so that a uniform pressure gives the nodal forces of the elements themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.mesh.cell_type import CellType
from fcsim.mesh.order.linear_facets import PIECES, facet_shape, places_in_facet

KINDS = ("", *PIECES)
"""Kinds of parents; the first: the facet is of first order, and its own parent."""


@dataclass(frozen=True, eq=False)
class Parents:
    """Of nf facets: kind (nf,) among `KINDS`; nodes (nf, kp) of the parent, -1 = none; places (nf, k, d - 1) of the facet's corners in the
    parent's reference cell."""

    kind: IntArray
    nodes: IntArray
    places: FloatArray

    def take(self, chosen: IntArray | BoolArray) -> Parents:
        return Parents(self.kind[chosen], self.nodes[chosen], self.places[chosen])

    def shape(self, facet: IntArray, weights: FloatArray) -> FloatArray:
        """Shape functions (nq, kp) of the parents of `facet` (nq,) at the points with the weights (nq, k) in the facet's corners."""
        values = np.zeros((len(facet), self.nodes.shape[1]))
        kind = self.kind[facet]
        for number, name in enumerate(KINDS):
            those = np.flatnonzero(kind == number)
            if not number:
                values[those, : weights.shape[1]] = weights[those]
            elif len(those):
                own = facet_shape(name, np.einsum("nk,nkr->nr", weights[those], self.places[facet[those]]))
                values[those, : own.shape[1]] = own
        return values


def of_first_order(facets: IntArray) -> Parents:
    """Facets (nf, k) as their own parents."""
    nf, k = facets.shape
    return Parents(np.zeros(nf, dtype=np.int64), facets, np.zeros((nf, k, 1 if k == 2 else 2)))


def of_pieces(facets: IntArray, cell: CellType) -> Parents:
    """The parents of the linear facets of facets of second order (nf, kf) of cells, in the order of `linear_facets`."""
    places = places_in_facet(cell.facet_type)
    count = len(places)
    kind = np.full(count * len(facets), KINDS.index(cell.facet_type))
    return Parents(kind, np.repeat(facets, count, axis=0), np.tile(places, (len(facets), 1, 1)))


def join(parents: Sequence[Parents]) -> Parents:
    """One after another, narrower ones filled up."""
    nodes, corners = max(p.nodes.shape[1] for p in parents), max(p.places.shape[1] for p in parents)

    def filled(array: NDArray, width: int, value: int) -> NDArray:
        return np.pad(array, ((0, 0), (0, width - array.shape[1]), *((0, 0),) * (array.ndim - 2)), constant_values=value)

    return Parents(
        np.concatenate([p.kind for p in parents]),
        np.concatenate([filled(p.nodes, nodes, -1) for p in parents]),
        np.concatenate([filled(p.places, corners, 0) for p in parents]),
    )
