"""The contact matrix H from nodes, weights and frames; it never knows how a contact was found."""

from __future__ import annotations

from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.contact_detection._contact_matrix_kernels import (
    fill_contact_matrix,
    fill_on_bodies,
    of_same_nodes,
    starts_of_columns,
    starts_on_bodies,
)
from fcsim.contact_detection.contacts import Contacts
from fcsim.errors import InputError
from fcsim.ranks import common_arrays, kept_alike, written

IndexArray = NDArray[np.int32] | NDArray[np.int64]

SHARED_FROM = 3000
"""Contacts from which ranks make H together, where they have memory in common: of as many it takes half a millisecond."""


def contact_matrix(contacts: Contacts, n_nodes: int) -> csc_array:
    """Nodal contact matrix H (d n_nodes, d nc): u = H^T v [m/s] from nodal velocities v, nodal impulses H r [N s] from r.

    Row d j + i is component i of node j, column d a + c is axis c (N, T1[, T2]) of contact a:

        H[d j + i, d a + c] = weights[a, k] frame[a, c, i]    where nodes[a, k] = j

    so u is the velocity of the slave relative to the master in the local frame. Nodes of weight 0 are left out; row numbers are sorted.
    InputError where a node number is not below n_nodes.
    """
    nc, d = len(contacts), contacts.dimension
    starts, largest = starts_of_columns(contacts.nodes, contacts.weights, d)
    _refuse_beyond(largest, n_nodes)
    size = int(starts[-1])
    index = np.int32 if max(d * n_nodes, d * nc, size) < np.iinfo(np.int32).max else np.int64
    indptr = starts.astype(index)
    data, rows = np.empty(size), np.empty(size, dtype=index)
    fill_contact_matrix(contacts.nodes, contacts.weights, contacts.frame, indptr, rows, data)
    matrix = csc_array((data, rows, indptr), shape=(d * n_nodes, d * nc))
    matrix.has_canonical_format = True
    return matrix


class _Pattern(NamedTuple):
    """Where H has entries: indptr, rows; nodes (nc, k) of the contacts, and which of them count, `used` (nc, k)."""

    nodes: IntArray
    used: BoolArray
    indptr: IndexArray
    rows: IndexArray

    def serves(self, contacts: Contacts) -> bool:
        """Whether H of these contacts has the same."""
        same = contacts.nodes.shape == self.nodes.shape
        return same and bool(of_same_nodes(contacts.nodes, contacts.weights, self.nodes, self.used))


_patterns: WeakKeyDictionary[Model, _Pattern] = WeakKeyDictionary()
"""The last one of each model: from most steps to the next contacts are on the same nodes, and who keeps something by H's pattern knows it
by its arrays."""


def contact_matrix_of_bodies(contacts: Contacts, model: Model, x: FloatArray) -> csc_array:
    """H (n_dofs, d nc) in the configuration x (n_dofs,): as `Model.contact_matrix` makes it of `contact_matrix`, in one pass;
    all ranks must ask. indices and indptr are the very arrays of the model's last H where they have not changed."""
    d, rigid, nc = contacts.dimension, model.rigid_bodies, len(contacts)
    elastic = model.n_elastic // d
    body, arm = rigid.points(model.rigid_part(x))
    last = _patterns.get(model) if kept_alike() else None
    if last is not None and not last.serves(contacts):
        last = None
    if last is None:
        starts, largest = starts_on_bodies(contacts.nodes, contacts.weights, d, elastic, body, rigid.size)
        _refuse_beyond(largest, model.n_nodes)
        index = np.int32 if max(d * model.n_nodes, d * nc, int(starts[-1])) < np.iinfo(np.int32).max else np.int64
        indptr = starts.astype(index)
    else:
        indptr, index = last.indptr, last.indptr.dtype.type
    size = int(indptr[-1])
    wanted = ((size,), np.float64), ((size if last is None else 0,), index)
    shared = common_arrays(nc, SHARED_FROM, *wanted[: 1 + (last is None)])
    data, rows = shared[0] if shared else np.empty(size), shared[-1] if shared and last is None else np.empty(*wanted[1])

    def fill(begin: int, end: int) -> None:
        some, columns = slice(begin, end), indptr[d * begin : d * end + 1]
        of_contacts = contacts.nodes[some], contacts.weights[some], contacts.frame[some]
        fill_on_bodies(*of_contacts, elastic, body, arm, rigid.size, columns, rows, data)

    if shared:
        written("H", nc, fill)
    else:
        fill(0, nc)
    rows = rows if last is None else last.rows
    if last is None and kept_alike():
        _patterns[model] = _Pattern(contacts.nodes.copy(), contacts.weights != 0, indptr, rows)
    matrix = csc_array((data, rows, indptr), shape=(model.n_dofs, d * nc))
    matrix.has_canonical_format = True
    return matrix


def _refuse_beyond(largest: int, n_nodes: int) -> None:
    """InputError where a node number is not below n_nodes."""
    if largest >= n_nodes:
        raise InputError(f"contact_matrix: expected node numbers below n_nodes = {n_nodes}, got {largest}")
