"""Joints: what the contacts between two blocks carry and do together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.contact_detection import Contacts

State = Literal["closed", "hinge", "sliding", "open"]
_NONE = 1e-6  # of the largest of its kind


@dataclass(frozen=True)
class Joint:
    """A pair of blocks in contact.

    force (d,) [N] on the first of `between`, whose normal part is `normal_force` (pressure > 0) and whose other part `shear_force`
    middle (d,) [m] of the joint's contacts; point (d,) [m] where its resultant goes through the joint; None without pressure
    eccentricity [m]: the distance of the two; length [m]: extent of the contacts
    state  of a mechanism: "hinge" (turns about a contact that stays closed), "sliding", "open" (all contacts part), "closed"
    """

    between: tuple[str, str]
    force: tuple[float, ...]
    normal_force: float
    shear_force: float
    middle: tuple[float, ...]
    point: tuple[float, ...] | None
    eccentricity: float
    length: float
    state: State

    @property
    def used(self) -> float:
        """Friction used: shear over normal force; 0 without pressure."""
        return self.shear_force / self.normal_force if self.normal_force > 0 else 0.0


def joints_of(contacts: Contacts, names: tuple[str, ...], r: FloatArray, u: FloatArray) -> tuple[Joint, ...]:
    """Return the joints of the contacts, with the forces r (m,) [N] and the velocities u (m,) of a mechanism (0: none)."""
    d = contacts.dimension
    r, u = r.reshape(-1, d), u.reshape(-1, d)
    still = _NONE * max(float(np.abs(u).max(initial=0.0)), 1e-300)
    slight = _NONE * max(float(np.abs(r).max(initial=0.0)), 1e-300)
    pairs = np.sort(contacts.bodies, axis=1)
    different, place = np.unique(pairs, axis=0, return_inverse=True)
    joints = []
    for k, (a, b) in enumerate(different.tolist()):
        of = np.flatnonzero(place.ravel() == k)
        sign = np.where(contacts.bodies[of, 0] == a, 1.0, -1.0)[:, None]
        forces = sign * np.einsum("ac,aci->ai", r[of], contacts.frame[of])
        normals = sign * contacts.frame[of, 0]
        pressure = np.maximum(r[of, 0], 0.0)
        total, middle = forces.sum(axis=0), contacts.point[of].mean(axis=0)
        mean = (pressure[:, None] * normals).sum(axis=0) if pressure.sum() > slight else normals.sum(axis=0)
        length = float(np.linalg.norm(mean))
        axis = mean / length if length > 0 else normals[0]
        normal = float(total @ axis)
        point = None
        if pressure.sum() > slight:
            point = tuple(float(x) for x in (pressure[:, None] * contacts.point[of]).sum(axis=0) / pressure.sum())
        joints.append(
            Joint(
                between=(names[a], names[b]),
                force=tuple(float(x) for x in total),
                normal_force=normal,
                shear_force=float(np.linalg.norm(total - normal * axis)),
                middle=tuple(float(x) for x in middle),
                point=point,
                eccentricity=0.0 if point is None else float(np.linalg.norm(np.array(point) - middle)),
                length=float(np.linalg.norm(np.ptp(contacts.point[of], axis=0))),
                state=_state(u[of], still),
            )
        )
    return tuple(joints)


def _state(u: FloatArray, still: float) -> State:
    opens = u[:, 0] > still
    if opens.all():
        return "open"
    if (np.linalg.norm(u[~opens, 1:], axis=1) > still).any():
        return "sliding"
    return "hinge" if opens.any() else "closed"
