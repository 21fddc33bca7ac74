"""What is said of bodies so far from the origin that the digits of their coordinates hide how contact deforms them."""

from __future__ import annotations

import numpy as np

from fcsim.timestep.step import Step

FAR = 100.0
"""Times the model's extent: from there on it is the place of the origin that costs digits."""
NAMED = 1e-3
"""Of how far contacts deform bodies: gaps known to less are named. Steel blocks of 1 cm, 1e6 m off, pressed by 1 MPa, at 1.2e-3: friction
that is left open by the load alone was 211 N in place of 232 N."""


def far_off(step: Step, steps: int, when: str, said: frozenset[str]) -> dict[str, str]:
    """The remark where a digit of the coordinates exceeds `NAMED` of what contacts deform bodies by, twice the elastic energy over the sum
    of their forces' amounts (joints draw, too); {} where it does not. The first and the last step of statics are looked at."""
    model, force = step.model, step.contact_force[:, 0]
    if "far off" in said or step.scheme.timing.moving or step.number not in (1, steps) or not (model.deformable and (force > 0).any()):
        return {}
    largest, extent = float(np.abs(model.reference).max()), float(np.ptp(model.reference, axis=0).max())
    digit, motion = float(np.spacing(largest)), 2.0 * step.energy.elastic / float(np.abs(force).sum())
    if largest <= FAR * extent or not digit > NAMED * motion:
        return {}
    return {
        "far off": f"{when}: coordinates of up to {largest:.3g} m have digits of {digit:.2g} m, beside {motion:.2g} m by which contact "
        "deforms the bodies: where they bear is known to no more. What helps: the origin near the bodies"
    }
