"""The closed surfaces of all bodies as arrays: vertices, facets, edges and who borders whom; found once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.brief import brief

FLAT = np.cos(np.deg2rad(0.05))
"""Faces that meet at less than 0.05 degrees are one: the edge between them needs no contact of its own, the vertices on it do the work."""

BENT = np.cos(np.deg2rad(5.0))
"""Faces that meet at less than 5 degrees are one that a mesh or strain has bent: there is no inner corner between them."""

SMOOTH = np.cos(np.deg2rad(45.0))
"""Faces that meet at less than 45 degrees stand for a curved surface: a vertex rolls over the edge between them."""


@dataclass(frozen=True, eq=False)
class Skin:
    """Closed surfaces of nb bodies, body after body: nv vertices, nf facets, ne edges (2D: none).

    node, vertex_body (nv,)    global node number, body
    first_vertex, first_facet, first_edge (nb + 1,): those of body b are first[b] ... first[b + 1] - 1
    facets (nf, 4)             vertices; a triangle has its first again in the last place, a 2D segment (a, b, b, a)
    sides, facet_body (nf,)    2, 3 or 4; body
    edges, edge_facets (ne, 2) vertices a -> b as the first facet has them; the two facets
    facet_edges (nf, 4)        edge of each side l, from corner l to the next; -1 = none
    sharp, smooth (ne,)        convex edge between faces that meet at more than FLAT; faces meeting at less than SMOOTH (in the reference)
    star, first_star           facets around a vertex: star[first_star[v]] ... star[first_star[v + 1] - 1]
    side (nf,)                 number of the smooth patch of a facet: what one face of a box is, however finely it is meshed
    patch (nf,)                the same of faces that meet at less than ROUND, but for blunt edges between flat faces, see `blunt_edges`
    smooth_vertex (nv,)        all edges that end there are smooth
    """

    dimension: int
    node: IntArray
    vertex_body: IntArray
    first_vertex: IntArray
    facets: IntArray
    sides: IntArray
    facet_body: IntArray
    first_facet: IntArray
    edges: IntArray
    edge_facets: IntArray
    first_edge: IntArray
    facet_edges: IntArray
    sharp: BoolArray
    smooth: BoolArray
    star: IntArray
    first_star: IntArray
    side: IntArray
    patch: IntArray
    smooth_vertex: BoolArray

    __repr__ = brief

    @property
    def n_bodies(self) -> int:
        return len(self.first_vertex) - 1

    @property
    def n_sides(self) -> int:
        return int(self.side.max(initial=0)) + 1

    @cached_property
    def rim(self) -> BoolArray:
        """(ne,): convex edges at which a face ends; over the others a vertex rolls, or they are concave."""
        return self.sharp & ~self.smooth

    @cached_property
    def sharp_edges(self) -> IntArray:
        """Numbers of the sharp edges, body after body."""
        return np.flatnonzero(self.sharp)

    @cached_property
    def real(self) -> BoolArray:
        """(nf, 4): which places of `facets` are corners."""
        return np.arange(4) < self.sides[:, None]


@dataclass(frozen=True, eq=False)
class Shape:
    """A skin at given positions: point (nv, 3) [m] with z = 0 in 2D; normal, centre (nf, 3) and size (nf,) [m] of facets, the square root
    of their area (2D: length); mean (nv, 3) angle-weighted normal of a vertex; boxes [m] by their low and high corners: of facets (nf, 3),
    of edges (ne, 3), of bodies (nb, 3)."""

    point: FloatArray
    normal: FloatArray
    centre: FloatArray
    size: FloatArray
    mean: FloatArray
    low: FloatArray
    high: FloatArray
    edge_low: FloatArray
    edge_high: FloatArray
    body_low: FloatArray
    body_high: FloatArray

    __repr__ = brief
