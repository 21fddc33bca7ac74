"""The contacts of a step and what their law makes of them: from positions to the contact side of the problem."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.assembly.whole.vectors import placed
from fcsim.brief import brief
from fcsim.contact_detection import Detection, Detector, contact_matrix_of_bodies
from fcsim.contact_detection.contacts import Contacts, join
from fcsim.contact_detection.skin.boundary import joined_by_facets
from fcsim.contact_law.coulomb import Gap
from fcsim.contact_law.driven import Driven, held_by_links, moved_by_supports, refuse_driven, without_force
from fcsim.contact_law.friction import refuse_endless
from fcsim.contact_law.handed_on import comes_after, handed_on, may_come_after, places
from fcsim.contact_law.law import NOTHING, Implicit, Law, Meeting, Outcome, Terms, Variables
from fcsim.contact_law.one_point import at_one_point
from fcsim.contact_law.proportions import Proportions
from fcsim.contact_law.rolling_rows import ROWS, SPINNING_ROWS, moment_matrix, widened, with_moments
from fcsim.linear.sparse.by_ranks import times_by_ranks, transposed_times_by_ranks
from fcsim.linear.sparse.columns import times, transposed_times
from fcsim.linkage import Linkage
from fcsim.timestep.reactions.drift import Drift
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State

_HALF = 0.5


@dataclass(frozen=True, eq=False)
class Encounter:
    """The contacts of a step under their law; see `fcsim.contact_law.law` for S, r_c and C.

    contacts  as the law takes them: its mu, and its frames where it turns them
    H         (n_dofs, d nc) contact matrix of the forces over all dofs, driven ones included
    meeting   what the law was told
    terms     what it gave
    left      the contacts that the law leaves out, None where it takes all
    driven    those that supports and links alone move along their normals, which are no part of the problem, see `Driven`; None where
              there are none
    moments   (n_dofs, 2 nc) contact matrix of rolling moments, (n_dofs, 3 nc) with spinning resistance; None without either, see
              `rolling_rows`
    passing   what the law leaves out and the bodies would go through within the step, see `passing`; None where there is nothing
    ending    (n, 2) pairs of bodies that a load step of statics carries over each other, held where they end it, `look_ahead.load_steps`
    linkage   the links that it knows of, None where there are none
    released  (n, 2) pairs of bodies of which contacts of the beginning were taken out, since they bore what had gone apart
    drift     of what bore in the last step, None where it is not asked for
    """

    contacts: Contacts
    H: sp.csc_array
    meeting: Meeting
    terms: Terms
    passing: Contacts | None = None
    moments: sp.csc_array | None = None
    left: Contacts | None = None
    driven: Driven | None = None
    linkage: Linkage | None = None
    ending: IntArray = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    released: IntArray = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    drift: Drift | None = None

    __repr__ = brief

    @property
    def rows(self) -> int:
        """Unknowns a contact: d, with rolling resistance 5, with spinning resistance 6."""
        if self.moments is None:
            return self.contacts.dimension
        return ROWS if self.terms.spinning is None else SPINNING_ROWS

    @property
    def handed_out(self) -> sp.csc_array:
        """H whose arrays cannot be written into: the next steps have its pattern, and the ranks of one machine its entries."""
        H = copy(self.H)
        for name in ("data", "indices", "indptr"):
            setattr(H, name, values := getattr(H, name).view())
            values.setflags(write=False)
        return H

    @cached_property
    def acting_H(self) -> sp.csc_array:
        """(n_dofs, m) of all unknowns, forces and moments."""
        return self.H if self.moments is None else with_moments(self.H, self.moments, self.contacts.dimension)

    def _of_rows(self, values: FloatArray, fill: float = 0.0) -> FloatArray:
        """(m,) from the forces' (nc, d)."""
        return (values if self.moments is None else widened(values, self.rows, fill)).ravel()

    @cached_property
    def scaled_H(self) -> sp.csc_array:
        """H S, the problem's."""
        scale = self.terms.scale
        if scale is None:
            return self.acting_H
        H = self.acting_H
        return sp.csc_array((H.data * np.repeat(self._of_rows(scale, 1.0), np.diff(H.indptr)), H.indices, H.indptr), shape=H.shape)

    @property
    def w(self) -> FloatArray:
        """w (m,) without what driven dofs add."""
        return self._of_rows(self.terms.w)

    @property
    def compliance(self) -> FloatArray | None:
        """The diagonal of C (m,), None where all is rigid."""
        return None if self.terms.compliance is None else self._of_rows(self.terms.compliance)

    @property
    def adhesive_impulse(self) -> FloatArray | None:
        """H r_c (n_dofs,), None without adhesion."""
        return None if self.terms.adhesion is None else times(self.H, self.terms.adhesion.ravel())

    def reaction(self, r: FloatArray) -> FloatArray:
        """S r - r_c (m,): what acts on the slave bodies for the problem's r."""
        if self.terms.scale is not None:
            r = self._of_rows(self.terms.scale, 1.0) * r
        return r if self.terms.adhesion is None else r - self._of_rows(self.terms.adhesion)

    def impulse(self, r: FloatArray) -> FloatArray:
        """(n_dofs,) on the bodies' dofs for the problem's r (m,)."""
        return times_by_ranks(self.acting_H, self.reaction(r))

    def forces(self, r: FloatArray) -> FloatArray:
        """The forces' components (nc, d) of a vector on the problem's rows (m,)."""
        return r.reshape(len(self.contacts), self.rows)[:, : self.contacts.dimension]

    def velocity(self, u: FloatArray) -> FloatArray:
        """The law's velocity (m,) in the contacts' frames for the problem's u = S ..."""
        return u if self.terms.scale is None else u / self._of_rows(self.terms.scale, 1.0)

    def outcome(self, u: FloatArray, r: FloatArray, v: FloatArray) -> Outcome:
        """What the law is told of the problem's u, r (m,) and the velocity v (n_dofs,)."""
        return Outcome(self.terms, self.forces(u), self.forces(r), self.relative(v).reshape(self.terms.w.shape))

    def relative(self, v: FloatArray) -> FloatArray:
        """H^T v (d nc,) of v (n_dofs,), read-only; of the same array once: where a step leads and what the law remembers ask for it."""
        last = self.__dict__.get("_relative")
        if last is None or last[0] is not v:
            found = transposed_times_by_ranks(self.H, v)
            found.setflags(write=False)
            last = self.__dict__["_relative"] = v, found
        return last[1]

    def tried(self, law: Law, trial: Variables) -> Encounter:
        """The same contacts under a law that is told `trial`, see `Implicit`."""
        meeting = replace(self.meeting, trial=trial)
        terms = law.terms(meeting)
        return replace(self, contacts=replace(self.contacts, mu=terms.mu), meeting=meeting, terms=terms)

    def eased(self, law: Law) -> Encounter | None:
        """The same contacts without taking penetrations back in this step; None where the law `Gap` takes none back.

        Coulomb's law need not have an answer where it is to push bodies out of each other: a wedge that friction locks is held by any
        force, and by none where its gaps are a hair below zero. With w_N >= 0 bodies that stay where they are are an answer (V. Acary,
        F. Cadoux, "Applications of an existence result for the Coulomb friction problem", Recent Advances in Contact Mechanics, 2013).
        """
        w = self.terms.w
        if not isinstance(law, Gap) or not self.meeting.timing.moving or not (w[:, 0] < 0).any():
            return None
        w = np.column_stack([np.maximum(w[:, 0], 0.0), w[:, 1:]])
        return replace(self, terms=replace(self.terms, w=w))

    def refuse_driven(self, model: Model, v: FloatArray, when: str, found: Callable[[], Contacts]) -> None:
        """InputError where supports or links drive parts into each other, by the step's answer v (n_dofs,); found: contacts after it."""
        if self.driven is not None:
            refuse_driven(self.driven, model, self.meeting.timing.length_per_u * v, when, found)

    def keeps_apart(self, law: Law) -> bool:
        """Whether the law keeps bodies apart by their gaps: no joints, which yield or hold, nor a law on velocities."""
        terms, meeting = self.terms, self.meeting
        if terms.adhesion is not None or terms.compliance is not None or isinstance(law, Implicit):
            return False
        farther = law.terms(replace(meeting, bend=meeting.size))
        return bool((farther.w[:, 0] > terms.w[:, 0]).any())

    def remember(self, law: Law, u: FloatArray, r: FloatArray, v: FloatArray) -> Variables | None:
        """The law's variables after the step with the problem's u, r (m,) and the velocity v (n_dofs,) at its end."""
        outcome = self.outcome(u, r, v)
        kept = law.remember(self.meeting, outcome)
        earlier = self.meeting.variables or NOTHING
        if not kept.values:
            return replace(earlier, stored=kept.stored, breaking=kept.breaking)
        values = {**kept.values, **places(self.meeting, outcome, kept)}
        return earlier.merged(self.contacts.identity, values, kept.stored, kept.breaking)


