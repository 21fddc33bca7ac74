"""What a step's first part passes unseen: bodies that go through each other between the state and the configuration of detection.

Contacts are detected at x_m, ahead of the state x, and along the step from there, so that each step begins where the one before ended to
look. The way from x to x_m itself is seen by nobody in the first step of a run, and in part where a step is longer than the one before.
"""

from __future__ import annotations

from typing import NoReturn

import numpy as np

from fcsim.arrays import IntArray
from fcsim.assembly.model import Model
from fcsim.contact_detection.contacts import Contacts
from fcsim.errors import InputError
from fcsim.timestep.scheme import Scheme, StepSetup
from fcsim.timestep.state import State
from fcsim.timestep.step import Moment

_SHARE = 1e-3  # of the smaller body: less is not passed through


def passes(setup: StepSetup, start: Moment, *, shortest: bool) -> bool:
    """Whether bodies pass each other before the contacts of the step are detected: it is to be cut. InputError where it is the `shortest`
    already."""
    met = passed_unseen(setup, start.state)
    if met is not None and shortest:
        refuse_passing(setup, start.state, met, f"step {start.number}, t = {start.state.t:.6g} s")
        return False
    return met is not None


def passed_unseen(setup: StepSetup, state: State) -> Contacts | None:
    """Return what closes on the way from the state to the configuration of detection and is not seen there; None where there is nothing.

    Contacts of bodies that have none at all there come first.
    """
    model, detection, scheme, proportions = setup.model, setup.detection, setup.scheme, setup.proportions
    if scheme.way(model, state) is None:
        return None
    here, ahead = (model.positions(x) for x in (state.x, scheme.detection_configuration(model, state)))
    way = ahead - here
    if np.abs(way).max(initial=0.0) <= 0.1 * _SHARE * proportions.size.min():
        return None
    met = detection(here, way)
    least = _SHARE * proportions.size_at(met)
    before, after = (met.along_normals(x) for x in (here, ahead))
    met = met.take((before > -least) & (after < -least))
    if not len(met):
        return None
    seen = detection(ahead)
    met = met.take(~np.isin(met.identity, seen.identity))
    apart = ~np.isin(_pair(met, len(model.bodies)), _pair(seen, len(model.bodies)))
    return met.take(np.argsort(~apart, kind="stable")) if len(met) else None


def refuse_passing(setup: StepSetup, state: State, met: Contacts, when: str) -> None:
    """InputError where the bodies of the first contact have none in the configuration of detection: they would go through each other."""
    model, scheme = setup.model, setup.scheme
    seen = setup.detection(model.positions(scheme.detection_configuration(model, state)))
    if np.isin(_pair(met, len(model.bodies))[0], _pair(seen, len(model.bodies))):
        return  # they are held, in another place
    one, other = (model.bodies[int(body)].name for body in met.bodies[0])
    raise InputError(
        f"{when}: expected bodies that do not pass each other before contacts are looked for for the first time, got {one!r} and "
        f"{other!r} within the first {scheme.h:.3g} s: choose a shorter h, or let them begin farther apart"
    )


def refuse_going_through(model: Model, scheme: Scheme, met: Contacts, when: str) -> NoReturn:
    """InputError: the bodies of the first contact go through each other within a step whose law takes closed contacts only."""
    one, other = (model.bodies[int(body)].name for body in met.bodies[0])
    raise InputError(
        f"{when}: expected steps in which bodies approach by less than half their size, got {one!r} and {other!r}, which would pass each "
        f"other within {scheme.h:.3g} s: choose a shorter h, or a law that meets what is still open (Gap)"
    )


def _pair(contacts: Contacts, bodies: int) -> IntArray:
    low, high = contacts.bodies.min(axis=1), contacts.bodies.max(axis=1)
    return np.asarray(low * bodies + high, dtype=np.int64)
