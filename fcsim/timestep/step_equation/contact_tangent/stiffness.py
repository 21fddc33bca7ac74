"""The geometric stiffness of contact: how the forces H r of given reactions turn and wander when the bodies move.

A slave point x_s = sum a_i x_i stands on a facet x_m(xi) = sum phi_k(xi) x_k with tangents t_b and the normal N; p = N r_N + p_T is what
acts on it, a_i p on its nodes and -phi_k p on the facet's. With m_ab = t_a . t_b - g N . t_ab the foot and the normal move by

    m dxi = t_a . (dx_s - phi_k dx_k) + g N . phi_k,a dx_k                                                                      (1)
    dN = -t^a (N . (phi_k,a dx_k + t_ab dxi_b)),   dp = r_N dN - (p_T . dN) N                                                   (2)

the tangents without a spin about N, so that

    -d(H r) = -a_i dp on the slave's nodes,  phi_k dp + phi_k,a dxi_a p on the facet's                                           (3)

It is symmetric without friction, and with friction not. It is exact for points on segments, triangles and bilinear quadrilaterals with
these facets' own normals. Other contacts have none by these formulas: mortar, edges across edges, vertices, and interpolated normals,
which are not the gradient of their gap, so that a stiffness alone does not do (`slopes`, `leaning`).

Source: P. Wriggers, Computational Contact Mechanics, 2nd ed., Springer, 2006, chapter 9 (node to segment).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.surfaces.facets import shape_gradients

_ASIDE = 1e-6
"""A normal that leans by more (radians) towards the facet is not the facet's own."""

_ROUND = 1e-6


