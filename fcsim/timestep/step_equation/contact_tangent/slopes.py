"""Derivatives of contact by moving its nodes: of rules whose normals are interpolated, averaged or turn about an edge.

The forces H r of given reactions and the gaps are differenced, the frames carried along without a spin about the normal. A contact depends
on its own nodes and on those of the master's facets beside its own, as normals and overlaps do; nodes that no contact depends on together
are moved at once. So a derivative costs d detections a colour, some tens in the plane and a hundred in space, on surfaces of any size.
Contacts that a moved node makes or ends have none.

Source of the colouring: A. R. Curtis, M. J. D. Powell, J. K. Reid, On the estimation of sparse Jacobian matrices, J. Inst. Maths Applics
13, 1974.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.contacts import Contacts

STEP = 1e-7
"""Of the shortest distance between two nodes of a contact: how far nodes are moved."""


MOST = 120
"""Detections that a derivative may cost."""


def contact_slopes(
    detect: Callable[[FloatArray], Contacts],
    contacts: Contacts,
    force: FloatArray,
    motion: FloatArray,
    joined: sp.csr_array,
    positions: FloatArray,
) -> tuple[sp.csr_array, sp.csr_array] | None:
    """Return B = -d(H r)/dx (d n_nodes, d n_nodes) and E (d n_nodes, d nc), the derivative of gaps beyond N . weights and that of the slips
    T . weights . motion by the change of frames and weights alone.

    detect: the detection at positions (n_nodes, d) [m]; contacts: chosen ones of what it finds there; force (nc, d) [N]: what acts on the
    slave, in world axes; motion (n_nodes, d) [m]: of the nodes, whose slip the law means; joined (n_nodes, n_nodes): which nodes
    share a facet, see `joined_by_facets`. Nodes of rigid bodies, which do not move one by one, are left out. None where it would take more
    than `MOST` detections.
    """
    d, n = contacts.dimension, len(positions)
    depends = _dependence(contacts, joined)
    colour = _colours(depends)
    if d * (int(colour.max(initial=-1)) + 1) > MOST:
        return None
    touched = np.flatnonzero(colour >= 0)
    e = STEP * _spacing(contacts, positions)
    B, E, each = _Entries(), _Entries(), np.arange(len(contacts))
    start = _motion(contacts, contacts, motion)
    for number in range(int(colour.max(initial=-1)) + 1):
        moved = touched[colour[touched] == number]
        mover = _movers(depends, moved, len(contacts))
        for axis in range(d):
            x = positions.copy()
            x[moved, axis] += e
            now, there = _same(detect(x), contacts)
            seen = (mover >= 0) & there
            if not seen.any():
                continue
            B.add(now, -_carried(force, contacts, now) / e, d * mover + axis, seen)
            B.add(contacts, force / e, d * mover + axis, seen)
            slopes = (_motion(now, contacts, motion) - start) / e
            for row in range(d):
                E.plain(d * mover + axis, d * each + row, slopes[:, row], seen)
    N = contacts.frame[:, 0]
    movable = joined.diagonal() > 0
    for k in range(contacts.nodes.shape[1]):
        real = (contacts.nodes[:, k] >= 0) & movable[contacts.nodes[:, k]]
        for axis in range(d):
            E.plain(d * contacts.nodes[:, k] + axis, d * each, -contacts.weights[:, k] * N[:, axis], real)
    return B.matrix((d * n, d * n)), E.matrix((d * n, d * len(contacts)))


def _same(found: Contacts, contacts: Contacts) -> tuple[Contacts, BoolArray]:
    """The contacts as they are found now, and which of them are."""
    if not len(found):
        return contacts, np.zeros(len(contacts), dtype=bool)
    place = np.searchsorted(found.identity, contacts.identity).clip(max=len(found) - 1)
    return found.take(place), found.identity[place] == contacts.identity


def _carried(force: FloatArray, contacts: Contacts, now: Contacts) -> FloatArray:
    """The force (nc, d) with its share along N along the normal now, its share across N turned with it."""
    N, M = contacts.frame[:, 0], now.frame[:, 0]
    r_n = np.einsum("ad,ad->a", force, N)[:, None]
    tangential = force - r_n * N
    return r_n * M + tangential - np.einsum("ad,ad->a", tangential, M)[:, None] * M


def _motion(now: Contacts, contacts: Contacts, motion: FloatArray) -> FloatArray:
    """(nc, d): the gap now, and the slips along the tangents turned with the normal."""
    N, T, M = contacts.frame[:, 0], contacts.frame[:, 1:], now.frame[:, 0]
    slip = np.einsum("ak,akd->ad", np.where(now.nodes >= 0, now.weights, 0.0), motion[now.nodes])
    along = np.einsum("abd,ad->ab", T, slip) - np.einsum("abd,ad->ab", T, M) * np.einsum("ad,ad->a", N, slip)[:, None]
    return np.concatenate([now.gap[:, None], along], axis=1)


class _Entries:
    """Entries of a sparse matrix as they come."""

    def __init__(self) -> None:
        self._rows: list[IntArray] = []
        self._columns: list[IntArray] = []
        self._values: list[FloatArray] = []

    def plain(self, rows: IntArray, columns: IntArray, values: FloatArray, chosen: BoolArray) -> None:
        self._rows.append(rows[chosen])
        self._columns.append(columns[chosen])
        self._values.append(values[chosen])

    def add(self, contacts: Contacts, force: FloatArray, column: IntArray, chosen: BoolArray) -> None:
        """weights times force (nc, d) on the contacts' nodes, in each one's column (nc,)."""
        d = contacts.dimension
        nodes = contacts.nodes
        real = (nodes >= 0) & chosen[:, None]
        values = contacts.weights[:, :, None] * force[:, None]
        rows = d * nodes[:, :, None] + np.arange(d)
        columns = np.broadcast_to(column[:, None, None], rows.shape)
        self.plain(rows[real].ravel(), columns[real].ravel(), values[real].ravel(), np.ones(values[real].size, dtype=bool))

    def matrix(self, shape: tuple[int, int]) -> sp.csr_array:
        rows, columns, values = (np.concatenate(part) if part else np.empty(0) for part in (self._rows, self._columns, self._values))
        return sp.csr_array((values, (rows.astype(np.int64), columns.astype(np.int64))), shape=shape)


def _dependence(contacts: Contacts, joined: sp.csr_array) -> sp.csr_array:
    """(nc, n_nodes) which of the nodes a contact may depend on: of its own those that move one by one, and what shares a facet with those
    of its master."""
    real = contacts.nodes >= 0
    row = np.broadcast_to(np.arange(len(contacts))[:, None], real.shape)
    shape = (len(contacts), joined.shape[0])

    def named(chosen: BoolArray) -> sp.csr_array:
        return sp.csr_array((np.ones(int(chosen.sum())), (row[chosen], contacts.nodes[chosen])), shape=shape)

    movable = sp.diags_array((joined.diagonal() > 0).astype(float))
    return sp.csr_array(named(real & (contacts.weights <= 0)) @ joined + named(real) @ movable)


def _colours(depends: sp.csr_array) -> IntArray:
    """Colours (n,) of the nodes, -1 where nothing depends on them: no contact depends on two of one colour."""
    columns = sp.csc_array(depends)
    colour = np.full(depends.shape[1], -1)
    taken: list[BoolArray] = []
    for node in np.flatnonzero(np.diff(columns.indptr)):
        of = columns.indices[columns.indptr[node] : columns.indptr[node + 1]]
        number = next((k for k, mask in enumerate(taken) if not mask[of].any()), len(taken))
        if number == len(taken):
            taken.append(np.zeros(depends.shape[0], dtype=bool))
        taken[number][of] = True
        colour[node] = number
    return colour


def _movers(depends: sp.csr_array, moved: IntArray, nc: int) -> IntArray:
    """The one of the moved nodes (nc,) that each contact depends on, -1 = none."""
    own = sp.coo_array(depends[:, moved])
    mover = np.full(nc, -1)
    mover[own.row] = moved[own.col]
    return mover


def _spacing(contacts: Contacts, positions: FloatArray) -> float:
    """The shortest side [m] of the boxes around the master's nodes of each contact that are not points."""
    real = (contacts.nodes >= 0) & (contacts.weights <= 0)
    low = np.where(real[:, :, None], positions[contacts.nodes], np.inf).min(axis=1)
    high = np.where(real[:, :, None], positions[contacts.nodes], -np.inf).max(axis=1)
    size = np.linalg.norm(np.maximum(high - low, 0.0), axis=1)
    sizes = size[size > 0]
    return float(sizes.min()) if len(sizes) else float(np.ptp(positions, axis=0).max())
