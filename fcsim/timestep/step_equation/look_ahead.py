"""Where a step would lead: gaps that bend since bodies turn, and contacts that its impacts bring about.

The law 0 <= g + h u_N knows the contacts found at the beginning, x_m, and takes their motion for straight. Both are wrong by what a step
turns: a face at the distance R from the centre of its body, which turns by omega h, comes nearer by R (omega h)^2 / 2 than its velocity
says, and a body thrown aside by an impact may meet in the same step what it had not approached before. So contacts are detected once more
at x_m' = x_m + h v+, where the next step will find them. Of each that lies deeper there than its law meant, the bend

    b = g(x_m') - (g(x_m) + h u_N)                                                                        (1)

enters the law, 0 <= g + b + h u_N ⊥ r_N >= 0; those that are new are brought back to x_m as the sweep does; the step is solved again, until
nothing is deeper. A contact that lasts then has u_N = -b/h at the beginning of each step and +b/h at its end, and its reaction does no
work at theta = 1/2, where without b it does work of the order of b. What stands still is not looked at, nor, but under `Everything`,
what does not turn or meet anything, and nothing in its step changes.

Bodies that turn away from each other within a step end it apart by R (omega h)^2 / 2 although they were held as if they touched: such b > 0
is left out where none was given before. Twelve tumbling rocks end their contacts up to 1.2 % of a rock apart at h = 5 ms, 0.15 % at 2 ms.
With it they ended less than 0.1 % apart, but then overlapped between the places of detection, by 0.12 % and 0.04 %, where now none do.
"""

from __future__ import annotations

from dataclasses import replace
from functools import reduce

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.contact_detection import Detection, Detector, Everything, ExactContacts
from fcsim.contact_detection.contacts import Contacts, join
from fcsim.contact_detection.sweep import brought_back
from fcsim.contact_law.handed_on import comes_after
from fcsim.contact_law.law import Implicit
from fcsim.errors import InputError
from fcsim.linear.sparse._vectors_kernels import farthest
from fcsim.ranks import largest
from fcsim.timestep.encounter import Encounter, under_law
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State

ROUNDS = 4
"""How often a step is solved again."""

BORNE = 1e-5
"""Of the smaller body's size: less overlap than this is left to the next step."""

BORNE_BY_CABLES = 1e-8
"""The same of cables: those that turn grow longer in every step, by (h u_T)^2 / 2 L, and what no step sees adds up; surfaces part again."""

_TURNS_A_CABLE = 1e-4
"""Of the smallest body: a cable whose ends pass each other by less has grown by less than is borne."""

MEANT = 0.1
"""Of `BORNE`: how far contacts may be, in the mean, from where an answer that says where to look has them."""

FEW = 5e-3
"""Of the contacts: where a look has found no more new ones, the next answer is likely to be the last."""

THROWN = 1e-3
"""Of the smaller body's size: a contact that is carried farther than meant, since what bent it did not come about, is bent less."""

FAR = 0.1
"""Of the smallest body: bodies that a load step moves by less beside each other have not gone through one another."""

DEEPER = 2.0
"""Times the depth at which bodies end: they have gone through what they met where they overlap by so much once its normal says so."""

TURNED = 0.2
"""A turn [rad] within which what is met along a straight way is met."""

DOFS_FROM = 100_000
"""Degrees of freedom from which ranks share looking at how far nodes go: a tenth of a millisecond."""

_ASKED = 32
"""Pairs of bodies whose depth on the way of a load step is looked at; of more, the others are held on the way."""

_BODIES = 1 << 31  # more than there are

_TURNED_ASIDE = 2e-3
"""Of the smallest body: velocities that impacts change by less than this over the step bring no new contact about."""


