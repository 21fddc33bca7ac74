"""What is said of load steps of statics that end with bodies in each other and no force between them."""

from __future__ import annotations

import numpy as np

from fcsim.contact_detection import Detection
from fcsim.timestep.step import Step

DEEP = 1e-3
"""Of the smaller body's size: less is left to the next step."""


def bearing_nothing(step: Step, detection: Detection, when: str, said: frozenset[str]) -> dict[str, str]:
    """The remark on the first two bodies that end a load step deeper than `DEEP` in each other and bear nothing.

    A step knows the contacts of its beginning and those on its way (`look_ahead`), in the places and along the normals found there. What
    comes from far beside may have been found elsewhere on the other body than where it ends.
    """
    if step.scheme.timing.moving or "bears nothing" in said or not len(step.contacts):
        return {}
    sizes = step.encounter.meeting.proportions
    if step.penetration <= DEEP * float(sizes.size.min(initial=np.inf)):
        return {}
    there = detection(step.model.positions(step.state.x))
    deep = np.flatnonzero(there.gap < -DEEP * sizes.size_at(there))
    force = np.abs(step.contact_force).sum(axis=1)
    own = np.sort(step.contacts.bodies, axis=1)
    for a in deep[np.argsort(there.gap[deep], kind="stable")]:
        pair = np.sort(there.bodies[a])
        between = (own == pair).all(axis=1)
        if between.any() and not force[between].any():
            one, other = (step.model.bodies[int(k)].name for k in pair)
            deep_by = f"{one!r} and {other!r} end the load step {-there.gap[a]:.3g} m in each other and bear nothing"
            return {
                "bears nothing": f"{when}: {deep_by}: what comes from beside meets the other body elsewhere on its way. What helps: "
                "shorter load steps, or a way along the normal"
            }
    return {}
