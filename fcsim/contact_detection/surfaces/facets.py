"""Facets of several surfaces in one set of arrays: geometry in a configuration, and which edges lie inside a surface."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.surfaces._facet_kernels import facets_in_space, write_facets
from fcsim.contact_detection.surfaces.parents import Parents, of_first_order
from fcsim.contact_detection.surfaces.parents import join as join_parents
from fcsim.contact_detection.surfaces.surface import ContactSurface
from fcsim.errors import InputError
from fcsim.ranks import for_parts, in_parts

_TWIST = 1e-7
"""A quadrilateral is twisted whose corners are off its plane by more than this part of its size."""


class Facets(NamedTuple):
    """nf facets of width k (the largest in use), surface after surface.

    nodes   (nf, k) -1 = none
    closed  (nf, k) the same with a triangle's missing node replaced by its first, so that its corners close a polygon
    bodies  (nf,)
    offsets (surfaces + 1,) facets of surface s are offsets[s] ... offsets[s + 1] - 1
    parents of second order, None where there are none
    bulge   (nf, k, k) [m], see `bulges`; None where no facet has one
    """

    nodes: IntArray
    closed: IntArray
    bodies: IntArray
    offsets: IntArray
    parents: Parents | None = None
    bulge: FloatArray | None = None

    @property
    def width(self) -> int:
        return self.nodes.shape[1]

    @property
    def moving_nodes(self) -> IntArray:
        """Nodes (nf, kp) by which the facets' points move: the closed facets' own, or their parents'; places without one have weight 0."""
        if self.parents is None:
            return self.closed
        return np.where(self.parents.nodes < 0, self.parents.nodes[:, :1], self.parents.nodes)

    def shape(self, facet: IntArray, weights: FloatArray) -> FloatArray:
        """Weights (nq, kp) of `moving_nodes` at points with the weights (nq, k) in the corners of `facet` (nq,)."""
        return weights if self.parents is None else self.parents.shape(facet, weights)


class Topology(NamedTuple):
    """Neighbourhood on the surfaces: edge l of a facet joins its nodes l and l + 1; in 2D a facet has vertices only.

    interior_edge   (nf, k) the edge is shared by two facets of the surface
    interior_vertex (nf, k) no edge of the surface's outer boundary ends there (2D: two segments share it)
    vertex          (nf, k) numbers of vertices within the surfaces
    averaging       (nv, nf) mean over the facets around a vertex
    """

    interior_edge: BoolArray
    interior_vertex: BoolArray
    vertex: IntArray
    averaging: csr_array


class FacetGeometry(NamedTuple):
    """corners (nf, k, d) [m]; centre (nf, d) [m]; radius (nf,) [m] around it; unit normal (nf, d) at the centre; size (nf,) [m],
    the square root of the area (2D: the length)."""

    corners: FloatArray
    centre: FloatArray
    radius: FloatArray
    normal: FloatArray
    size: FloatArray


def join(surfaces: Sequence[ContactSurface], *, sort: bool = False) -> Facets:
    """Concatenate surfaces of one dimension; `sort` numbers the facets of each by their nodes, whatever order they came in."""
    width = max(surface.facets.shape[1] for surface in surfaces)
    nodes = [np.pad(s.facets, ((0, 0), (0, width - s.facets.shape[1])), constant_values=-1) for s in surfaces]
    bodies = [s.bodies for s in surfaces]
    second = any(s.parents is not None for s in surfaces)
    parents = [s.parents or of_first_order(n) for s, n in zip(surfaces, nodes, strict=True)] if second else []
    bulge = [_bulge(s, width) for s in surfaces] if any(s.bulge is not None for s in surfaces) else []
    if sort:
        orders = [np.lexsort(np.sort(n, axis=1).T[::-1]) for n in nodes]
        nodes = [n[order] for n, order in zip(nodes, orders, strict=True)]
        bodies = [b[order] for b, order in zip(bodies, orders, strict=True)]
        parents = [p.take(order) for p, order in zip(parents, orders, strict=False)]
        bulge = [b[order] for b, order in zip(bulge, orders, strict=False)]
    joined = np.concatenate(nodes)
    offsets = np.cumsum([0] + [len(n) for n in nodes])
    closed = np.where(joined < 0, joined[:, :1], joined)
    of_second = join_parents(parents) if second else None
    return Facets(joined, closed, np.concatenate(bodies), offsets, of_second, np.concatenate(bulge) if bulge else None)


