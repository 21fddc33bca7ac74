"""Joints whose bodies have rolled or walked on: what opened there is no crack."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from fcsim.running.folder import Instant
from fcsim.view.joints.joints import Joints, configuration
from fcsim.view.scene import read


def without_moved_on(joints: Joints, last: Instant) -> Joints:
    """The joints but those between two bodies that bear on each other at the last instant, and nowhere in the joint.

    A disk that rolls leaves the facets on which it lay. In the joint is what lies no farther from a corner of its facets than its longest
    edge: a block that rocks on its edge, or slides, bears on the joint still. Bodies that have parted have their joint.
    """
    if last.contacts is None or not len(joints):
        return joints
    contacts = read(last.contacts)
    bears = np.linalg.norm(np.asarray(contacts["reaction"]).reshape(-1, 3), axis=1) > 0
    place = np.asarray(contacts.points, dtype=float).reshape(-1, 3)[bears]
    between = np.sort(np.column_stack([np.asarray(contacts["slave"]), np.asarray(contacts["master"])])[bears], axis=1)
    pairs, of_facet = np.unique(np.sort(joints.bodies, axis=1), axis=0, return_inverse=True)
    corners = joints.corners(configuration(last))
    edge = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    kept = np.ones(len(joints), dtype=bool)
    for number, pair in enumerate(pairs):
        own, bearing = of_facet.ravel() == number, place[(between == pair).all(axis=1)]
        if len(bearing):
            away = np.linalg.norm(bearing[:, None] - corners[own].reshape(1, -1, 3), axis=2).min(axis=1)
            kept[own] = bool((away <= edge[own].max()).any())
    return Joints(*(getattr(joints, field.name)[kept] for field in fields(Joints)))
