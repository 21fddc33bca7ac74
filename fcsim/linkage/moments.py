"""Rows of links without moment: what the forces of a row need beside them where its points are not where the row says.

A row's forces W x dir l have no resultant. Their moment about any point is that of its gap, sum_n W_n x_n x dir l: none where the row is
kept there. Where a scheme adds up moments in another configuration than that in which links are closed it is of the gap's order, and a pair
of bodies that nothing else holds would begin to turn. So each row between two bodies gets the couple -tau: a rigid body takes it as it is
(the force acts at the other body's point), of two deformable bodies the nodes next to the link take it, as the smallest forces

    f_i = - (J^-1 tau) x (x_i - c),  J = sum_i |x_i - c|^2 I - (x_i - c)(x_i - c)^T,  c the mean of their places.            (1)

The virtual work of G l in a rotation of both bodies is then nil to round-off, as it is for a function g of what rotation leaves alone.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.linear.sparse.short_indices import with_short_indices

ROUND = 1e-14
"""Of the model's size: moments of a unit force below are those of round-off."""


class Couple(NamedTuple):
    """Who takes the couples of the rows first to end - 1: rigid bodies, by their numbers among the rigid ones, in equal shares; without
    any, the nodes."""

    first: int
    end: int
    rigid: tuple[int, ...]
    nodes: IntArray


class Couples(NamedTuple):
    """Of all links: row, body (k,), the rows that rigid bodies take and their numbers among these, share (k,) of the couple; nodal: those
    of links without rigid bodies."""

    row: IntArray
    body: IntArray
    share: FloatArray
    nodal: tuple[Couple, ...]


def gathered(couples: Iterable[Couple]) -> Couples:
    """The couples of all links."""
    every = tuple(couples)
    rigid = [(row, body, len(one.rigid)) for one in every for row in range(one.first, one.end) for body in one.rigid]
    row, body, among = np.array(rigid, dtype=np.int64).reshape(-1, 3).T
    return Couples(row, body, 1.0 / among, tuple(one for one in every if not one.rigid))


def rotations(model: Model, x: FloatArray, about: FloatArray) -> FloatArray:
    """The velocities (n_dofs, k) of rotations of all bodies as one by 1 rad/s, k = 3 about each axis (2D: 1), about a point (d,) in the
    configuration x (n_dofs,): Q^T f are the moments of the forces f (n_dofs,)."""
    d = model.dimension
    Q = np.zeros((model.n_dofs, 2 * d - 3))
    count = model.n_elastic // d
    if count:
        Q[: model.n_elastic] = _turned(model.reference[:count] + x[: model.n_elastic].reshape(-1, d) - about)
    for_rigid = model.rigid_part(x)
    if len(for_rigid):
        centres = np.array([body.centre for body in model.rigid]) + for_rigid[:, :d] - about
        own = Q[model.n_elastic :].reshape(len(centres), -1, 2 * d - 3)
        own[:, :d] = _turned(centres).reshape(len(centres), d, -1)
        own[:, d:] = np.eye(2 * d - 3)
    return Q


def without_moments(model: Model, G: sp.csr_array, x: FloatArray, couples: Couples) -> sp.csr_array:
    """G (n_dofs, p) in the configuration x (n_dofs,) with the couples that the rows lack."""
    if not len(couples.row) and not couples.nodal:
        return G
    d, middle = model.dimension, model.reference.mean(axis=0)
    moment = G.T @ rotations(model, x, middle)
    some = np.abs(moment).max(axis=1) > ROUND * float(np.ptp(model.reference, axis=0).max())
    told = some[couples.row]
    row, turned = couples.row[told], model.n_elastic + (3 * d - 3) * couples.body[told, None] + np.arange(d, 3 * d - 3)
    dofs, rows = [turned.ravel()], [np.repeat(row, turned.shape[1])]
    values = [(-couples.share[told, None] * moment[row]).ravel()]
    for couple in couples.nodal:
        own = couple.first + np.flatnonzero(some[couple.first : couple.end])
        if not len(own):
            continue
        places = model.reference[couple.nodes] + x[model.dof_of_node[couple.nodes]]
        dofs.append(np.tile(model.dof_of_node[couple.nodes].ravel(), len(own)))
        values.append(_smallest(places, -moment[own]).ravel())
        rows.append(np.repeat(own, places.size))
    if not sum(map(len, rows)):
        return G
    more = sp.csr_array((np.concatenate(values), (np.concatenate(dofs), np.concatenate(rows))), shape=G.shape)
    return with_short_indices(sp.csr_array(G + more))


def _turned(arm: FloatArray) -> FloatArray:
    """e x arm for each axis e: (d n, k) of arms (n, d)."""
    if arm.shape[1] == 2:
        return np.stack([-arm[:, 1], arm[:, 0]], axis=1).reshape(-1, 1)
    return np.stack([np.cross(axis, arm) for axis in np.eye(3)], axis=2).reshape(-1, 3)


def _smallest(places: FloatArray, couple: FloatArray) -> FloatArray:
    """(1): forces (k, n, d) at places (n, d) of the moments couple (k, 1 or 3), without resultant."""
    arm = places - places.mean(axis=0)
    A = _turned(arm)
    return (couple @ np.linalg.pinv(A.T @ A, rcond=1e-10, hermitian=True) @ A.T).reshape(len(couple), *places.shape)