def _bulge(surface: ContactSurface, width: int) -> FloatArray:
    """(nf, width, width), 0 where there is none."""
    count, own = surface.facets.shape
    given = np.zeros((count, own, own)) if surface.bulge is None else surface.bulge
    return np.pad(given, ((0, 0), (0, width - own), (0, width - own)))


def averaging_at_nodes(nodes: IntArray) -> tuple[IntArray, IntArray, csr_array]:
    """Nodes of the facets (nf, k), each once: sorted numbers (nv,), places (nf, k) in them, matrix (nv, nf) of the mean around each."""
    real = nodes >= 0
    facet = np.broadcast_to(np.arange(len(nodes))[:, None], nodes.shape)[real]
    numbers, place = np.unique(nodes[real], return_inverse=True)
    vertex = np.zeros_like(nodes)
    vertex[real] = place
    valence = np.bincount(place, minlength=len(numbers))
    return numbers, vertex, csr_array((1.0 / valence[place], (place, facet)), shape=(len(numbers), len(nodes)))


def topology(facets: Facets) -> Topology:
    """Find edges and vertices inside each surface, which a foot point may rest on, and those on its outer boundary."""
    surface = np.repeat(np.arange(len(facets.offsets) - 1), np.diff(facets.offsets))[:, None]
    stride = facets.nodes.max(initial=0) + 1
    _, vertex, averaging = averaging_at_nodes(np.where(facets.nodes < 0, -1, facets.nodes + stride * surface))
    vertex = np.where(facets.nodes < 0, vertex[:, :1], vertex)
    if facets.width == 2:
        interior_vertex = np.bincount(vertex.ravel(), minlength=1)[vertex] >= 2
        return Topology(np.zeros_like(interior_vertex), interior_vertex, vertex, averaging)
    ends = np.stack([vertex, np.roll(vertex, -1, axis=1)])
    key = ends.min(axis=0) * len(vertex) * facets.width + ends.max(axis=0)
    real = ends[0] != ends[1]  # a padded triangle has an edge of no length
    _, edge, count = np.unique(key[real], return_inverse=True, return_counts=True)
    interior_edge = np.zeros(vertex.shape, dtype=bool)
    interior_edge[real] = count[edge] >= 2
    on_boundary = np.zeros(averaging.shape[0], dtype=bool)
    on_boundary[ends[:, real & ~interior_edge]] = True
    return Topology(interior_edge, ~on_boundary[vertex], vertex, averaging)


def geometry(facets: Facets, positions: FloatArray) -> FacetGeometry:
    """Centres, normals and sizes of the facets for node positions (nodes, d) [m]; InputError on a facet without area.

    The normal in space is that of half the cross product of the diagonals: the exact mean normal of a bilinear facet; a triangle's last
    corner is its first.
    """
    if positions.shape[1] == 3:
        corners, centre, radius, normal, measure = facets_in_space(facets.closed, positions)
    else:
        corners = positions[facets.closed]
        centre = np.einsum("nkd->nd", corners) / facets.width
        arm = corners - centre[:, None]
        radius = np.sqrt(reduce(np.maximum, np.einsum("nkd,nkd->kn", arm, arm)))
        tangent = corners[:, 1] - corners[:, 0]
        area = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
        measure = np.sqrt(np.einsum("nd,nd->n", area, area))
        normal = area / np.where(measure > 0, measure, 1.0)[:, None]
    return _checked(facets, corners, centre, radius, normal, measure)


