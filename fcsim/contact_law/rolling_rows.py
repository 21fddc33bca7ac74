"""Contacts with rolling resistance: five unknowns each, (N, T1, T2, R1, R2), the forces' rows of H and those of rolling moments.

In 2D there is no T2 and one moment, R1 about z: the rows of the others are zero, so that the problem is FCLIB's with five unknowns.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model
from fcsim.contact_detection.contacts import Contacts
from fcsim.errors import InputError

ROWS = 5


def moment_matrix(model: Model, contacts: Contacts, resistance: FloatArray) -> sp.csc_array:
    """H_R (n_dofs, 2 nc): (omega_slave - omega_master) . T1, T2 = H_R^T v [rad/s] of rigid bodies, moments H_R r_R [N m s] from r_R.

    InputError where a contact with resistance > 0 (nc,) is one of a deformable body, or the model has nonlinear ones.
    """
    nc, d, deformable = len(contacts), model.dimension, len(model.deformable)
    soft = np.flatnonzero(np.any(contacts.bodies < deformable, axis=1) & (resistance > 0))
    if soft.size:
        one, other = (model.bodies[int(body)].name for body in contacts.bodies[soft[0]])
        raise InputError(
            f"Rolling: expected contacts of rigid bodies, got {one!r} on {other!r}: the surface of a deformable body has no rotation "
            "of its own; give such contacts another law (laws_of_bodies)"
        )
    if model.nonlinear:
        raise InputError("Rolling: expected bodies that are rigid or of linear materials, got nonlinear ones in the model")
    turns = 1 if d == 2 else 3
    rows, columns, values = [], [], []
    for side, sign in ((0, 1.0), (1, -1.0)):
        own = np.flatnonzero(contacts.bodies[:, side] >= deformable)
        first = model.dof_offset[contacts.bodies[own, side]] + d
        for k in range(1 if d == 2 else 2):
            tangent = np.ones((len(own), 1)) if d == 2 else contacts.frame[own, 1 + k]
            rows.append((first[:, None] + np.arange(turns)).ravel())
            columns.append(np.repeat(2 * own + k, turns))
            values.append(sign * tangent.ravel())
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return sp.csc_array(sp.coo_array(entries, shape=(model.n_dofs, 2 * nc)))


def five_rows(H: sp.sparray, moments: sp.sparray, dimension: int) -> sp.csc_array:
    """The matrix (n_dofs, 5 nc) of all unknowns from that of forces H (n_dofs, d nc) and of moments (n_dofs, 2 nc)."""
    nc = moments.shape[1] // 2
    nothing = sp.csc_array((H.shape[0], 1))
    a = np.arange(nc)[:, None]
    forces = a * dimension + np.arange(dimension)
    absent = np.full((nc, 3 - dimension), (dimension + 2) * nc)
    order = np.concatenate([forces, absent, dimension * nc + 2 * a + np.arange(2)], axis=1).ravel()
    return sp.csc_array(sp.hstack([H, moments, nothing], format="csc")[:, order])


def widened(values: FloatArray, fill: float) -> FloatArray:
    """(nc, 5) from the forces' (nc, d), the other components `fill`."""
    wide = np.full((len(values), ROWS), fill)
    wide[:, : values.shape[1]] = values
    return wide
