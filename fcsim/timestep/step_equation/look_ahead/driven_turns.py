"""Bodies that supports turn by much in a load step of statics: what bears at its beginning and at its end says nothing of the way."""

from __future__ import annotations

import numpy as np

from fcsim.assembly.model import Model
from fcsim.assembly.supports import DrivenRotation, Support
from fcsim.contact_detection.contacts import Contacts
from fcsim.errors import InputError
from fcsim.timestep.step_equation.look_ahead.lengths import TURNED

LONGEST = 0.95 * TURNED
"""[rad] A part of a step that turns a body with contacts by more is cut: contacts that turn by `TURNED` are other ones."""

MOST = 1.0
"""[rad] The shortest part of a step may turn it by so much: contacts are other ones beyond."""


def turns_too_far(model: Model, contacts: Contacts, t: float, h: float, *, shortest: bool) -> bool:
    """Whether supports turn a body of these contacts by more than `LONGEST` from t to t + h [s], so that the part of the step is to be cut.
    InputError where it is the shortest and the turn more than `MOST`."""
    turned = _turned(model, t, h)
    if not turned or max(turned.values()) <= LONGEST:
        return False
    touched = np.unique(contacts.bodies)
    far = {name: angle for name, angle in turned.items() if angle > LONGEST and model.number[name] in touched}
    if not far or not shortest:
        return bool(far)
    name, angle = max(far.items(), key=lambda one: one[1])
    if angle > MOST:
        raise InputError(
            f"t = {t:.6g} s: expected supports that turn bodies with contacts by at most {MOST:g} rad in a part of a load step, got "
            f"{angle:.3g} rad of {name!r}: take more steps, or more cuttings"
        )
    return False


def _turned(model: Model, t: float, h: float) -> dict[str, float]:
    """By how much [rad] supports turn bodies, by name."""
    turned: dict[str, float] = {}
    for support in model.supports:
        if isinstance(support, DrivenRotation):
            angle = abs(support.turned(t + h) - support.turned(t))
        else:
            angle = _turned_by(support, t, h) * sum(direction.startswith("r") for direction in support.directions) ** 0.5
        turned[support.body] = float(np.hypot(turned.get(support.body, 0.0), angle))
    return turned


def _turned_by(support: Support, t: float, h: float) -> float:
    if not any(direction.startswith("r") for direction in support.directions):
        return 0.0
    return abs(support.way(t + h) - support.way(t) if support.displacement is not None else h * support.speed(t + h, h))
