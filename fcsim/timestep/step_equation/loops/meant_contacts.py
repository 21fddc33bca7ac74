"""Contacts at the answer of an iteration of Newton's method in statics beside those that its problem was given."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.contact_detection.contacts import Contacts, join
from fcsim.contact_detection.sweep import brought_back
from fcsim.errors import InputError
from fcsim.timestep.encounter import Encounter, Redetection
from fcsim.timestep.step_equation.equation import Equation
from fcsim.timestep.step_equation.look_ahead.lengths import places

SETTLED = 1e-8
"""Of the smallest body: by how much less a contact may have moved from where it was meant."""


def settled(old: Encounter, met: Encounter, v: FloatArray, r: FloatArray) -> bool:
    """Whether the contacts `met` at the answer v (n_dofs,), r (m,) are where the last problem, with `old` ones, meant them: pressed ones at
    their gap, none closed that was not."""
    d = met.contacts.dimension
    here, meant = ((e.H.T @ v + e.w).reshape(-1, d)[:, 0] for e in (met, old))
    pressed = r.reshape(-1, d)[:, 0] > 0
    bearing = SETTLED * float(met.meeting.proportions.size.min(initial=np.inf)) / met.meeting.timing.length_per_u
    place, known = places(old.contacts.identity, met.contacts.identity)
    moved = np.abs(here - np.append(meant, np.nan)[place])
    pressed_here = np.append(pressed, False)[place]
    same = np.count_nonzero(pressed_here) == np.count_nonzero(pressed)
    open_or_known = np.where(
        pressed_here, moved <= bearing, here >= np.minimum(-bearing, np.where(known, np.append(meant, 0)[place], 0) - bearing)
    )
    return bool(same and np.all(open_or_known))


def passed(
    equation: Equation, anew: Redetection, before: FloatArray, v: FloatArray, extent: float, earlier: Contacts | None
) -> Contacts | None:
    """The contacts that bodies pass from the iterate `before` to the answer v (n_dofs,), as they stand at the iterate, with the `earlier`
    ones of the same iterate; None where there are no more.

    They are closed on the way, and at its end the detection does not see them: a body that nothing held yet has gone through another one,
    whose far face would hold it from there on. What moves farther than the model is large, extent [m], is not followed.
    """
    model, state, detection = equation.model, equation.state, anew.detection
    here, there = (model.positions(model.advance(state.x, at)) for at in (before, v))
    if not np.abs(there - here).max(initial=0.0) <= extent:
        return None
    try:
        found = detection(here, there - here)
    except InputError:  # more looks than a step may take
        return None
    known = equation.met.contacts.identity if earlier is None else np.union1d(equation.met.contacts.identity, earlier.identity)
    found = found.take(~np.isin(found.identity, known))
    found = found.take((found.gap >= 0) & (brought_back(found, there).gap < 0))
    if not len(found):
        return None
    found = found.take(~np.isin(found.identity, detection(there).identity))
    if not len(found):
        return None
    return found if earlier is None else join([earlier, found])
