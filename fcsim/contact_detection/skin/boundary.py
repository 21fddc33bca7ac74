"""The boundary facets of a model's bodies, whatever their surfaces are called."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import IntArray
from fcsim.assembly.model import Model
from fcsim.errors import InputError
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.order.linear_facets import linear_facets
from fcsim.mesh.part import Body, Part, RigidBody


class Boundary(NamedTuple):
    """Facets (nf, 4) of all bodies in global node numbers, -1 = none, sorted by body (nf,); number of corners, sides (nf,)."""

    facets: IntArray
    body: IntArray
    sides: IntArray


def boundary_of(model: Model) -> Boundary:
    """Return the facets that bound the cells of deformable bodies, and the surfaces of rigid ones, each facet once.

    Points of a rigid body that coincide exactly (a surface read triangle by triangle) count as one. InputError: a rigid body without
    surfaces.
    """
    return _boundary(model, model.bodies)


def boundary_of_meshed(model: Model) -> Boundary:
    """The same of all bodies that have facets, those of exact shape have none; as many places a facet as corners, 2 in 2D."""
    found = _boundary(model, [body for body in model.bodies if isinstance(body, Body) or body.surfaces])
    return found._replace(facets=found.facets[:, : 2 if model.dimension == 2 else 4])


def joined_by_facets(model: Model, nodes: IntArray) -> sp.csr_array:
    """Return (n_nodes, n_nodes) which of the nodes lie on the boundary of a deformable body and share a facet; each does with itself."""
    facets = _boundary(model, model.deformable).facets
    there = (facets >= 0) & np.isin(facets, nodes)
    row = np.broadcast_to(np.arange(len(facets))[:, None], facets.shape)[there]
    of_facet = sp.csr_array((np.ones(len(row)), (row, facets[there])), shape=(len(facets), model.n_nodes))
    return sp.csr_array(of_facet.T @ of_facet)


def _boundary(model: Model, bodies: Sequence[Body | RigidBody]) -> Boundary:
    """The facets of some of the model's bodies, in their order."""
    known: dict[Part, IntArray] = {}
    numbers = np.array([model.number[body.name] for body in bodies], dtype=np.int64)
    found = [np.empty((0, 4), dtype=np.int64)]
    for number, body in zip(numbers.tolist(), bodies, strict=True):
        if isinstance(body, Body):
            if body.part not in known:
                known[body.part] = _of_cells(body.part)
            facets = known[body.part]
        else:
            facets = _of_surfaces(body)
        wide = np.pad(facets, ((0, 0), (0, 4 - facets.shape[1])), constant_values=-1)
        found.append(np.where(wide < 0, -1, wide + model.node_offset[number]))
    facets = np.concatenate(found)
    body_of_facet = np.repeat(numbers, [len(f) for f in found[1:]])
    return Boundary(facets, body_of_facet, (facets >= 0).sum(axis=1))


def _of_cells(part: Part) -> IntArray:
    """Facets of the cells that no second cell has; those of second order cut at their nodes."""
    cell = CELL_TYPES[part.cell_type]
    facets = part.cells[:, cell.facets].reshape(-1, cell.facet_size)
    _, first, count = np.unique(np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True)
    return linear_facets(facets[np.sort(first[count == 1])], cell)


def _of_surfaces(body: RigidBody) -> IntArray:
    """Facets of all surfaces, in the numbers of the first of coincident points; a quadrilateral with two equal corners is a triangle."""
    pieces = [facets for facets in body.surfaces.values() if facets.size]
    if not pieces:
        hint = "" if body.shape is None else ": bodies of exact shape take ExactContacts instead of Everything"
        raise InputError(f"contact of everything, body {body.name!r}: expected a rigid body with surfaces, got none{hint}")
    width = max(piece.shape[1] for piece in pieces)
    if width > 4:
        raise InputError(f"contact of everything, body {body.name!r}: expected facets of 2, 3 or 4 nodes, got {width}")
    facets = np.concatenate([np.pad(piece, ((0, 0), (0, width - piece.shape[1])), constant_values=-1) for piece in pieces])
    _, first, place = np.unique(body.points, axis=0, return_index=True, return_inverse=True)
    facets = np.where(facets < 0, -1, first[place.ravel()][facets])
    if width == 4:
        facets = _without_repeated_corner(facets)
    _, first = np.unique(np.sort(facets, axis=1), axis=0, return_index=True)
    return facets[np.sort(first)]


def _without_repeated_corner(facets: IntArray) -> IntArray:
    """Quadrilaterals with two neighbouring corners in one point as triangles."""
    repeated = (facets == np.roll(facets, -1, axis=1)) & (facets >= 0)
    rows = np.flatnonzero(repeated.any(axis=1))
    result = facets.copy()
    for row, corner in zip(rows, np.argmax(repeated[rows], axis=1), strict=True):  # few: the poles of a sphere
        result[row] = np.append(np.delete(facets[row], corner), -1)
    return result
