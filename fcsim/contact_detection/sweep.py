"""Contacts that are met on the way: detection along the motion of a step, brought back to its beginning.

A contact found at x + t dx, 0 < t <= 1, with weights c_k on nodes k and normal N holds at x with the gap g = N . sum_k c_k x_k. The law
0 <= g + h u_N then stops the bodies where they meet, in the one step in which they would have passed each other. (The idea is that of
speculative contacts, E. Catto, "Continuous collision", Game Developers Conference 2013; here what is speculated on is found by sampling
the motion, so that the facet is the one that is hit and not the one that is nearest before.)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.contacts import Contacts, join
from fcsim.errors import InputError

_BODIES = 1 << 31  # more than there are
_LEAST_AREA = 1e-6  # of its own that a contact keeps
_MOST = 1000  # samples of one step: more means a step that is far too long for its bodies


def samples(distance: float, spacing: float) -> int:
    """How many positions of a motion of `distance` [m] leave no more than `spacing` [m] between two.

    InputError where they are more than a thousand.
    """
    count = np.ceil(distance / spacing) if distance > 0 else 0
    if not count <= _MOST:
        raise InputError(
            f"contact detection: expected bodies that may meet to approach by less than {_MOST} facets in one step, got {distance:.3g} m "
            f"for facets of {spacing:.3g} m: shorten the step"
        )
    return int(count)


def with_swept(
    now: Contacts,
    detect: Callable[[float], Contacts],
    positions: FloatArray,
    displacement: FloatArray,
    times: FloatArray,
    alert: float,
    body_of: IntArray | None = None,
    passing: Callable[[Contacts], FloatArray] | None = None,
) -> Contacts:
    """Return the contacts `now` and those that `detect` finds at `times` (n,), 0 ... 1, along the way, sorted by identity.

    Of one identity that counts which was found nearest to where it closes; what is in contact now stays as it is. One that would still be
    open by more than `alert` [m] at the end of the motion is left out, and so is what a vertex that has gone through a face seen before
    touches from within: deep inside, the nearest face is not the one by which it came. Edges go through as well: what lies deeper at the
    beginning than anything of the same two bodies does, by more than `alert`, and only opens along the motion, is the far side of what was
    gone through. body_of (n_nodes,): the nodes' bodies, where contacts have an area. passing: the gap (nc,) [m] of contacts beyond which
    at all times two bodies that do not touch `now` pass each other, and have none.
    """
    found, off, least = [now], [np.full(len(now), -1.0)], [(_pair(now), np.full(len(now), -np.inf))]
    through = np.empty(0, dtype=np.int64)
    most = np.zeros(len(positions))
    for t in times:
        there = detect(t)
        if body_of is not None:
            most = np.maximum(most, _areas_of_nodes(there, body_of))
        if passing is not None:
            least.append((_pair(there), there.gap - passing(there)))
        other = ~np.isin(there.identity, now.identity)
        if not other.any():
            continue
        there = there.take(other)
        there = there.take((there.gap >= 0) | ~np.isin(_passages(there), through).any(axis=1))
        closes = brought_back(there, positions + displacement).gap
        entered = there.take((there.gap >= 0) & (closes < 0) & (np.count_nonzero(_slaves(there), axis=1) == 1))
        through = np.union1d(through, _passages(entered)[_slaves(entered)])
        before = brought_back(there, positions)
        behind = (before.gap < deepest_of(now, before) - alert) & (closes > before.gap)
        meant = (closes <= alert) & ~behind
        found.append(before.take(meant))
        off.append(np.abs(there.gap)[meant])
    if len(found) == 1 and np.all(now.identity[1:] > now.identity[:-1]):
        return now
    every = join([now, *(bounded(swept, now) for swept in found[1:])])
    order = np.lexsort((np.concatenate(off), every.identity))
    identity = every.identity[order]
    order = order[np.append(True, identity[1:] != identity[:-1])[: len(order)]]
    if passing is not None:
        order = order[(order < len(now)) | ~_passes(_pair(every.take(order)), *map(np.concatenate, zip(*least, strict=True)))]
    every = every.take(order)
    return every if body_of is None else _with_areas_left(every, order >= len(now), most, body_of)


def _passes(sought: IntArray, pairs: IntArray, nearest: FloatArray) -> BoolArray:
    """Which of the pairs `sought` (n,), all of them among `pairs` (k,), are nowhere nearer than 0, by `nearest` (k,) [m] there."""
    known, number = np.unique(pairs, return_inverse=True)
    least = np.full(len(known), np.inf)
    np.minimum.at(least, number.ravel(), nearest)
    return np.asarray(least[np.searchsorted(known, sought)] > 0)


def with_met(held: Contacts, found: Contacts, there: Contacts, body_of: IntArray) -> Contacts:
    """Return both, by identity; found: those of `there`, where a step ends, and of its way that are not `held`, brought back."""
    every = join([held, found])
    order = np.argsort(every.identity, kind="stable")
    return _with_areas_left(every.take(order), order >= len(held), _areas_of_nodes(there, body_of), body_of)


def _with_areas_left(contacts: Contacts, met: BoolArray, most: FloatArray, body_of: IntArray) -> Contacts:
    """Return contacts of which those `met` (nc,) on the way have, of the area that their rule gives them, what the others leave of the
    largest area, `most` (n_nodes,), that their slave nodes have at one time: a surface that slides within a step meets other facets, or
    bodies, with the same part of it; what comes down elsewhere has all of its own, also where the bodies part on their other side."""
    if contacts.area is None or not met.any():
        return contacts
    given = contacts.area > 0
    here, later = (_areas_of_nodes(contacts.take(given & kind), body_of) for kind in (~met, met))
    left = np.where(here > 0, most - here, np.inf)
    share = np.clip(np.divide(left, later, out=np.ones(len(most)), where=later > 0), _LEAST_AREA, 1.0)
    weight = np.maximum(_slave_weights(contacts, body_of), 0.0) * np.maximum(most, 0.0)[contacts.nodes]  # corners of P2 have none
    total = weight.sum(axis=1)
    cut = np.divide((weight * share[contacts.nodes]).sum(axis=1), total, out=np.ones(len(contacts)), where=total > 0)
    return replace(contacts, area=np.where(given & met, contacts.area * cut, contacts.area))


def _areas_of_nodes(contacts: Contacts, body_of: IntArray) -> FloatArray:
    """The area (n_nodes,) [m^2; 2D: m] that each slave node has by the rule of its contacts, however others cut it."""
    if contacts.area is None:
        return np.zeros(len(body_of))
    share = _slave_weights(contacts, body_of) * np.maximum(contacts.area, 0.0)[:, None]
    return np.bincount(np.maximum(contacts.nodes, 0).ravel(), share.ravel(), len(body_of)).astype(np.float64, copy=False)


def _slave_weights(contacts: Contacts, body_of: IntArray) -> FloatArray:
    """Weights (nc, k) of the slave's nodes, of second order of both signs, 0 for others; of what folds on itself those > 0."""
    own = (contacts.nodes >= 0) & (body_of[contacts.nodes] == contacts.bodies[:, :1])
    alone = (contacts.bodies[:, 0] != contacts.bodies[:, 1])[:, None]
    return np.where(own & (alone | (contacts.weights > 0)), contacts.weights, 0.0)