def contact_stiffness(model: Model, contacts: Contacts, r: FloatArray, x: FloatArray) -> sp.csr_array | None:
    """Return -d(H r)/dx (n_dofs, n_dofs), sparse, for contacts as they are found at the configuration x (n_dofs,) and reactions r (m,)
    [N]; None where no contact has any. Of rigid bodies without the second derivative of their rotation."""
    d, force = contacts.dimension, r.reshape(len(contacts), -1)
    pressed = np.flatnonzero(np.any(force != 0, axis=1))
    those = contacts.take(pressed)
    p = np.einsum("aij,ai->aj", those.frame, force[pressed])
    blocks, rows, columns = [np.empty((0, d, d))], [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
    for corners in (2,) if d == 2 else (3, 4):
        chosen, master = _on_facets(those, corners)
        own, nodes = _stiffness(those.take(chosen), master, p[chosen], model.positions(x))
        k = nodes.shape[1]
        blocks.append(own.reshape(-1, d, d))
        rows.append(np.broadcast_to(nodes[:, :, None], (len(nodes), k, k)).ravel())
        columns.append(np.broadcast_to(nodes[:, None, :], (len(nodes), k, k)).ravel())
    values, row, column = np.concatenate(blocks), np.concatenate(rows), np.concatenate(columns)
    there = (row >= 0) & (column >= 0)
    if not there.any():
        return None
    values, row, column = values[there], row[there], column[there]
    axes = np.arange(d)
    shape = (d * model.n_nodes, d * model.n_nodes)
    index = (d * row[:, None, None] + axes[:, None] + 0 * axes, d * column[:, None, None] + axes + 0 * axes[:, None])
    nodal = sp.csr_array((values.ravel(), tuple(np.broadcast_to(i, values.shape).ravel() for i in index)), shape=shape)
    return sp.csr_array(model.contact_matrix(model.contact_matrix(nodal, x).T, x).T)


def by_formulas(model: Model, contacts: Contacts, r: FloatArray, x: FloatArray) -> bool:
    """Whether all contacts with reactions (m,) are points on facets with these facets' own normals."""
    d = contacts.dimension
    those = contacts.take(np.flatnonzero(np.any(r.reshape(len(contacts), -1) != 0, axis=1)))
    own = 0
    for corners in (2,) if d == 2 else (3, 4):
        chosen, place = _on_facets(those, corners)
        facets = those.take(chosen)
        phi = -np.take_along_axis(facets.weights, place, axis=1)
        first, _ = shape_gradients(phi)
        t = np.einsum("akb,akd->abd", first, model.positions(x)[np.take_along_axis(facets.nodes, place, axis=1)])
        own += int(np.count_nonzero(_flat(t, facets.frame[:, 0])))
    return own == len(those)


def _flat(t: FloatArray, N: FloatArray) -> BoolArray:
    """Whether normals N (n, d) are those of facets with the tangents t (n, d - 1, d)."""
    along = np.einsum("abd,ad->ab", t / np.linalg.norm(t, axis=2, keepdims=True), N)
    flat: BoolArray = np.linalg.norm(along, axis=1) < _ASIDE
    return flat


def _on_facets(contacts: Contacts, corners: int) -> tuple[IntArray, IntArray]:
    """Contacts of points on facets with so many corners, and which of their nodes these are (nc, corners)."""
    nodes, weights = contacts.nodes, contacts.weights
    master = (nodes >= 0) & (weights <= 0)
    chosen: BoolArray = master.sum(axis=1) == corners
    chosen &= np.abs(np.where(master, weights, 0.0).sum(axis=1) + 1) < _ROUND
    rows = np.flatnonzero(chosen)
    place = np.argsort(~master[rows], axis=1, kind="stable")[:, :corners]
    if corners == 4:
        phi = -np.take_along_axis(weights[rows], place, axis=1)
        bilinear = np.abs(phi[:, 0] * phi[:, 2] - phi[:, 1] * phi[:, 3]) < _ROUND
        rows, place = rows[bilinear], place[bilinear]
    return rows, place


def _stiffness(contacts: Contacts, place: IntArray, p: FloatArray, positions: FloatArray) -> tuple[FloatArray, IntArray]:
    """-d(H r)/dx (nc, k, d, k, d) -> (nc, k, k, d, d) and the nodes (nc, k) of contacts with facets at the columns `place`."""
    nodes, c, N = contacts.nodes, np.where(contacts.nodes >= 0, contacts.weights, 0.0), contacts.frame[:, 0]
    nc, k, d = *nodes.shape, contacts.dimension
    phi = -np.take_along_axis(c, place, axis=1)
    corners = positions[np.take_along_axis(nodes, place, axis=1)]
    first, second = shape_gradients(phi)
    t = np.einsum("akb,akd->abd", first, corners)
    curved = np.einsum("kbc,akd->abcd", second, corners)
    flat = _flat(t, N)
    metric = np.einsum("abd,acd->abc", t, t)
    bent = np.einsum("ad,abcd->abc", N, curved)
    m = metric - contacts.gap[:, None, None] * bent
    gradient = np.zeros((nc, k, d - 1))  # phi_k,a of all nodes, 0 of the slave's
    np.put_along_axis(gradient, np.broadcast_to(place[:, :, None], first.shape), first, axis=1)
    leaning = np.einsum("ad,akb->abkd", N, gradient)
    along = np.einsum("abd,ak->abkd", t, c) + contacts.gap[:, None, None, None] * leaning
    foot = np.linalg.solve(m, along.reshape(nc, d - 1, k * d)).reshape(nc, d - 1, k, d)  # dxi / dx, (1)
    lean = leaning + np.einsum("abc,ackd->abkd", bent, foot)
    normal = -np.einsum("abi,abkd->aikd", np.linalg.solve(metric, t), lean)  # dN / dx, (2)
    r_n = np.einsum("ad,ad->a", p, N)
    tangent = p - r_n[:, None] * N
    force = r_n[:, None, None, None] * normal - np.einsum("ai,aj,ajkd->aikd", N, tangent, normal)  # dp / dx, (2)
    found = -np.einsum("ak,aild->akild", c, force)
    found += np.einsum("akb,ai,abld->akild", gradient, p, foot)  # (3): c = (a, -phi)
    found = np.where(flat[:, None, None, None, None], found, 0.0)
    return found.transpose(0, 1, 3, 2, 4), nodes
