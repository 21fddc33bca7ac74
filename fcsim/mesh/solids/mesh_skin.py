"""The skin of a mesh of solid cells: what bounds it as a closed surface of few polygons, and the pieces that hang together by facets.

What is flat becomes one face, however finely it is meshed, and corners are left where faces bend or meet: blocks that were meshed touch as
the blocks themselves do. A face of several outlines (with a hole, or that meets itself at a corner) keeps its facets.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.brief import brief
from fcsim.errors import InputError
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.order.linear_facets import linear_facets
from fcsim.mesh.quality import ROUND_OFF, check_quality
from fcsim.mesh.solids.closed_surface import FLAT, ClosedSurface, closed_surface

_STRAIGHT = 1e-5
"""Sine of the angle below which two edges are one, and two facets one face if that is plane to half of `FLAT`: of files in float32."""
_MOST_CORNERS = 100
"""Of an outline; longer ones keep their facets, since polygons are cut into triangles in cubic time."""


@dataclass(frozen=True, eq=False)
class Cells:
    """A piece of a mesh: points (n, 3) [m] and cells (nc, k) of one type of `CELL_TYPES`, of positive Jacobian, that use all of them."""

    name: str
    points: FloatArray
    cells: IntArray
    cell_type: str

    __repr__ = brief


def pieces_of(name: str, points: FloatArray, cells: IntArray, cell_type: str) -> tuple[Cells, ...]:
    """Return the pieces of cells that are connected by facets: one of this name, or NAME.1, NAME.2, ... by their first cells."""
    kind = CELL_TYPES[cell_type]
    facets = np.sort(cells[:, kind.facets].reshape(-1, kind.facet_size), axis=1)
    numbers = np.unique(facets, axis=0, return_inverse=True)[1].reshape(-1)
    owner = np.repeat(np.arange(len(cells)), len(kind.facets))
    graph = sp.coo_array((np.ones(len(owner)), (owner, numbers)), shape=(len(cells), numbers.max(initial=-1) + 1)).tocsr()
    count, piece = connected_components(graph @ graph.T, directed=False)
    found = []
    for k in range(count):
        used, own = np.unique(cells[piece == k], return_inverse=True)
        found.append(Cells(name if count == 1 else f"{name}.{k + 1}", points[used], own.reshape(-1, cells.shape[1]), cell_type))
    return tuple(found)


def outer_facets(mesh: Cells) -> IntArray:
    """Facets (nf, kf) that belong to one cell alone, outwards."""
    kind = CELL_TYPES[mesh.cell_type]
    facets = mesh.cells[:, kind.facets].reshape(-1, kind.facet_size)
    _, first, count = np.unique(np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True)
    if (count > 2).any():
        raise InputError(f"mesh of {mesh.name!r}: expected facets of one or two cells, got {int((count > 2).sum())} of more")
    return facets[np.sort(first[count == 1])]


def skin_of(mesh: Cells) -> ClosedSurface:
    """Return the surface of a piece, flat facets joined; InputError for inverted and collapsed cells and for skins that are no surface.

    Curved facets of second order become the triangles or quadrilaterals between their nodes.
    """
    check_quality(mesh, ROUND_OFF)
    facets = _flat(mesh.points, linear_facets(outer_facets(mesh), CELL_TYPES[mesh.cell_type]))
    corners = (facets >= 0).sum(axis=1)
    face = _faces(mesh.points, facets)
    outlines, kept = _outlines(mesh.points, facets, face)
    polygons: list[tuple[int, ...]] = []
    for number in range(face.max() + 1):
        left = [node for node in outlines.get(number, ()) if kept[node]]
        if len(left) > 2:
            polygons.append(tuple(left))
        else:
            polygons += [tuple(facets[k, : corners[k]].tolist()) for k in np.flatnonzero(face == number)]
    return closed_surface(mesh.name, mesh.points, polygons)


def _flat(points: FloatArray, facets: IntArray) -> IntArray:
    """The facets (nf, 4), -1: none; quadrilaterals that are bent as two triangles, cut from their least node, on both sides alike."""
    if facets.shape[1] == 3:
        return np.pad(facets, ((0, 0), (0, 1)), constant_values=-1)
    least = np.argmin(facets, axis=1)
    facets = np.take_along_axis(facets, (least[:, None] + np.arange(4)) % 4, axis=1)
    p = points[facets] - points[facets].mean(axis=1, keepdims=True)
    normal = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    bent = np.abs(np.einsum("fkd,fd->fk", p, normal)).max(axis=1) > 0.1 * FLAT * np.abs(p).max(axis=(1, 2))
    halves = np.concatenate([facets[bent][:, [0, 1, 2]], facets[bent][:, [0, 2, 3]]])
    return np.concatenate([facets[~bent], np.pad(halves, ((0, 0), (0, 1)), constant_values=-1)])


def _edges(facets: IntArray) -> tuple[IntArray, IntArray]:
    """Directed edges (ne, 2) and the facets (ne,) that they belong to, those of a facet in turn."""
    corners = (facets >= 0).sum(axis=1)
    following = np.where(np.arange(4) + 1 == corners[:, None], facets[:, :1], np.roll(facets, -1, axis=1))
    there = facets >= 0
    return np.stack([facets[there], following[there]], axis=1), np.nonzero(there)[0]


def _faces(points: FloatArray, facets: IntArray) -> IntArray:
    """The number (nf,) of each facet's face: neighbours that lie in one plane."""
    third = facets[np.arange(len(facets)), (facets >= 0).sum(axis=1) - 1]  # the last corner; the diagonals of a quadrilateral
    normal = np.cross(points[facets[:, 2]] - points[facets[:, 0]], points[third] - points[facets[:, 1]])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    edges, owner = _edges(facets)
    _, edge, uses = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(edge.reshape(-1), kind="stable")
    first = (np.cumsum(uses) - uses)[uses == 2]  # an edge of more facets stays a rim: `closed_surface` refuses it
    a, b = owner[order[first]], owner[order[first + 1]]
    level = (np.linalg.norm(np.cross(normal[a], normal[b]), axis=1) < _STRAIGHT) & (np.vecdot(normal[a], normal[b]) > 0)
    graph = sp.coo_array((np.ones(int(level.sum())), (a[level], b[level])), shape=(len(facets), len(facets)))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _outlines(points: FloatArray, facets: IntArray, face: IntArray) -> tuple[dict[int, list[int]], BoolArray]:
    """The nodes around each face of one outline, and which nodes (n,) are corners: all of those of other faces, where three faces meet,
    where an outline turns."""
    edges, owner = _edges(facets)
    of = face[owner]
    _, edge = np.unique(np.column_stack([np.sort(edges, axis=1), of]), axis=0, return_inverse=True)
    rim = np.bincount(edge.reshape(-1))[edge.reshape(-1)] == 1  # one facet of this face alone has it
    edges, of = edges[rim], of[rim]
    kept = np.zeros(len(points), dtype=bool)
    outlines: dict[int, list[int]] = {}
    faces_at = np.bincount(np.unique(np.column_stack([edges[:, 0], of]), axis=0)[:, 0], minlength=len(points))
    kept[np.flatnonzero(faces_at > 2)] = True
    order = np.argsort(of, kind="stable")
    for number, own in zip(np.unique(of).tolist(), np.split(order, np.flatnonzero(np.diff(of[order])) + 1), strict=True):
        loop = _around(edges[own])
        place = points[loop]
        if not _plane(place):
            kept[facets[face == number]] = True  # -1 too, which is the last node: kept for nothing at worst
            continue
        ahead, behind = np.roll(place, -1, axis=0) - place, place - np.roll(place, 1, axis=0)
        lengths = np.linalg.norm(ahead, axis=1) * np.linalg.norm(behind, axis=1)
        turns = np.linalg.norm(np.cross(behind, ahead), axis=1) > _STRAIGHT * lengths
        kept[np.array(loop)[turns]] = True
        if np.count_nonzero(kept[loop]) <= _MOST_CORNERS:
            outlines[number] = loop
        else:
            kept[facets[face == number]] = True
    return outlines, kept


def _around(edges: IntArray) -> list[int]:
    """The nodes of directed edges one after the other, where they are one loop that passes no node twice; none otherwise."""
    following = dict(edges.tolist())
    loop = [int(edges[0, 0])]
    while len(loop) <= len(edges) and following.get(loop[-1], loop[0]) != loop[0]:
        loop.append(following[loop[-1]])
    return loop if len(loop) == len(edges) == len(following) else []


def _plane(place: FloatArray) -> bool:
    """Whether the corners (n, 3) of an outline lie in a plane as `closed_surface` asks, twice as well."""
    if not len(place):
        return False
    p = place - place.mean(axis=0)
    normal = np.cross(p, np.roll(p, -1, axis=0)).sum(axis=0)
    normal /= max(float(np.linalg.norm(normal)), 1e-300)
    return float(np.abs(p @ normal).max()) <= 0.5 * FLAT * float(np.abs(p).max())
