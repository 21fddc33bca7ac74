"""The contact matrix H from nodes, weights and frames; it never knows how a contact was found."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_array

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model
from fcsim.contact_detection._contact_matrix_kernels import fill_contact_matrix, fill_on_bodies, starts_of_columns, starts_on_bodies
from fcsim.contact_detection.contacts import Contacts
from fcsim.errors import InputError
from fcsim.ranks import common_arrays, written

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


def contact_matrix_of_bodies(contacts: Contacts, model: Model, x: FloatArray) -> csc_array:
    """H (n_dofs, d nc) in the configuration x (n_dofs,): as `Model.contact_matrix` makes it of `contact_matrix`, in one pass;
    all ranks must ask."""
    d, rigid = contacts.dimension, model.rigid_bodies
    elastic = model.n_elastic // d
    body, arm = rigid.points(model.rigid_part(x))
    starts, largest = starts_on_bodies(contacts.nodes, contacts.weights, d, elastic, body, rigid.size)
    _refuse_beyond(largest, model.n_nodes)
    size = int(starts[-1])
    index = np.int32 if max(d * model.n_nodes, d * len(contacts), size) < np.iinfo(np.int32).max else np.int64
    indptr = starts.astype(index)
    shared = common_arrays(len(contacts), SHARED_FROM, ((size,), np.float64), ((size,), index))
    data, rows = shared or (np.empty(size), np.empty(size, dtype=index))

    def fill(begin: int, end: int) -> None:
        some, columns = slice(begin, end), indptr[d * begin : d * end + 1]
        of_contacts = contacts.nodes[some], contacts.weights[some], contacts.frame[some]
        fill_on_bodies(*of_contacts, elastic, body, arm, rigid.size, columns, rows, data)

    if shared:
        written("H", len(contacts), fill)
    else:
        fill(0, len(contacts))
    matrix = csc_array((data, rows, indptr), shape=(model.n_dofs, d * len(contacts)))
    matrix.has_canonical_format = True
    return matrix


def _refuse_beyond(largest: int, n_nodes: int) -> None:
    """InputError where a node number is not below n_nodes."""
    if largest >= n_nodes:
        raise InputError(f"contact_matrix: expected node numbers below n_nodes = {n_nodes}, got {largest}")
