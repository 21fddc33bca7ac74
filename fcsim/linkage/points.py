"""Places on bodies as weights of nodes: how a point moves that is no node."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.errors import InputError
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.part import Body

_NEAREST = 64  # cells whose centres are nearest to the place
_ROUND = 1e-6  # of a reference cell: as far out a place still counts as in it
_NEWTON = 30


def weights_at(model: Model, body: str, place: FloatArray, what: str) -> tuple[IntArray, FloatArray]:
    """Nodes (k,) of the model and their weights (k,), of sum 1, for the point of a body that stands at `place` (d,) in the reference.

    InputError (`what` names the link) where a deformable body has no cell there, or a rigid one too few points.
    """
    number = model.body_number(body)
    owner, first = model.bodies[number], int(model.node_offset[number])
    if isinstance(owner, Body):
        nodes, weights = _in_cell(owner, place, what)
    else:
        points = owner.points - place
        scale = float(np.abs(points).max(initial=0.0)) or 1.0
        A = np.vstack([points.T / scale, np.ones(len(points))])
        weights = np.linalg.lstsq(A, np.append(np.zeros(len(place)), 1.0), rcond=None)[0]
        if np.abs(A @ weights - np.append(np.zeros(len(place)), 1.0)).max(initial=0.0) > 1e-9:
            raise InputError(
                f"{what}: expected a place in the plane of the points of the rigid body {body!r}, which lie in one, got {place.tolist()}"
            )
        nodes = np.arange(len(points))
    used = np.abs(weights) > 1e-14
    return first + nodes[used], weights[used]


def nodes_around(model: Model, body: str, place: FloatArray, what: str) -> IntArray:
    """Nodes (k,) of the model in the cell of a deformable body that holds `place` (d,)."""
    number = model.body_number(body)
    owner = model.bodies[number]
    assert isinstance(owner, Body)
    return np.asarray(model.node_offset[number] + _in_cell(owner, place, what)[0], dtype=np.int64)


def _in_cell(body: Body, place: FloatArray, what: str) -> tuple[IntArray, FloatArray]:
    """Nodes and shape functions of the cell that holds the place."""
    part, cell = body.part, CELL_TYPES[body.part.cell_type]
    own = body.rotation.T @ (place - body.translation)
    centres = part.points[part.cells[:, : cell.corners]].mean(axis=1)
    count = min(_NEAREST, len(centres))
    chosen = np.atleast_1d(cKDTree(centres).query(own, k=count)[1])
    nodes = part.points[part.cells[chosen]] - own
    at = np.repeat(cell.centre, count, axis=0)
    for _ in range(_NEWTON):
        r = np.einsum("ca,cai->ci", cell.shape(at), nodes)
        J = np.einsum("cai,caj->cij", nodes, cell.gradient(at))
        at = np.clip(at - np.linalg.solve(J, r[:, :, None])[:, :, 0], -3.0, 3.0)
    shape = cell.shape(at)
    off = np.linalg.norm(np.einsum("ca,cai->ci", shape, nodes), axis=1) / np.ptp(nodes, axis=1).max(axis=1)
    low, high = (at.min(axis=1), at.sum(axis=1)) if cell.simplex else (1 + at.min(axis=1), at.max(axis=1))
    outside = np.where(off < 1e-9, np.maximum(-low, high - 1), np.inf)
    best = int(np.argmin(outside))
    if not outside[best] <= _ROUND:
        nearest = part.points[np.argmin(np.linalg.norm(part.points - own, axis=1))]
        there = (body.rotation @ nearest + body.translation).tolist()
        raise InputError(f"{what}: expected a place in the body {body.name!r}, got {place.tolist()}; its nearest node is at {there}")
    return part.cells[chosen[best]], shape[best]
