"""What a load step of statics carries together, into each other or past each other: contacts of its end and of its way.

A support or a load may carry a body from afar, beyond where contacts are looked for: the law of the beginning knows nothing of what is met
then, and holds by its normals what has gone by.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.contact_detection import Detection, Detector, Everything, ExactContacts, innermost
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.sweep import brought_back, with_met
from fcsim.errors import InputError
from fcsim.timestep.encounter import Encounter, asked_again
from fcsim.timestep.scheme import StepSetup
from fcsim.timestep.state import State
from fcsim.timestep.step_equation.look_ahead.lengths import (
    BENT,
    BORNE,
    SLID,
    THROWN,
    TURNED,
    back_at,
    moves,
    of_other_facets,
    of_pairs,
    places,
    turns,
    ways,
)
from fcsim.timestep.step_equation.look_ahead.turned_meshes import not_slid_by_turning, turned_arms, turned_meshes

FAR = 0.1
"""Of the smallest body: bodies that a load step moves by less beside each other have not gone through one another."""

DEEPER = 2.0
"""Times the depth at which bodies end: they have gone through what they met where they overlap by so much once its normal says so."""

_ASKED = 32
"""Pairs of bodies whose depth on the way of a load step is looked at; of more, the others are held on the way."""


def came_together(
    setup: StepSetup, state: State, met: Encounter, v: FloatArray, after: State, reactions: FloatArray | None = None
) -> Encounter | None:
    """The encounter of a load step of statics with the contacts that `_carried` finds, by which what turns together has not slid."""
    again = _carried(setup, state, met, v, after, reactions)
    return None if again is None else not_slid_by_turning(setup.model, again, (state, after))


def _carried(setup: StepSetup, state: State, met: Encounter, v: FloatArray, after: State, reactions: FloatArray | None) -> Encounter | None:
    """The encounter of a load step of statics with the contacts that it did not begin with and ends in each other; None where none do.

    A support or a load may carry a body from afar, beyond where contacts are looked for, into another one or through it: without this
    the step would end without a force. Contacts are those met on the way but what was `_slid_over`, else those of the end, brought back;
    of bodies that touch elsewhere and of one body with itself, too. What nonlinear bodies meet is found at the iterates, see `Redetection`.
    """
    model, detection = setup.model, setup.detection
    if model.nonlinear or not isinstance(innermost(detection), Everything | Detector | ExactContacts):
        return None
    begin, end, held = met.meeting.positions, model.positions(after.x), met.meeting.contacts
    if not moves(met, end - begin):
        return None
    there, released = detection(end), met.released
    passed = _passed(met, there, end)
    if passed.any():
        released = np.concatenate([released, np.unique(np.sort(held.bodies[passed], axis=1), axis=0)])
        again = asked_again(model, setup.scheme, state, met, held.take(~passed))
        return replace(again, ending=met.ending, released=released, turned=met.turned)
    exact = isinstance(innermost(detection), ExactContacts)
    anew = _bent(met, there, begin, end) if exact else turned_meshes(model, met, there, (state, after), reactions)
    if len(anew):
        found = there.take(of_pairs(there, anew))
        held = held.take(~of_pairs(held, anew))
        if exact:
            return _with(setup, state, met, held, back_at(begin, detection, found, end), there)
        met = replace(met, arms=turned_arms(model, state, met, after, anew))
        apart = end - model.node_velocity(v, met.arms)
        met = replace(met, turned=np.unique(np.concatenate([met.turned, anew]), axis=0))
        return _with(setup, state, met, held, replace(found, gap=brought_back(found, begin).gap), there, apart)
    found, ending = _closed(met, _met_far(model, met, detection, end - begin), end), met.ending
    found = found.take(~of_pairs(found, ending))
    if len(found):
        over = _slid_over(met, found, there, detection, begin, end)
        found, ending = found.take(~of_pairs(found, over)), np.concatenate([ending, over])
    if not len(found):
        left = of_pairs(held, ending) & _left_behind(met, held, end)
        wanted = _deep(met, there, end) | of_pairs(there, np.sort(held.bodies[left], axis=1))
        there = there.take(wanted & ~of_other_facets(met, there, end))
        held = held.take(~left)
        found = there.take(~places(held.identity, there.identity)[1])
        found = back_at(begin, detection, found, end)
    if not len(found):
        return None
    straight = None if met.arms is None else end - model.node_velocity(v, met.arms)
    return replace(_with(setup, state, met, held, found, there, straight), ending=ending)


def _with(
    setup: StepSetup, state: State, met: Encounter, held: Contacts, found: Contacts, there: Contacts, straight: FloatArray | None = None
) -> Encounter:
    """The encounter `met` with the contacts `held` of it and those that were `found` on the way, or `there`, at its end.

    straight (n_nodes, d) [m]: from where nodes would have come to the end as they move by the lever arms of `met`, from which gaps of the
    bodies that have turned them are taken: g(x + v) = g + H^T v there."""
    every = with_met(held, found, there, setup.model.body_of_node)
    if straight is not None and met.arms is not None:
        turned = (setup.model.rigid_part(met.arms) != setup.model.rigid_part(state.x)).any(axis=1)
        of = np.append(np.zeros(len(setup.model.deformable), dtype=bool), turned)[every.bodies].any(axis=1)
        every = replace(every, gap=np.where(of, brought_back(every, straight).gap, every.gap))
    again = asked_again(setup.model, setup.scheme, state, met, every)
    return replace(again, ending=met.ending, released=met.released, turned=met.turned)


def _passed(met: Encounter, there: Contacts, end: FloatArray) -> BoolArray:
    """Which contacts of the beginning (nc,) hold by its normals what has gone past them and is apart at positions `end` (n_nodes, d) [m],
    where contacts `there` are: an edge that lay ahead within the alert distance would hold up a ball that slides on over it. They are taken
    out once; should the bodies then go through each other, they are among what is met on the way. Bodies that touched and end beside each
    other by normals that are the same but for `TURNED` have slid along a face."""
    held = met.meeting.contacts
    size = met.meeting.proportions.size_at(held)
    passed = (brought_back(held, end).gap < BORNE * size) & _left_behind(met, held, end) & ~of_pairs(held, met.released)
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


def _bent(met: Encounter, there: Contacts, begin: FloatArray, end: FloatArray) -> IntArray:
    """The pairs of bodies (n, 2) of exact shapes whose gaps bend on the way from positions `begin` to `end` (n_nodes, d) [m], where
    contacts `there` are: a ball that slides by s along a face keeps its depth, where the law of a place beside its foot has it s^2 / 2R
    deeper or less deep.

    Pairs that bear have their contacts where the step ends then, by their weights and normals there. What goes twice `FAR` has them by what
    it meets on its way; joints with stiffness remember where they began, and keep that.
    """
    held = met.meeting.contacts
    far = float(np.linalg.norm(np.ptp(end - begin, axis=0))) > 2.0 * FAR * float(met.meeting.proportions.size.min(initial=np.inf))
    if met.compliance is not None or far or not len(held) or not len(there):
        return np.empty((0, 2), dtype=np.int64)
    size = met.meeting.proportions.size_at(held)
    meant = brought_back(held, end).gap
    place, known = places(there.identity, held.identity)
    off = np.where(known, np.abs(np.append(there.gap, 0.0)[place] - meant), np.inf)
    along, slid = ways(held, end - begin)
    wrong = (meant < BORNE * size) & (slid > np.maximum(SLID * size, along)) & (off > BENT * size) & ~held.cables
    return np.unique(np.sort(held.bodies[wrong], axis=1), axis=0)


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
    return bool(found.gap.min(where=of_pairs(found, pair[None]), initial=0.0) > -0.5 * (1.0 + DEEPER) * depth)


def _from_the_first(contacts: Contacts) -> FloatArray:
    """Normals (nc, d) as from the body of the larger number into the other, whichever is the slave."""
    return np.where(contacts.bodies[:, :1] < contacts.bodies[:, 1:], 1.0, -1.0) * contacts.frame[:, 0]


def _left_behind(met: Encounter, contacts: Contacts, end: FloatArray) -> BoolArray:
    """Which contacts (nc,) have points that are beside each other by more than `FAR` at positions (n_nodes, d) [m]; cables are
    where their ends are."""
    apart = np.einsum("ak,akd->ad", np.where(contacts.nodes < 0, 0.0, contacts.weights), end[contacts.nodes])
    beside = np.einsum("aid,ad->ai", contacts.frame[:, 1:], apart)
    return np.asarray((np.linalg.norm(beside, axis=1) > FAR * met.meeting.proportions.size_at(contacts)) & ~contacts.cables)


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
    turned = part * turns(model, moved) > TURNED * turns(model, begin)
    return found.take(~turned[found.bodies].any(axis=1))


def _closed(met: Encounter, contacts: Contacts, positions: FloatArray) -> Contacts:
    """Those of the contacts that `met` does not have and that are closed by what counts at positions (n_nodes, d) [m]."""
    known = places(met.meeting.contacts.identity, contacts.identity)[1]
    return contacts.take(_deep(met, contacts, positions) & ~known)


def _deep(met: Encounter, contacts: Contacts, positions: FloatArray) -> BoolArray:
    """Which contacts (nc,) are closed by what counts at positions (n_nodes, d) [m]."""
    return brought_back(contacts, positions).gap < -BORNE * met.meeting.proportions.size_at(contacts)
