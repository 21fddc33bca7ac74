"""Contacts with rolling resistance: five unknowns each, (N, T1, T2, R1, R2), the forces' rows of H and those of rolling moments; with
spinning resistance six, S after them, the moment about the normal.

In 2D there is no T2 and one moment, R1 about z: the rows of the others are zero, so that the problem is FCLIB's with five unknowns.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_law.law import Terms
from fcsim.errors import InputError
from fcsim.linear.sparse.short_indices import with_short_indices

ROWS = 5
"""Unknowns of a contact with rolling resistance."""
SPINNING_ROWS = 6
"""Unknowns of a contact with spinning resistance."""


def moment_matrix(model: Model, contacts: Contacts, terms: Terms) -> sp.csc_array | None:
    """H_R (n_dofs, k nc): (omega_slave - omega_master) . T1, T2 = H_R^T v [rad/s] of rigid bodies, moments H_R r_R [N m s] from r_R: k = 2;
    with spinning resistance k = 3, the third along N. None where the law has no resistance of either kind.

    InputError where a contact with resistance > 0 is one of a deformable body, the model has nonlinear ones, or in 2D something spins.
    """
    if terms.rolling is None and terms.spinning is None:
        return None
    name = "Rolling" if terms.spinning is None else "Spinning"
    resistance = np.zeros(len(contacts))
    for given in (terms.rolling, terms.spinning):
        resistance = resistance if given is None else np.maximum(resistance, given)
    d, deformable = model.dimension, len(model.deformable)
    if d == 2 and terms.spinning is not None:
        raise InputError("Spinning: expected contacts in 3D; in 2D nothing turns about the normal of a contact")
    soft = np.flatnonzero(np.any(contacts.bodies < deformable, axis=1) & (resistance > 0))
    if soft.size:
        one, other = (model.bodies[int(body)].name for body in contacts.bodies[soft[0]])
        raise InputError(
            f"{name}: expected contacts of rigid bodies, got {one!r} on {other!r}: the surface of a deformable body has no rotation "
            "of its own; give such contacts another law (laws_of_bodies)"
        )
    if model.nonlinear:
        raise InputError(f"{name}: expected bodies that are rigid or of linear materials, got nonlinear ones in the model")
    return _moments(model, contacts, (1, 2) if terms.spinning is None else (1, 2, 0))


def _moments(model: Model, contacts: Contacts, axes: tuple[int, ...]) -> sp.csc_array:
    """H_R (n_dofs, k nc) of moments about the k axes of the contacts' frames (0: N, 1: T1, 2: T2); in 2D of one about z, and nothing."""
    d, deformable, k = model.dimension, len(model.deformable), len(axes)
    turns = 1 if d == 2 else 3
    rows, columns, values = [], [], []
    for side, sign in ((0, 1.0), (1, -1.0)):
        own = np.flatnonzero(contacts.bodies[:, side] >= deformable)
        first = model.dof_offset[contacts.bodies[own, side]] + d
        for place, axis in enumerate(axes[:1] if d == 2 else axes):
            along = np.ones((len(own), 1)) if d == 2 else contacts.frame[own, axis]
            rows.append((first[:, None] + np.arange(turns)).ravel())
            columns.append(np.repeat(k * own + place, turns))
            values.append(sign * along.ravel())
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return with_short_indices(sp.csc_array(sp.coo_array(entries, shape=(model.n_dofs, k * len(contacts)))))


def with_moments(H: sp.sparray, moments: sp.sparray, dimension: int) -> sp.csc_array:
    """The matrix (n_dofs, (3 + k) nc) of all unknowns from that of forces H (n_dofs, d nc) and of moments (n_dofs, k nc)."""
    nc = H.shape[1] // dimension
    k = moments.shape[1] // max(nc, 1)
    nothing = sp.csc_array((H.shape[0], 1))
    a = np.arange(nc)[:, None]
    forces = a * dimension + np.arange(dimension)
    absent = np.full((nc, 3 - dimension), (dimension + k) * nc)
    order = np.concatenate([forces, absent, dimension * nc + k * a + np.arange(k)], axis=1).ravel()
    return sp.csc_array(sp.hstack([H, moments, nothing], format="csc")[:, order])


def widened(values: FloatArray, rows: int, fill: float) -> FloatArray:
    """(nc, rows) from the forces' (nc, d), the other components `fill`."""
    wide = np.full((len(values), rows), fill)
    wide[:, : values.shape[1]] = values
    return wide
