"""One point for the friction between two rigid bodies: forces that are opposite act on one line, and have no couple.

Detection gives two points a gap g apart, p on the slave and p - g N on the master. Friction r_T in both would be a couple g N x r_T that
nothing bears: where bodies overlap by the way of a step (the law `Velocity`), or are yet to meet in it, each impact changed the moment of
momentum by up to |g| |r_T|, of order h. Here both forces act, and both velocities are taken, in one point between the two:

    p - s g N,  s = m_slave / (m_slave + m_master)

so that the lighter body keeps its arm the more. Its normal is the same line: gaps and their rates stay. A body that supports hold in all
directions has the moment from them, and the other one keeps its arm; one that they hold at its centre alone turns, it counts as free. Nodes
of deformable bodies have no other point: there the couple remains.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import IntArray
from fcsim.assembly.model import Model
from fcsim.contact_detection.contacts import Contacts
from fcsim.ranks import in_common


def at_one_point(model: Model, H: sp.csc_array, contacts: Contacts) -> None:
    """Change the matrix H (n_dofs, d nc) of contacts so that each of them acts in one point.

    The moments of a column T lose s g N x T on the slave and (1 - s) g N x T on the master, whose force is -T.
    """
    chosen = _apart(model, contacts)
    if not len(chosen):
        return
    if in_common(H.data):  # every rank does this to all of them
        H.data = H.data.copy()
    d = contacts.dimension
    k = (H.shape[0] - model.n_elastic) // len(model.rigid)  # rows of a rigid body: its force, then its moment
    bodies, gap, frame = contacts.bodies[chosen], contacts.gap[chosen], contacts.frame[chosen]
    mass = model.body_mass[bodies]
    share = mass / mass.sum(axis=1, keepdims=True)
    across = [np.ones((len(chosen), 1))] if d == 2 else [frame[:, 2], -frame[:, 1]]  # N x T of the right-handed frames
    for column, turning in enumerate(across, 1):
        begin = H.indptr[d * chosen + column]
        for side in (0, 1):
            moment = begin + np.where(bodies[:, side] > bodies[:, 1 - side], k, 0) + d  # bodies stand in their order
            H.data[moment[:, None] + np.arange(k - d)] -= (share[:, side] * gap)[:, None] * turning


def _apart(model: Model, contacts: Contacts) -> IntArray:
    """Numbers (k,) of the contacts between two rigid bodies free to move whose points lie apart."""
    if not len(model.rigid) or not len(contacts):
        return np.empty(0, dtype=np.int64)
    free = np.zeros(len(model.bodies), dtype=bool)
    free[len(model.bodies) - len(model.rigid) :] = model.rigid_free.any(axis=1)  # to turn is enough
    if np.count_nonzero(free) < 2:  # a contact has two bodies
        return np.empty(0, dtype=np.int64)
    return np.flatnonzero(free[contacts.bodies].all(axis=1) & (contacts.gap != 0) & ~contacts.cables)