def looked_ahead(
    model: Model, detection: Detection, scheme: Scheme, state: State, met: Encounter, v: FloatArray, after: State
) -> Encounter | None:
    """Return the encounter of a step with what its answer v (n_dofs,) and the state after it show; None where all is as it was meant."""
    timing = scheme.timing
    if not timing.moving:
        return _came_together(model, detection, scheme, state, met, after)
    if not (_found_late(model, detection, scheme, met, after) or _may_miss(model, scheme, state, met, v, after)):
        return None
    held = met.meeting.contacts
    positions = model.positions(scheme.detection_configuration(model, after))
    there = detection(positions)
    size = met.meeting.proportions.size_at(there)
    place, known = places(held.identity, there.identity)
    bend = np.zeros(len(held)) if met.meeting.bend is None else met.meeting.bend.copy()
    straight = held.gap + timing.length_per_u * met.relative(v).reshape(-1, held.dimension)[:, 0]
    meant = np.where(known, np.append(straight + bend, 0.0)[place], 0.0)
    deeper = there.gap < np.minimum(meant, 0.0) - np.where(there.cables, BORNE_BY_CABLES, BORNE) * size
    given = np.append(bend, 0.0)[place]
    too_far = known & (given < 0) & (meant <= BORNE * size) & (there.gap > np.maximum(meant, 0.0) + THROWN * size)
    if not (deeper.any() or too_far.any()):
        return None
    anew = known & (deeper | (given < 0) & (there.gap > meant))
    at = place[anew]
    bend[at] = np.where(deeper[anew], there.gap[anew] - straight[at], np.minimum(there.gap[anew] - straight[at], 0.0))  # (1)
    new = there.take(deeper & ~known & ~_of_other_facets(met, there, positions))
    if isinstance(detection, ExactContacts):
        new = detection.rolled_back(new, positions, met.meeting.positions)
    new = brought_back(new, met.meeting.positions)
    every = join([held, new])
    order = np.argsort(every.identity, kind="stable")
    meeting = met.meeting
    bent = np.concatenate([bend, np.zeros(len(new))])[order]
    again = under_law(
        model, scheme, state, every.take(order), meeting.positions, meeting.proportions, meeting.variables, bent, trial=meeting.trial
    )
    same = len(again.contacts) == len(held) and np.array_equal(again.terms.w, met.terms.w)
    return None if same else again  # a law that does not ask for gaps


def _of_other_facets(met: Encounter, there: Contacts, later: FloatArray) -> BoolArray:
    """Which of the contacts `there`, at `later` (n_nodes, d) [m], are contacts with springs that have come to another facet: (nc,)."""
    if met.compliance is None:
        return np.zeros(len(there), dtype=bool)
    meeting = met.meeting
    return comes_after(meeting.contacts, meeting.positions, there, later, meeting.proportions)


def borne_at_first(model: Model, detection: Detection, scheme: Scheme, met: Encounter, seen: Encounter | None = None) -> float:
    """The residual [m/s] that each contact of `met` may have at an answer which says where to look, 0 where it is to be the step's own.

    seen: the encounter before it, None where it is the first. Between rigid bodies whose joints have stiffness most steps are solved
    again with contacts that their first answer met, and such joints are so stiff that each time many reactions are others: what the first
    answers have of them is of no use. Velocities that move no contact by more than a share of what counts show the same contacts. The last
    answer is always one by the settings' tolerance.
    """
    joints = met.compliance is not None and not isinstance(scheme.law, Implicit)
    if not joints or model.deformable or not isinstance(detection, Everything) or not scheme.timing.moving:
        return 0.0
    if seen is not None and len(met.contacts) - len(seen.contacts) <= FEW * len(met.contacts):
        return 0.0
    return MEANT * BORNE * float(met.meeting.proportions.size.min(initial=np.inf)) / scheme.timing.length_per_u


def places(known: IntArray, wanted: IntArray) -> tuple[IntArray, BoolArray]:
    """Where the numbers `wanted` stand among the ascending `known` ones, len(known) for those that do not, and which do."""
    place = np.searchsorted(known, wanted)
    there = np.append(known, -1)[place] == wanted
    return np.where(there, place, len(known)), there


