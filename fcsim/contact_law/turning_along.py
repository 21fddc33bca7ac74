"""How the stretch of tangential springs turns with the bodies that it joins.

Springs that stick are fixed to both bodies: where these turn together, their stretch turns too, and so does their force. Between two steps
it is carried into the new tangent plane, with its length, and turned about the new normal N by the mean of what the bodies turn about it,

    e <- exp(phi N x) P e,   phi = N . (log(R_s R_s^-T) + log(R_m R_m^-T)) / 2,

R the rotation of slave and master from the reference, ^- when the stretch was remembered: of deformable bodies that which leaves the least
of their nodes' displacements (Kabsch). A stretch that stayed in the world's axes would be a force that a turntable does not take along.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from fcsim.arrays import FloatArray
from fcsim.contact_law.law import Meeting

BENT = 0.9
"""Of the length of a stretch in the plane of another step: below, the contact has come to another face, and what it had is not kept."""


def attitudes(meeting: Meeting) -> FloatArray:
    """Rotation vectors (nc, 6) [rad] of slave and master from the reference where contacts are detected; (nc, 0) in 2D, where nothing turns
    about a normal."""
    if meeting.contacts.dimension == 2:
        return np.empty((len(meeting), 0))
    turned = Rotation.from_matrix(meeting.proportions.rotations(meeting.positions)).as_rotvec()
    return turned[meeting.contacts.bodies].reshape(-1, 6)


def carried(meeting: Meeting, stretch: FloatArray, before: FloatArray) -> FloatArray:
    """Stretches (nc, d - 1) [m] in the contacts' frames, of those remembered in the world's axes (nc, d) with the bodies' `attitudes`
    `before` (nc, 6), nan where they are not known."""
    along = meeting.in_frame(stretch)[:, 1:]
    whole, length = np.linalg.norm(stretch, axis=1), np.linalg.norm(along, axis=1)
    kept = (length > BENT * whole) & (length > 0)
    along[kept] *= (whole[kept] / length[kept])[:, None]
    some = np.flatnonzero(length > 0)
    if meeting.contacts.dimension == 2 or not len(some):
        return along
    now, earlier = (values[some].reshape(-1, 3) for values in (attitudes(meeting), before))
    earlier = np.where(np.isnan(earlier), now, earlier)
    turns = (Rotation.from_rotvec(now) * Rotation.from_rotvec(earlier).inv()).as_rotvec().reshape(-1, 2, 3).mean(axis=1)
    angle = np.einsum("ai,ai->a", turns, meeting.contacts.frame[some, 0])
    one, other = along[some].T
    along[some] = np.stack([np.cos(angle) * one - np.sin(angle) * other, np.sin(angle) * one + np.cos(angle) * other], axis=1)
    return along
