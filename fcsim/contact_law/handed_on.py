"""What laws remember goes with a body of exact shape from one facet of a mesh to the next.

A ball on a mesh has its contact with a facet, an edge or a vertex, whose number is part of the contact's identity: where it slides or rolls
on, that contact is lost and another one begins, in the same place. The spring that sticks and the way slid are the same ones, though the
mesh has a line there. So a contact that carried in the step before and is not met any more leaves what it
remembers to one of the same two bodies that did not carry, and whose point is nearest, no farther off than

    |c_s - c_s^-| + |c_m - c_m^-| + WITHIN max(D, |p^- - c_s^-|)

with c the means of slave's and master's nodes, ^- in the step before, p the contact's point, D the size of the smaller body. Each gives
once and takes once, the nearest first. Contacts of other kinds keep their identity, and what they remember.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.surfaces.ragged import of_same_key
from fcsim.contact_law.law import Meeting, Outcome, Remembered, Variables
from fcsim.contact_law.proportions import Proportions

PLACE = "place"
"""The variable (nc, 2 + 3 d) of contacts that may hand on: slave, master, point, both bodies' means [m]; nan where a contact is to keep."""

WITHIN = 0.1
"""Of the smaller body's size, or of the arm from the slave's middle: by how much farther than both bodies a contact's point may move in a
step, since bodies turn and facets meet at angles."""

ALIKE = 0.99
"""Cosine between the normals of facets that a contact with a spring may come to within a step as though they were one."""


def places(meeting: Meeting, outcome: Outcome, kept: Remembered) -> dict[str, FloatArray]:
    """Where the contacts of a step are that carry and may come to another facet; nothing where none may, or nothing is remembered."""
    contacts = meeting.contacts
    over = contacts.over_facets
    if not kept.values or not over.any():
        return {}
    held = over & (outcome.r[:, 0] > 0)
    return {PLACE: np.where(held[:, None], _place(contacts, _centres(meeting.positions, meeting.proportions)), np.nan)}


def handed_on(variables: Variables | None, contacts: Contacts, positions: FloatArray, proportions: Proportions) -> Variables | None:
    """What is remembered, under the identities of the contacts that bodies have come to at positions (n_nodes, d) [m]; the same where none
    has come to another facet."""
    if variables is None or PLACE not in variables.values:
        return variables
    place = variables.values[PLACE]
    carrying = ~np.isnan(place[:, 0])
    lost = np.flatnonzero(carrying & ~np.isin(variables.identity, contacts.identity))
    if not len(lost):
        return variables
    new = np.flatnonzero(contacts.over_facets & ~np.isin(contacts.identity, variables.identity[carrying]))
    giver, taker = _nearest(place[lost], contacts.take(new), _centres(positions, proportions), proportions)
    if not len(giver):
        return variables
    taken = contacts.identity[new[taker]]
    identity = variables.identity.copy()
    identity[lost[giver]] = taken
    kept = np.flatnonzero(~np.isin(variables.identity, taken))  # what takers had from before they were left is none of the comer's
    order = kept[np.argsort(identity[kept])]
    return Variables(
        identity[order], {name: values[order] for name, values in variables.values.items()}, variables.stored, variables.breaking
    )


def comes_after(held: Contacts, positions: FloatArray, there: Contacts, later: FloatArray, proportions: Proportions) -> BoolArray:
    """Which of the contacts `there`, where nodes are `later` (n_nodes, d) [m] in a step, are one of those `held` at `positions` that has
    come to another facet of the same face, or nearly: beside that one, which says as much, its spring would act twice."""
    after = np.zeros(len(there), dtype=bool)
    lost = held.take(held.over_facets & ~np.isin(held.identity, there.identity))
    new = np.flatnonzero(there.over_facets & ~np.isin(there.identity, held.identity))
    if len(lost) and len(new):
        place = _place(lost, _centres(positions, proportions))
        giver, taker = _nearest(place, there.take(new), _centres(later, proportions), proportions)
        alike = np.einsum("ad,ad->a", lost.frame[giver, 0], there.frame[new[taker], 0]) > ALIKE
        after[new[taker[alike]]] = True
    return after


def _place(contacts: Contacts, centres: FloatArray) -> FloatArray:
    return np.column_stack([contacts.bodies, contacts.point, centres[contacts.bodies].reshape(len(contacts), -1)])


def _nearest(before: FloatArray, new: Contacts, centres: FloatArray, proportions: Proportions) -> tuple[IntArray, IntArray]:
    """Which of the places `before` (n, 2 + 3 d) and which of the new contacts belong together, as two lists (k,)."""
    d = new.dimension
    bodies, point, then = before[:, :2].astype(np.int64), before[:, 2 : 2 + d], before[:, 2 + d :].reshape(-1, 2, d)
    count = len(centres)
    taker, giver = of_same_key(bodies[:, 0] * count + bodies[:, 1], new.bodies[:, 0] * count + new.bodies[:, 1])
    moved = np.linalg.norm(centres[bodies] - then, axis=2).sum(axis=1)
    size = np.maximum(proportions.size[bodies].min(axis=1, initial=np.inf), np.linalg.norm(point - then[:, 0], axis=1))
    distance = np.linalg.norm(new.point[taker] - point[giver], axis=1)
    near = np.flatnonzero(distance <= (moved + WITHIN * size)[giver])
    order = near[np.lexsort((taker[near], giver[near], distance[near]))]
    pairs: list[IntArray] = []
    while len(order):  # those that are nearest to each other, then among the rest: a round or two
        of_givers, of_takers = (np.unique(side[order], return_index=True)[1] for side in (giver, taker))
        first = np.intersect1d(of_givers, of_takers)
        pairs.append(order[first])
        used = np.isin(giver[order], giver[pairs[-1]]) | np.isin(taker[order], taker[pairs[-1]])
        order = order[~used]
    chosen = np.concatenate([np.empty(0, dtype=np.int64), *pairs])
    return giver[chosen], taker[chosen]


def _centres(positions: FloatArray, proportions: Proportions) -> FloatArray:
    """The mean (nbodies, d) [m] of each body's nodes."""
    first = proportions.first
    mean: FloatArray = np.add.reduceat(positions, first) / np.diff(np.append(first, len(positions)))[:, None]
    return mean
