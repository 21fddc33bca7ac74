"""What the linear pieces of facets of second order are pieces of: the shape functions with which their points move.

Detection sees linear facets (segments, triangles, quadrilaterals). A point on a piece has its weights in the piece's corners, and with
these a place in the facet's reference cell; there the facet's own shape functions are what its displacement is interpolated with.
The rules that integrate over overlaps use them, so that a uniform pressure gives the nodal forces of the elements themselves.

A facet of second order has a curve of its own, off a circle by 1 part in 30 of what that bulges over the pieces where the facet turns by 34
degrees: of bodies that fit each other more than what they are pressed together by. `beyond` says what is left to the surface that all
facets stand for, where both are the same but for `NEAR`; else, at the end of an arc, the facets' own curve is the surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.mesh.cell_type import CellType
from fcsim.mesh.order.linear_facets import PIECES, facet_shape, places_in_facet

KINDS = ("", *PIECES)
"""Kinds of parents; the first: the facet is of first order, and its own parent."""
NEAR = 1.0 / 3.0
"""Of the largest height over a piece: where the facet's own curve and the surface differ by more, that is not known so well."""


@dataclass(frozen=True, eq=False)
class Parents:
    """Of nf facets: kind (nf,) among `KINDS`; nodes (nf, kp) of the parent, -1 = none; places (nf, k, d - 1) of the facet's corners in the
    parent's reference cell; beyond (nf, k, k) [m] what the surface bulges over the parents' own curve, of the form of `bulges`, None: 0."""

    kind: IntArray
    nodes: IntArray
    places: FloatArray
    beyond: FloatArray | None = None

    def take(self, chosen: IntArray | BoolArray) -> Parents:
        beyond = None if self.beyond is None else self.beyond[chosen]
        return Parents(self.kind[chosen], self.nodes[chosen], self.places[chosen], beyond)

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


def with_surface(parents: Parents, bulge: FloatArray, sides: IntArray, x: FloatArray, normal: FloatArray) -> Parents:
    """The parents of pieces over which the surface bulges by B (nf, k, k) [m] of `bulges`, with what is beyond their own curve; sides (nf,)
    of the pieces, x (n, d) [m] the reference positions of all nodes, normal (nf, d) of the pieces."""
    those = np.flatnonzero((parents.kind > 0) & bulge.any(axis=(1, 2)))
    if not len(those):
        return parents
    k = bulge.shape[1]
    node = np.where(parents.nodes < 0, parents.nodes[:, :1], parents.nodes)[those]
    four = sides[those] == 4

    def height(weights: FloatArray) -> FloatArray:
        """Of the own curve over the piece at weights (k,) in its corners."""
        corners = np.eye(k)[:, None].repeat(len(those), axis=1)
        shape = parents.shape(those, np.broadcast_to(weights, (len(those), k)))
        flat = sum(weights[j] * parents.shape(those, corners[j]) for j in range(k) if weights[j])
        return np.asarray(np.einsum("fk,fkd,fd->f", shape - flat, x[node], normal[those]))

    own = np.zeros((len(those), k, k))
    for one in range(k):
        for other in range(one):
            own[:, one, other] = own[:, other, one] = 2.0 * height(0.5 * (np.eye(k)[one] + np.eye(k)[other]))
    if k == 4:  # the diagonals as the middle of a quadrilateral says, whose weights there are 1/4
        around = own[:, 0, 1] + own[:, 1, 2] + own[:, 2, 3] + own[:, 3, 0]
        across = np.where(four, 4.0 * height(np.full(4, 0.25)) - 0.5 * around, own[:, 0, 2])
        own[:, 0, 2] = own[:, 2, 0] = across
        own[:, 1, 3] = own[:, 3, 1] = across
    left = bulge[those] - own
    known = np.abs(left) <= NEAR * np.abs(own).max(axis=(1, 2))[:, None, None]
    beyond = np.zeros_like(bulge)
    beyond[those] = np.where(known & (bulge[those] != 0), left, 0.0)
    return replace(parents, beyond=beyond)


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
        np.concatenate([_beyond(p, corners) for p in parents]) if any(p.beyond is not None for p in parents) else None,
    )


def _beyond(parents: Parents, width: int) -> FloatArray:
    """(nf, width, width), 0 where there is none."""
    count, own = parents.places.shape[:2]
    given = np.zeros((count, own, own)) if parents.beyond is None else parents.beyond
    return np.pad(given, ((0, 0), (0, width - own), (0, width - own)))
