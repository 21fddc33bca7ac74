"""How deep bodies lie in each other at the end of a step, by the step's own detection."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model
from fcsim.contact_detection import Detection
from fcsim.contact_detection.contacts import Contacts
from fcsim.timestep.encounter import Encounter
from fcsim.timestep.state import State

LOOKED_AT = 1e-6
"""Of the smaller body's size: above it contacts are detected anew at the end of the step."""


def penetration_at_end(model: Model, detection: Detection, met: Encounter, after: State) -> float:
    """The deepest penetration [m] at the end of a step, at least 0.

    Contacts of the step, also those that its law left out since they were open, are followed to the end: g + N . (dx_slave - dx_master),
    by the same facets. Where that is deep, it may be a facet's plane that was left aside, or a contact that was found ahead and brought
    back, so it is what is detected at the end that counts. In statics nothing looks ahead, and contacts are always detected there.
    """
    positions, deepest = model.positions(after.x), 0.0
    if not met.meeting.timing.moving:
        return max(0.0, float(-detection(positions).gap.min(initial=0.0)))
    moved, smallest = positions - met.meeting.positions, float(met.meeting.proportions.size.min(initial=np.inf))
    for contacts in (met.meeting.contacts, met.left):
        if contacts is None or not len(contacts):
            continue
        deep = -(contacts.gap + _closing(contacts, moved))
        most = float(deep.max())
        if most > LOOKED_AT * smallest and np.any(deep > LOOKED_AT * met.meeting.proportions.size_at(contacts)):
            return max(0.0, float(-detection(positions).gap.min(initial=0.0)))
        deepest = max(deepest, most)
    return deepest


def _closing(contacts: Contacts, moved: FloatArray) -> FloatArray:
    """The change (nc,) of the gaps by the nodes' displacements (n_nodes, d)."""
    weights = np.where(contacts.nodes < 0, 0.0, contacts.weights)
    return np.einsum("ak,akd,ad->a", weights, moved[contacts.nodes], contacts.frame[:, 0])
