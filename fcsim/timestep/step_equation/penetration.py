"""How deep bodies lie in each other at the end of a step, by the step's own detection, and whether it was too long to keep them apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model
from fcsim.contact_detection import Detection, Detector, Everything, ExactContacts, innermost
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.sweep import bounded
from fcsim.timestep.chain import Attempt
from fcsim.timestep.encounter import Encounter
from fcsim.timestep.scheme import StepSetup
from fcsim.timestep.state import State
from fcsim.timestep.step_equation.look_ahead.lengths import moves, turns
from fcsim.timestep.step_equation.look_ahead.turned_meshes import turned_too_far
from fcsim.timestep.step_equation.loops.lost_contacts import Lost, lost

LOOKED_AT = 1e-6
"""Of the smaller body's size: above it contacts are detected anew at the end of the step."""

SUNK = 5e-5
"""Of the smaller body's size: bodies that a law keeps apart sink into each other by less within a step, or it is cut."""

CUTS = 3
"""How often a step is cut for that."""


@dataclass(frozen=True)
class AtEnd:
    """penetration: the deepest [m] at the end of a step, at least 0; sinks: whether bodies that the law keeps apart lie deeper in each
    other after the step than they did before it, by what counts: it was too long; lost: contacts that statics have lost."""

    penetration: float
    sinks: bool
    lost: Lost | None = None

    def too_long(self, cuts: int, cuttings: int, attempts: list[Attempt], tol: float) -> bool:
        """Whether the step, cut so often of `cuttings` times, has no end that serves; with contacts lost this goes into the attempts."""
        if self.lost is not None:
            attempts.append(Attempt("contacts", "the step's beginning", str(self.lost), self.lost.share, 0, 0.5**cuts, tol))
        return self.lost is not None or (self.sinks and cuts < min(CUTS, cuttings))


def at_end(setup: StepSetup, ends: tuple[State, State], began: Encounter, met: Encounter, *, settled: bool) -> AtEnd:
    """Look at the end of a step from the one of `ends` to the other, that began with the contacts `began` and ended with `met`; settled:
    looking ahead came to its end.

    Contacts are kept where they are detected, at x_m and x_m', on the motion that `look_ahead` foresees. In between, at the end of the
    step, what turns by omega h lies deeper by up to R (omega h)^2 / 8; where many contacts bend at once, looking ahead may end before
    all of them are met; and a contact that it brings back to x_m may have a gap there that is less than the bodies', which a law takes
    for penetration that is old and leaves at x_m'. Each error is a quarter, or less, in half the step. Only `Everything` and
    `ExactContacts`, which answer for all contacts, have their steps cut: with listed surfaces a step is what its scheme makes of them, the
    depth between its contacts' instants and its end included.
    """
    model, detection, scheme, (before, after) = setup.model, setup.detection, setup.scheme, ends
    positions = model.positions(after.x)
    if not scheme.timing.moving:
        found = detection(positions)
        gone = lost(model, began, found, model.positions(before.x), positions)
        meshes = isinstance(innermost(detection), Everything | Detector) and not model.nonlinear
        return AtEnd(_depth(found), meshes and turned_too_far(met, found, positions), gone)
    moved = positions - met.meeting.positions
    if _has_others(model, detection, met, moved):
        deepest, deep = 0.0, True
    else:
        deepest, deep = _followed(met, moved)
    there = detection(positions) if deep else None
    penetration = deepest if there is None else _depth(there)
    answers = isinstance(innermost(detection), Everything | ExactContacts) and len(met.contacts) > 0 and met.keeps_apart(scheme.law)
    if not answers or (settled and there is None):
        return AtEnd(penetration, False)
    sinks = there is not None and _deeper(detection, met, there)
    if not sinks:
        sinks = _deeper(detection, met, detection(model.positions(scheme.detection_configuration(model, after))))
    return AtEnd(penetration, sinks)


def _has_others(model: Model, detection: Detection, met: Encounter, moved: FloatArray) -> bool:
    """Whether bodies moved by (n_nodes, d) [m] may have other contacts than those of the step: what turns and slides. With exact shapes
    those that turn, but about their own axes, so far from x_m on that they lie deeper by what counts: R angle^2 / 2, R half their size."""
    within = innermost(detection)
    if isinstance(within, Everything):
        return moves(met, moved)
    if not isinstance(within, ExactContacts):
        return False
    turned, solids = turns(model, moved), within.solids
    turned[solids.body] = solids.swung(moved)
    return bool(np.any(turned**2 > SUNK * met.meeting.proportions.size**2))


def _depth(contacts: Contacts) -> float:
    """The deepest penetration [m], at least 0. Cables, which are longer between the instants at which they are held, are none."""
    return max(0.0, float(-contacts.gap[~contacts.cables].min(initial=0.0)))


def _deeper(detection: Detection, met: Encounter, there: Contacts) -> bool:
    """Whether contacts found later are deeper, by what counts, than the deepest of the same two bodies where the step's were found."""
    there = there.take(~there.cables)
    counts = SUNK * met.meeting.proportions.size_at(there)
    if not np.any(there.gap < -counts):
        return False
    return bool(np.any(there.gap < bounded(there, detection(met.meeting.positions)).gap - counts))


def _followed(met: Encounter, moved: FloatArray) -> tuple[float, bool]:
    """The deepest penetration [m] after the nodes' displacements (n_nodes, d) [m], at least 0, and whether it is one that counts.

    Contacts of the step, also those that its law left out since they were open, are followed: g + N . (dx_slave - dx_master), by the same
    facets. Where that is deep, it may be a facet's plane that was left aside, or a contact that was found ahead and brought back, so it
    is what is detected at the end that counts. In statics nothing looks ahead, and contacts are always detected there.
    """
    deepest, size_at = 0.0, met.meeting.proportions.size_at
    smallest = float(met.meeting.proportions.size.min(initial=np.inf))
    for contacts in (met.meeting.contacts, met.left):
        if contacts is None or not len(contacts):
            continue
        deep = np.where(contacts.cables, 0.0, -(contacts.gap + contacts.along_normals(moved)))
        most = float(deep.max())
        if most > LOOKED_AT * smallest and np.any(deep > LOOKED_AT * size_at(contacts)):
            return most, True
        deepest = max(deepest, most)
    return deepest, False
