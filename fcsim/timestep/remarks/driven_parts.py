"""What is said of contacts between parts that supports or links hold or drive: what these press on each other is not determined."""

from __future__ import annotations

import numpy as np

from fcsim.timestep.step import Step


def driven_parts(step: Step, when: str, said: frozenset[str]) -> dict[str, str]:
    """The remark on the first step in which such parts touch; {} where there are none. See `fcsim.contact_law.driven`."""
    met = step.encounter
    if "driven parts" in said or met.driven is None:
        return {}
    touching = met.driven.touching(step.scheme.h * step.state.v)
    if not len(touching):
        return {}
    pairs = np.unique(np.sort(touching.bodies, axis=1), axis=0)
    one, other = (step.model.bodies[int(k)].name for k in pairs[0])
    more = f" (and {len(pairs) - 1} more pairs)" if len(pairs) > 1 else ""
    return {
        "driven parts": f"{when}: {one!r} and {other!r}{more} touch at {len(touching)} points where {met.driven.by} hold both along the "
        "contact's normal: what they press on each other there is not determined and counts as none, without friction"
    }