@dataclass(frozen=True, eq=False)
class Anew:
    """How contacts are found at the iterates of a step of statics: met, at v (n_dofs,) and with others that are met on the way, under their
    law; detection: the bare ones, of the model's bodies; of: met with the contacts of a detection."""

    of: Callable[[Detection, FloatArray, Contacts | None], Encounter]
    detection: Detection
    model: Model

    def met(self, v: FloatArray, more: Contacts | None) -> Encounter:
        return self.of(self.detection, v, more)

    def in_valleys(self) -> Anew:
        """The same where points in valleys have a contact for each of the facets, see `Detector.in_valleys`."""
        other = self.detection.in_valleys if isinstance(self.detection, Detector) else None
        return self if other is None else replace(self, detection=other)

    @cached_property
    def joined(self) -> sp.csr_array:
        """Which of the nodes that contacts can touch share a facet, see `joined_by_facets`."""
        return joined_by_facets(self.model, self.detection.nodes)


@dataclass(frozen=True, eq=False)
class Told:
    """What a law is told beside the contacts of a step and where they are: fields of `Meeting` of the same names; links; what drifts."""

    proportions: Proportions
    variables: Variables | None
    bend: FloatArray | None = None
    trial: Variables | None = None
    linkage: Linkage | None = None
    drift: Drift | None = None


def encounter(model: Model, detection: Detection, scheme: Scheme, state: State, told: Told) -> Encounter:
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
    told: Told,
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
    model: Model, scheme: Scheme, state: State, contacts: Contacts, positions: FloatArray, told: Told, configuration: FloatArray
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
    """Ask the law about other contacts of the same step, at the positions and with the memory of `met`; bend (nc,) [m]: see `Meeting`."""
    before = met.meeting
    told = Told(before.proportions, before.variables, bend, before.trial, met.linkage, met.drift)
    return _under_law(model, scheme, state, contacts, before.positions, told, scheme.detection_configuration(model, state))


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