def _slaves(contacts: Contacts) -> BoolArray:
    return np.asarray((contacts.nodes >= 0) & (contacts.weights > 0))


def _passages(contacts: Contacts) -> IntArray:
    """A number (nc, k) for each node of a contact and the body that it would enter, -1 = none; of a vertex on a facet for that alone."""
    slaves = _slaves(contacts)
    edges = (np.count_nonzero(slaves, axis=1) > 1)[:, None]
    into = np.where(slaves, contacts.bodies[:, 1:], contacts.bodies[:, :1])
    keys = contacts.nodes * _BODIES + into
    return np.where((contacts.nodes >= 0) & (slaves | edges), keys, -1)


def brought_back(contacts: Contacts, positions: FloatArray) -> Contacts:
    """Return contacts found elsewhere as they stand at `positions` (n_nodes, d) [m]: same weights and normals, gap and foot from there."""
    weights = np.where(contacts.nodes < 0, 0.0, contacts.weights)
    x = positions[contacts.nodes]
    gap = np.einsum("ad,ad->a", np.einsum("ak,akd->ad", weights, x), contacts.frame[:, 0])
    gap = gap if contacts.bulge is None else gap - contacts.bulge
    return replace(contacts, gap=gap, point=np.einsum("ak,akd->ad", contacts.on_master, x))


def bounded(contacts: Contacts, here: Contacts) -> Contacts:
    """Return contacts found elsewhere with gaps no deeper than the deepest of the same two bodies among those that are `here`.

    The normal of a face that turns is not yet that of where it was found: a gap brought back along it may be negative where nothing
    overlaps, and what nothing overlaps by is not to be borne.
    """
    return replace(contacts, gap=np.maximum(contacts.gap, deepest_of(here, contacts)))


def deepest_of(here: Contacts, contacts: Contacts) -> FloatArray:
    """The gaps (nc,) [m] of the deepest contacts `here` between the bodies of each of `contacts`, 0 where none is deep."""
    deepest = np.minimum(here.gap, 0.0)
    pair, first = np.unique(_pair(here), return_inverse=True)
    least = np.zeros(len(pair) + 1)
    np.minimum.at(least, first, deepest)
    place = np.searchsorted(pair, _pair(contacts))
    known = np.append(pair, -1)[place] == _pair(contacts)
    return np.where(known, least[place], 0.0)


def _pair(contacts: Contacts) -> IntArray:
    return np.asarray(contacts.bodies.min(axis=1) * _BODIES + contacts.bodies.max(axis=1), dtype=np.int64)