def _came_together(model: Model, detection: Detection, scheme: Scheme, state: State, met: Encounter, after: State) -> Encounter | None:
    """The encounter of a load step of statics with the contacts that it did not begin with and ends in each other; None where none do.

    A support or a load may carry a body from afar, beyond where contacts are looked for, into another one or through it: without this
    the step would end without a force. Contacts are those met on the way but what was `_slid_over`, else those of the end, brought back;
    of bodies that touch elsewhere and of one body with itself, too. What nonlinear bodies meet is found at the iterates, see `Anew`.
    """
    if model.nonlinear or not isinstance(detection, Everything | Detector | ExactContacts):
        return None
    begin, end, held, meeting = met.meeting.positions, model.positions(after.x), met.meeting.contacts, met.meeting
    if not moves(met, end - begin):
        return None
    there, released = detection(end), met.released
    passed = _passed(met, there, end)
    if passed.any():
        released = np.concatenate([released, np.unique(np.sort(held.bodies[passed], axis=1), axis=0)])
        again = under_law(model, scheme, state, held.take(~passed), begin, meeting.proportions, meeting.variables, trial=meeting.trial)
        return replace(again, ending=met.ending, released=released)
    found, ending = _closed(met, _met_far(model, met, detection, end - begin), end), met.ending
    found = found.take(~_of_pairs(found, ending))
    if len(found):
        over = _slid_over(met, found, there, detection, begin, end)
        found, ending = found.take(~_of_pairs(found, over)), np.concatenate([ending, over])
    if not len(found):
        left = _of_pairs(held, ending) & _left_behind(met, held, end)
        wanted = _deep(met, there, end) | _of_pairs(there, np.sort(held.bodies[left], axis=1))
        there = there.take(wanted & ~_of_other_facets(met, there, end))
        held = held.take(~left)
        found = there.take(~places(held.identity, there.identity)[1])
        if isinstance(detection, ExactContacts):
            found = detection.rolled_back(found, end, begin)
        found = brought_back(found, begin)
    if not len(found):
        return None
    every = join([held, found])
    every = every.take(np.argsort(every.identity, kind="stable"))
    again = under_law(model, scheme, state, every, begin, meeting.proportions, meeting.variables, trial=meeting.trial)
    return replace(again, ending=ending, released=released)


def _passed(met: Encounter, there: Contacts, end: FloatArray) -> BoolArray:
    """Which contacts of the beginning (nc,) hold by its normals what has gone past them and is apart at positions `end` (n_nodes, d) [m],
    where contacts `there` are: an edge that lay ahead within the alert distance would hold up a ball that slides on over it. They are taken
    out once; should the bodies then go through each other, they are among what is met on the way. Bodies that touched and end beside each
    other by normals that are the same but for `TURNED` have slid along a face."""
    held = met.meeting.contacts
    size = met.meeting.proportions.size_at(held)
    passed = (brought_back(held, end).gap < BORNE * size) & _left_behind(met, held, end) & ~_of_pairs(held, met.released)
    if not passed.any():
        return passed
    place, known = places(there.identity, held.identity)
    pairs, number = np.unique(np.sort(np.concatenate([there.bodies, held.bodies]), axis=1), axis=0, return_inverse=True)
    at_end, own = np.split(number.reshape(-1), [len(there)])
    pushed = np.zeros((len(pairs), held.dimension))
    np.add.at(pushed, at_end, _from_the_first(there))
    along = np.einsum("nd,nd->n", pushed[own], _from_the_first(held)) > np.cos(TURNED) * np.linalg.norm(pushed[own], axis=1)
    ahead = held.gap > BORNE * size
    return np.asarray(passed & np.where(known, np.append(there.gap, 0.0)[place] > THROWN * size, ahead | ~along))


def _slid_over(met: Encounter, way: Contacts, there: Contacts, detection: Detection, begin: FloatArray, end: FloatArray) -> IntArray:
    """The pairs of bodies (n, 2) whose contacts of the way are places that they slid over, to where they end in each other, by the contacts
    `there` of the end; begin, end (n_nodes, d) [m].

    A place on the way holds by its normal what has left it: a ball that is brought over the edge of a block would be held by every facet
    that it passed. Where it ends is what it bears on, unless it went through what it met: to where the other side pushes, or towards it by
    more than `FAR`, and it was deeper there than it ends.
    """
    deep = there.take(_deep(met, there, end))
    pairs, number = np.unique(np.sort(np.concatenate([deep.bodies, way.bodies]), axis=1), axis=0, return_inverse=True)
    at_end, on_way = np.split(number.reshape(-1), [len(deep)])
    pushed, depth = np.zeros((len(pairs), way.dimension)), np.zeros(len(pairs))
    np.add.at(pushed, at_end, _from_the_first(deep))
    np.maximum.at(depth, at_end, -deep.gap)
    alike = np.einsum("nd,nd->n", pushed[on_way], _from_the_first(way)) > 0
    first, last = np.maximum(brought_back(way, begin).gap, 0.0), brought_back(way, end).gap
    far = first - last > FAR * met.meeting.proportions.size_at(way)
    part = (first + DEEPER * depth[on_way]) / np.maximum(first - last, 1e-300)
    through = on_way[~alike | far & (part >= 1.0)]
    when = np.ones(len(pairs))
    np.minimum.at(when, on_way, np.where(far, part, 1.0))
    asked = np.setdiff1d(on_way[far], through)
    shallow = [k for k in asked[:_ASKED] if _shallow(detection, begin + when[k] * (end - begin), pairs[k], depth[k])]
    return np.asarray(pairs[np.setdiff1d(on_way, np.union1d(through, np.setdiff1d(asked, shallow)))], dtype=np.int64)


