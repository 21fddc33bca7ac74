"""Joints that contact locks: bodies that touch on both sides of the point or axis about which a joint lets them turn, or where it is."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model
from fcsim.contact_detection import Contacts, Detection
from fcsim.linkage import Ball, Hinge, Linkage

TOUCH = 1e-3
"""Of the model's size: gaps that a small turn closes."""
ARM = 1e-3
"""Of the model's size: the lever of a contact's normal about the joint from which on it stands against turning."""


def locked_joints(model: Model, linkage: Linkage, detector: Detection, positions: FloatArray) -> Iterator[str]:
    """A remark on the first joint of two bodies whose contacts stand against turning about it one way and the other, or on the first two
    or more that hold two bodies where these touch: contact there has rows that the joints' are sums of.

    Contacts press along their normals N at the places c: a turn by w about the joint p opens those with w . ((c - p) x N) > 0, and
    closes the others. Where there are both along an axis, the bodies cannot turn about it.
    """
    joints = [link for link in linkage.links if isinstance(link, Ball | Hinge) and None not in (link.first, link.second)]
    if not joints:
        return
    contacts, size = detector(positions), float(np.ptp(positions, axis=0).max())
    contacts = contacts.take(contacts.gap <= TOUCH * size)
    for link in joints:
        both = np.sort([model.body_number(str(link.first)), model.body_number(str(link.second))])
        between = contacts.take(np.all(np.sort(contacts.bodies, axis=1) == both, axis=1))
        joined = [other for other in joints if {other.first, other.second} == {link.first, link.second}]
        if len(joined) > 1 and (held := [other.name for other in joined if _touches(between, other, ARM * size)]):
            yield (
                f"bodies {link.first!r} and {link.second!r} touch where the link {held[0]!r} holds them, one of {len(joined)}: which part "
                "of a force there is contact's and which the links' is not determined, both may be many times the load, or none is found. "
                "Where the links stand for what happens between them: "
                f"without_contact_of(detector, model, [({link.first!r}, {link.second!r})])"
            )
            return
        if _locked(between, link, ARM * size):
            yield (
                f"bodies {link.first!r} and {link.second!r} touch on both sides of the link {link.name!r}: contact keeps them from turning "
                "about it. Where the link stands for what happens between them: "
                f"without_contact_of(detector, model, [({link.first!r}, {link.second!r})])"
            )
            return


def _touches(contacts: Contacts, link: Ball | Hinge, near: float) -> bool:
    """Whether a contact is no farther than `near` [m] from the joint's point or axis."""
    places = np.array([link.at] if isinstance(link, Ball) else link.ends)
    arm = contacts.point - places[0]
    if isinstance(link, Hinge):
        axis = (places[1] - places[0]) / np.linalg.norm(places[1] - places[0])
        arm = arm - (arm @ axis)[:, None] * axis
    return bool(np.any(np.linalg.norm(arm, axis=1) <= near))


def _locked(contacts: Contacts, link: Ball | Hinge, least: float) -> bool:
    """Whether normals have levers longer than `least` [m] about the joint in both senses, of a ball about some axis."""
    places = np.array([link.at] if isinstance(link, Ball) else link.ends)
    arm, normal = contacts.point - places[0], contacts.frame[:, 0]
    if contacts.dimension == 2:
        levers = (arm[:, 0] * normal[:, 1] - arm[:, 1] * normal[:, 0])[:, None]
    elif isinstance(link, Hinge):
        levers = np.cross(arm, normal) @ ((places[1] - places[0]) / np.linalg.norm(places[1] - places[0]))[:, None]
    else:
        levers = np.cross(arm, normal)
        levers = levers @ np.linalg.svd(levers, full_matrices=False)[2].T
    return bool(np.any((levers.max(axis=0, initial=0.0) > least) & (levers.min(axis=0, initial=0.0) < -least)))