def geometry_by_ranks(facets: Facets, positions: FloatArray) -> FacetGeometry:
    """As `geometry`, in space, each rank of some facets; all ranks must ask."""
    n, k = facets.closed.shape
    arrays = [for_parts((n, *more), 0) for more in ((k, 3), (3,), (), (3,), ())]

    def write(begin: int, end: int) -> None:
        write_facets(facets.closed[begin:end], positions, *(array[begin:end] for array in arrays))

    in_parts("facets", n, 0, write, *arrays)
    return _checked(facets, *arrays)


def _checked(
    facets: Facets, corners: FloatArray, centre: FloatArray, radius: FloatArray, normal: FloatArray, measure: FloatArray
) -> FacetGeometry:
    """The geometry; InputError on a facet whose measure is 0."""
    if not (measure > 0).all():
        bad = int(np.argmin(measure > 0))
        raise InputError(f"contact detection: expected facets of positive area, got area 0 at nodes {facets.nodes[bad].tolist()}")
    return FacetGeometry(corners, centre, radius, normal, measure if facets.width == 2 else np.sqrt(measure))


def corner_vectors(here: FacetGeometry, facet: IntArray) -> tuple[BoolArray, FloatArray]:
    """Which of facets (n,) are twisted quadrilaterals, and vectors (n, k, d) at their corners whose interpolation is along the normal.

    On a bilinear facet x,s x x,t is linear in s and t: sum_k phi_k c_k with the cross products c_k of both edges at each corner, over the
    area. Of all other facets c_k is the normal; where none is twisted there are no vectors.
    """
    if here.corners.shape[1] < 4:
        return np.zeros(len(facet), dtype=bool), here.corners[:0]
    off = np.einsum("nd,nd->n", here.corners[facet, 0] - here.centre[facet], here.normal[facet])
    twisted = np.abs(off) > _TWIST * here.size[facet]
    if not twisted.any():
        return twisted, here.corners[:0]
    corners = here.corners[facet]
    twisted &= (corners[:, 3] != corners[:, 0]).any(axis=1)
    vectors = np.repeat(here.normal[facet, None], corners.shape[1], axis=1)
    own = corners[twisted]
    crossed = np.cross(np.roll(own, -1, axis=1) - own, np.roll(own, 1, axis=1) - own)
    vectors[twisted] = crossed / here.size[facet[twisted], None, None] ** 2
    return twisted, vectors


def mean_normals(topology: Topology, here: FacetGeometry) -> FloatArray:
    """Means (nv, d) of the unit normals that the facets around each vertex have there, not of length 1."""
    nodal = topology.averaging @ here.normal
    twisted, vectors = corner_vectors(here, np.arange(len(here.normal)))
    if twisted.any():
        unit = vectors / np.maximum(np.sqrt(np.einsum("nkd,nkd->nk", vectors, vectors)), 1e-300)[:, :, None]
        off, vertex = (unit - here.normal[:, None])[twisted], topology.vertex[twisted].ravel()
        sums = [np.bincount(vertex, part.ravel(), len(nodal)) for part in np.moveaxis(off, 2, 0)]
        nodal += np.stack(sums, axis=1) / np.diff(topology.averaging.indptr)[:, None]
    return nodal


def shape_gradients(phi: FloatArray) -> tuple[FloatArray, FloatArray]:
    """phi_k,a (n, k, d-1) and phi_k,ab (k, d-1, d-1) of shape functions phi (n, k) of a segment, triangle or quadrilateral."""
    n, k = phi.shape
    if k == 4:
        s, t = (phi[:, pair].sum(axis=1) for pair in ([1, 2], [2, 3]))
        first = np.stack([np.stack([t - 1, 1 - t, t, -t], axis=1), np.stack([s - 1, -s, s, 1 - s], axis=1)], axis=2)
        mixed = np.array([1.0, -1.0, 1.0, -1.0])
        return first, mixed[:, None, None] * np.array([[0.0, 1.0], [1.0, 0.0]])
    constant = np.vstack([-np.ones(k - 1), np.eye(k - 1)])
    return np.broadcast_to(constant, (n, k, k - 1)), np.zeros((k, k - 1, k - 1))