def _shallow(detection: Detection, positions: FloatArray, pair: IntArray, depth: float) -> bool:
    """Whether a pair of bodies overlaps at positions (n_nodes, d) [m] by less than half again of `depth` [m]."""
    found = detection(positions)
    return bool(found.gap.min(where=_of_pairs(found, pair[None]), initial=0.0) > -0.5 * (1.0 + DEEPER) * depth)


def _from_the_first(contacts: Contacts) -> FloatArray:
    """Normals (nc, d) as from the body of the larger number into the other, whichever is the slave."""
    return np.where(contacts.bodies[:, :1] < contacts.bodies[:, 1:], 1.0, -1.0) * contacts.frame[:, 0]


def _left_behind(met: Encounter, contacts: Contacts, end: FloatArray) -> BoolArray:
    """Which contacts (nc,) have points that are beside each other by more than `FAR` at positions (n_nodes, d) [m]."""
    apart = np.einsum("ak,akd->ad", np.where(contacts.nodes < 0, 0.0, contacts.weights), end[contacts.nodes])
    beside = np.einsum("aid,ad->ai", contacts.frame[:, 1:], apart)
    return np.asarray(np.linalg.norm(beside, axis=1) > FAR * met.meeting.proportions.size_at(contacts))


def _of_pairs(contacts: Contacts, pairs: IntArray) -> BoolArray:
    """Which contacts (nc,) are those of the pairs of bodies (n, 2), the smaller number first."""
    own, sought = (bodies[:, 0] * _BODIES + bodies[:, 1] for bodies in (np.sort(contacts.bodies, axis=1), pairs))
    return np.asarray(np.isin(own, sought))


def _met_far(model: Model, met: Encounter, detection: Detection, moved: FloatArray) -> Contacts:
    """The contacts at the beginning of nodes' displacements (n_nodes, d) [m], and on their way where that is `FAR`. What flies off, as
    statics let bodies that nothing holds, is followed to where it has left the others behind. Bodies that turn by more than `TURNED`
    go other ways, with other normals: theirs are left out."""
    begin, held = met.meeting.positions, met.meeting.contacts
    way = float(np.linalg.norm(np.ptp(moved, axis=0)))
    if way <= FAR * float(met.meeting.proportions.size.min(initial=np.inf)):
        return held.take(np.zeros(len(held), dtype=bool))
    part = min(1.0, 2.0 * float(np.linalg.norm(np.ptp(begin, axis=0))) / way)
    try:
        found = detection(begin, part * moved)
    except InputError as error:
        raise InputError(f"{error}, or, where only eta holds a body in statics, choose a larger eta") from None
    turned = part * _turns(model, moved) > TURNED * _turns(model, begin)
    return found.take(~turned[found.bodies].any(axis=1))


def _closed(met: Encounter, contacts: Contacts, positions: FloatArray) -> Contacts:
    """Those of the contacts that `met` does not have and that are closed by what counts at positions (n_nodes, d) [m]."""
    known = places(met.meeting.contacts.identity, contacts.identity)[1]
    return contacts.take(_deep(met, contacts, positions) & ~known)


def _deep(met: Encounter, contacts: Contacts, positions: FloatArray) -> BoolArray:
    """Which contacts (nc,) are closed by what counts at positions (n_nodes, d) [m]."""
    return brought_back(contacts, positions).gap < -BORNE * met.meeting.proportions.size_at(contacts)


