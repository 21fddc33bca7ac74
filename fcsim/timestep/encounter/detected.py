"""The contacts of a step, detected and put to their law: at its beginning, at an iterate of statics, and again for others."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray
from fcsim.assembly.model import Model
from fcsim.assembly.whole.vectors import placed
from fcsim.contact_detection import Detection, contact_matrix_of_bodies
from fcsim.contact_detection.contacts import Contacts, join
from fcsim.contact_law.driven import Driven, held_by_links, moved_by_supports, without_force
from fcsim.contact_law.friction import refuse_endless
from fcsim.contact_law.handed_on import comes_after, handed_on, may_come_after
from fcsim.contact_law.law import Meeting, Variables
from fcsim.contact_law.one_point import at_one_point
from fcsim.contact_law.proportions import Proportions
from fcsim.contact_law.rolling_rows import moment_matrix
from fcsim.linear.sparse.by_ranks import transposed_times_by_ranks
from fcsim.linear.sparse.columns import transposed_times
from fcsim.linkage import Linkage
from fcsim.timestep.encounter.contact_side import Encounter
from fcsim.timestep.reactions.drift import Drift
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State

_HALF = 0.5


@dataclass(frozen=True, eq=False)
class LawInput:
    """What a law is told beside the contacts of a step and where they are: fields of `Meeting` of the same names; links; what drifts."""

    proportions: Proportions
    variables: Variables | None
    bend: FloatArray | None = None
    trial: Variables | None = None
    linkage: Linkage | None = None
    drift: Drift | None = None


def encounter(model: Model, detection: Detection, scheme: Scheme, state: State, told: LawInput) -> Encounter:
    """Detect the contacts of a step and ask their law."""
    configuration = scheme.detection_configuration(model, state)
    positions, way = placed(model, configuration), scheme.way(model, state)
    moved = None if way is None else model.positions(model.advance(configuration, way)) - positions
    contacts = detection(positions, moved)
    if moved is not None and (near := may_come_after(told.variables, contacts, positions, told.proportions)).any():
        here, later = detection(positions), positions + moved
        there = detection(later)
        taking = there.identity[comes_after(here, positions, there, later, told.proportions)]
        contacts = contacts.take(~(near & np.isin(contacts.identity, taking) & ~np.isin(contacts.identity, here.identity)))
    return _under_law(model, scheme, state, contacts, positions, told, configuration)


def met_on_the_way(
    model: Model,
    detection: Detection,
    scheme: Scheme,
    state: State,
    v: FloatArray,
    more: Contacts | None,
    told: LawInput,
) -> Encounter:
    """The contacts of a step of statics as they are found at its iterate v (n_dofs,) [m], for increments from its beginning.

    The gap g(x + v) is linearised there: 0 <= g - N . (H^T v) + u_N ⊥ r_N >= 0 with u the increment over the whole step; the law is told
    the gap brought back, `contacts` has that at the iterate. more: contacts beside those found there, as they stand there.
    """
    x = model.advance(state.x, v)
    positions = model.positions(x)
    found = detection(positions)
    if more is not None:
        found = join([found, more.take(~np.isin(more.identity, found.identity))])
        found = found.take(np.argsort(found.identity, kind="stable"))
    H = contact_matrix_of_bodies(found, model, x)
    back = found.gap - transposed_times(H, v).reshape(len(found), -1)[:, 0] if len(found) else found.gap
    met = _under_law(model, scheme, state, replace(found, gap=back), positions, told, x)
    return replace(met, contacts=replace(met.contacts, gap=found.gap[np.searchsorted(found.identity, met.contacts.identity)]))


def _under_law(
    model: Model, scheme: Scheme, state: State, contacts: Contacts, positions: FloatArray, told: LawInput, configuration: FloatArray
) -> Encounter:
    """Ask the law about contacts at `positions` (n_nodes, d) [m] of the bodies in `configuration` (n_dofs,)."""
    law, proportions, bend = scheme.law, told.proportions, told.bend
    variables = handed_on(told.variables, contacts, positions, proportions)
    chosen = law.select(contacts, proportions, variables)
    through = left = None
    if not chosen.all():
        left = contacts.take(~chosen)
        way = scheme.way(model, state)
        if way is not None:
            moved = model.positions(model.advance(configuration, way)) - positions
            through = passing(left, moved, proportions)
        contacts, bend = contacts.take(chosen), None if bend is None else bend[chosen]
    H = contact_matrix_of_bodies(contacts, model, configuration)
    moving = scheme.timing.moving
    if moving:
        at_one_point(model, H, contacts)
    shape = (len(contacts), contacts.dimension)
    before = transposed_times_by_ranks(H, scheme.velocity_before(model, state)).reshape(shape) if moving else np.zeros(shape)
    drift = None if told.drift is None else told.drift.at(model, scheme, state, contacts, H, proportions)
    meeting = Meeting(contacts, positions, before, state.t, scheme.timing, variables, proportions, bend, told.trial, drift)
    terms, driven = law.terms(meeting), None
    refuse_endless(terms.mu)
    apart = moved_by_supports(model, H, contacts.dimension, proportions)
    linked = np.zeros_like(apart)
    if told.linkage is not None:
        linked = ~apart & held_by_links(model, told.linkage, configuration, H, contacts, proportions)
    apart = apart | linked
    if apart.any() and without_force(terms):
        driven, H, meeting = _separated(H, meeting, apart, linked)
        contacts, terms = meeting.contacts, law.terms(meeting)
    if terms.frame is not None and not np.array_equal(terms.frame, contacts.frame):
        H, meeting = _turned(H, meeting, terms.frame)
        contacts = meeting.contacts
    if terms.mu is not contacts.mu:
        contacts = replace(contacts, mu=terms.mu)
    moments = moment_matrix(model, contacts, terms)
    return Encounter(contacts, H, meeting, terms, through, moments, left, driven, told.linkage, drift=told.drift)


def asked_again(
    model: Model, scheme: Scheme, state: State, met: Encounter, contacts: Contacts, bend: FloatArray | None = None
) -> Encounter:
    """Ask the law about other contacts of the same step, at the positions, with the memory and the lever arms of `met`; bend (nc,) [m]:
    see `Meeting`."""
    before = met.meeting
    told = LawInput(before.proportions, before.variables, bend, before.trial, met.linkage, met.drift)
    configuration = scheme.detection_configuration(model, state) if met.arms is None else met.arms
    return replace(_under_law(model, scheme, state, contacts, before.positions, told, configuration), arms=met.arms)


def _separated(H: sp.sparray, meeting: Meeting, apart: BoolArray, linked: BoolArray) -> tuple[Driven, sp.csc_array, Meeting]:
    """The contacts `apart` (nc,), of which links hold the `linked` (nc,), and H and the meeting of the others."""
    d, contacts = meeting.contacts.dimension, meeting.contacts.take(apart)
    columns = sp.csc_array(H)
    normals = columns[:, d * np.flatnonzero(apart)]
    return (
        Driven(contacts, normals, meeting.proportions.size_at(contacts), linked[apart]),
        columns[:, np.repeat(~apart, d)],
        meeting.taken(~apart),
    )


def passing(left: Contacts, moved: FloatArray, proportions: Proportions) -> Contacts | None:
    """Return open contacts that a law leaves out (it takes closed ones only) and that the step's motion (n_nodes, d) [m] would close by
    more than half of the smaller body: the next detection would see that body behind the other, or on its far side."""
    closes = left.gap + left.along_normals(moved)
    deep = (left.gap > 0) & (closes < -_HALF * proportions.size_at(left))
    return left.take(deep) if deep.any() else None


def _turned(H: sp.csc_array, meeting: Meeting, frame: FloatArray) -> tuple[sp.csc_array, Meeting]:
    """H and the meeting in other frames (nc, d, d)."""
    old, nc, d = meeting.contacts, len(meeting), meeting.contacts.dimension
    turn = np.einsum("aij,akj->aik", frame, old.frame)  # new components from old ones
    blocks = sp.bsr_array((turn.transpose(0, 2, 1), np.arange(nc), np.arange(nc + 1)), shape=(d * nc, d * nc))
    before = np.einsum("aik,ak->ai", turn, meeting.before)
    H = sp.csc_array(H @ blocks)
    H.sort_indices()
    return H, replace(meeting, contacts=replace(old, frame=frame), before=before)