def _found_late(model: Model, detection: Detection, scheme: Scheme, met: Encounter, after: State) -> bool:
    """Whether bodies move by a length that counts under a detection of everything: what approaches beside a face, a corner above
    a corner, is its contact when it is there. (It keeps what it finds where the next step begins: looking costs nothing.)"""
    if not isinstance(detection, Everything):
        return False
    return moves(met, model.positions(scheme.detection_configuration(model, after)) - met.meeting.positions)


def moves(met: Encounter, moved: FloatArray) -> bool:
    """Whether nodes' displacements (n_nodes, d) [m] differ by a length that counts."""
    smallest = float(met.meeting.proportions.size.min(initial=np.inf))
    return bool(np.ptp(moved, axis=0).max(initial=0.0) > BORNE * smallest)


def _may_miss(model: Model, scheme: Scheme, state: State, met: Encounter, v: FloatArray, after: State) -> bool:
    """Whether some node leaves the straight way, or the way along which contacts were looked for, by a length that counts; or whether a
    contact slides on a body that turns by so much that its normal is another one."""
    h, begin = scheme.timing.h, scheme.detection_configuration(model, state)
    sizes = met.meeting.proportions.size
    smallest = float(sizes.min(initial=np.inf))
    aside, off, longest = _farthest(model, scheme, state, met, v, after)
    if aside > _TURNED_ASIDE * smallest:
        return True
    counts = 0.5 * BORNE * smallest
    if off > counts:
        return True
    held = met.meeting.contacts
    if not len(held):
        return False
    slide = scheme.timing.length_per_u * reduce(np.maximum, np.abs(met.relative(v).reshape(len(held), -1)[:, 1:]).T)
    if slide.max(where=held.cables, initial=0.0) > _TURNS_A_CABLE * smallest:
        return True
    if slide.max() * longest <= 0.25 * smallest * counts:  # no node moves by more than twice that beside the mean
        return False
    angle = (_turns(model, h * model.node_velocity(v, begin)) / (0.5 * np.maximum(sizes, 1e-300)))[held.bodies].max(axis=1)
    return bool(np.any(slide * angle > counts))  # N . du less N' . du, of nodes that go straight


def _farthest(model: Model, scheme: Scheme, state: State, met: Encounter, v: FloatArray, after: State) -> FloatArray:
    """In their largest components (3,) [m]: how far nodes are beside the way along which contacts were looked for, beside the straight way,
    and how long that is. Of deformable bodies each rank looks at some."""
    h, d, n = scheme.timing.h, model.dimension, model.n_elastic
    begin, end, way = scheme.detection_configuration(model, state), scheme.detection_configuration(model, after), scheme.way(model, state)
    reference, met_at = model.reference.ravel(), met.meeting.positions.ravel()
    nothing = v[:0] if way is None else way

    def look(first: int, last: int) -> FloatArray:
        return farthest(h, v[first:last], nothing[first:last], end[first:last], reference[first:last], met_at[first:last])

    elastic = largest("ways", n, DOFS_FROM, look)
    rigid = model.rigid_part(begin)
    straight = h * model.rigid_bodies.velocity(rigid, model.rigid_part(v))
    beside = straight[:0] if way is None else model.rigid_bodies.velocity(rigid, h * model.rigid_part(v) - model.rigid_part(way))
    moved = model.reference[n // d :] + model.rigid_bodies.displacement(model.rigid_part(end)) - met.meeting.positions[n // d :]
    return np.maximum(elastic, [np.abs(some).max(initial=0.0) for some in (beside, moved - straight, straight)])


def _turns(model: Model, moved: FloatArray) -> FloatArray:
    """The largest motion (nbodies,) [m] of a body's nodes beside their mean one, of their motions (n_nodes, d); of places half its size."""
    own = np.diff(model.node_offset)
    some, first = np.flatnonzero(own), model.node_offset[:-1][own > 0]
    mean = np.add.reduceat(moved, first, axis=0) / own[some, None]
    beside = np.abs(moved - np.repeat(mean, own[some], axis=0)).max(axis=1)
    turns = np.zeros(len(own))
    turns[some] = np.maximum.reduceat(beside, first)
    return turns
