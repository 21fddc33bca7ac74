"""What laws remember goes with a body of exact shape from one facet of a mesh to the next.

A ball on a mesh has its contact with a facet, an edge or a vertex, whose number is part of the contact's identity: where it slides or rolls
on, that contact is lost and another one begins, in the same place. The spring that sticks and the way slid are the same ones, though the
mesh has a line there. So a contact that carried in the step before and is not met any more leaves what it
remembers to one of the same two bodies that did not carry, and whose point is nearest, no farther off than

    |c_s - c_s^-| + |c_m - c_m^-| + WITHIN max(D, |p^- - c_s^-|)

with c the means of slave's and master's nodes, ^- in the step before, p the contact's point, D the size of the smaller body. Each gives
once and takes once, the nearest first.

Contacts of meshed bodies keep their identity as they slide over facets, but a corner that is drawn over the edge of what bears it leaves
its place to the crossing of two edges: there springs go on, too, where they are all that is remembered beside the way slid (`SPRINGS`) and
both normals are nearly the same. Contacts of other kinds keep their identity, and what they remember.

Where corners of two meshed bodies lie on each other, as of equal boxes, the contact is that of either corner on the other body's face, or
of two of their edges, by the last digits of their places. So a bonded joint there belongs to the two corners (`CORNERS`): another contact
of the same two takes its place where it is lost, and is none beside it.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.contacts import EXACT, Contacts
from fcsim.contact_law.law import Meeting, Outcome, Remembered, Variables
from fcsim.contact_law.proportions import Proportions
from fcsim.mesh.curves.ragged import of_same_key

PLACE = "place"
"""The variable (nc, 2 + 4 d) of contacts that may hand on: slave, master, point, both bodies' means [m], normal as from the body of the
larger number; nan where a contact is to keep."""
CORNERS = "corners"
"""The variable (nc, 2 + d) of joints: the nodes of slave and master whose corners lie on each other, the normal as in `PLACE`; or nan."""
SPRINGS = frozenset(("stretch", "attitude", "slip", "rate", "seat"))
"""What contacts of meshed bodies remember that hand it on: damage and ages stay where they came about."""

WITHIN = 0.1
"""Of the smaller body's size, or of the arm from the slave's middle: by how much farther than both bodies a contact's point may move in a
step, since bodies turn and facets meet at angles."""

ON_EACH_OTHER = 1e-3
"""Of a facet's side: how far from the other's corner one that lies on it is at the most."""

ALIKE = 0.99
"""Cosine between the normals of facets that a contact with a spring may come to within a step as though they were one."""


def places(meeting: Meeting, outcome: Outcome, kept: Remembered) -> dict[str, FloatArray]:
    """Where the contacts of a step are that carry and may come to another facet; nothing where none may, or nothing is remembered."""
    contacts = meeting.contacts
    over = _may(contacts, "stretch" in kept.values and SPRINGS.issuperset(kept.values))
    if not kept.values or not over.any():
        return {}
    held = over & (outcome.r[:, 0] > 0)
    return {PLACE: np.where(held[:, None], _place(contacts, _centres(meeting.positions, meeting.proportions)), np.nan)}


def handed_on(variables: Variables | None, contacts: Contacts, positions: FloatArray, proportions: Proportions) -> Variables | None:
    """What is remembered, under the identities of the contacts that bodies have come to at positions (n_nodes, d) [m]; the same where none
    has come to another facet."""
    if variables is not None and CORNERS in variables.values:
        variables = _with_corners(variables, contacts)
    if variables is None or PLACE not in variables.values:
        return variables
    place = variables.values[PLACE]
    carrying = ~np.isnan(place[:, 0])
    lost = np.flatnonzero(carrying & ~np.isin(variables.identity, contacts.identity))
    if not len(lost):
        return variables
    may = _may(contacts, bool((variables.identity[lost] < EXACT).any()))
    new = np.flatnonzero(may & ~np.isin(contacts.identity, variables.identity[carrying]))
    exact = variables.identity[lost] >= EXACT
    giver, taker = _nearest(place[lost], exact, contacts.take(new), _centres(positions, proportions), proportions)
    if not len(giver):
        return variables
    swapped = place[lost[giver], 0] != contacts.bodies[new[taker], 0]
    return _renamed(variables, lost[giver], contacts.identity[new[taker]], swapped)


def corners_of(contacts: Contacts) -> FloatArray:
    """(nc, 2 + d) as `CORNERS`."""
    nodes, weights = contacts.nodes, np.where(contacts.nodes < 0, 0.0, contacts.weights)
    rows = np.arange(len(contacts))
    slave, master = weights.argmax(axis=1), weights.argmin(axis=1)
    found = np.column_stack([nodes[rows, slave], nodes[rows, master], _from_the_first(contacts)])
    found[np.minimum(weights[rows, slave], -weights[rows, master]) < 1 - ON_EACH_OTHER] = np.nan
    return found


def beside_joints(contacts: Contacts, holding: BoolArray) -> BoolArray:
    """Which contacts (nc,) are of two corners that lie on each other and have one that is `holding` (nc,), or an earlier one."""
    corners = corners_of(contacts)
    order = np.lexsort((~holding, np.isnan(corners[:, 0])))
    one, other = _same_corners(corners[order], corners[order])
    beside = np.zeros(len(contacts), dtype=bool)
    beside[order[other[one < other]]] = True
    return beside & ~holding


def _with_corners(variables: Variables, contacts: Contacts) -> Variables:
    """The variables with joints of corners under the identities of the contacts that these have now."""
    corners, met = variables.values[CORNERS], corners_of(contacts)
    lost = np.flatnonzero(~np.isnan(corners[:, 0]) & ~np.isin(variables.identity, contacts.identity))
    new = np.flatnonzero(~np.isin(contacts.identity, variables.identity[~np.isnan(corners[:, 0])]))
    giver, taker = _same_corners(corners[lost], met[new])
    giver, first = np.unique(giver, return_index=True)
    taker, once = np.unique(taker[first], return_index=True)
    giver, taker = lost[giver[once]], new[taker]
    if not len(giver):
        return variables
    return _renamed(variables, giver, contacts.identity[taker], corners[giver, 0] != met[taker, 0])


def _same_corners(one: FloatArray, other: FloatArray) -> tuple[IntArray, IntArray]:
    """Which of the places (n, 2 + d) and (m, 2 + d) as `CORNERS` are of the same two nodes, in any order, with nearly the same normal."""
    known, among = (np.flatnonzero(~np.isnan(places[:, 0])) for places in (one, other))
    keys = []
    for places in (one[known], other[among]):
        nodes = np.sort(places[:, :2].astype(np.int64), axis=1)
        keys.append(nodes[:, 0] * 2**31 + nodes[:, 1])
    second, first = of_same_key(*keys)
    first, second = known[first], among[second]
    alike = np.einsum("ad,ad->a", one[first, 2:], other[second, 2:]) > ALIKE
    return first[alike], second[alike]


def _renamed(variables: Variables, giver: IntArray, taken: IntArray, swapped: BoolArray) -> Variables:
    """The variables with the identities `taken` (k,) for those in the places `giver` (k,), `swapped` ones with slave for master."""
    identity = variables.identity.copy()
    identity[giver] = taken
    kept = np.flatnonzero(~np.isin(variables.identity, taken))  # what takers had from before they were left is none of the comer's
    order = kept[np.argsort(identity[kept])]
    values = variables.values if not swapped.any() else _other_way_round(variables.values, giver[swapped])
    return Variables(identity[order], {name: value[order] for name, value in values.items()}, variables.stored, variables.breaking)


def _other_way_round(values: Mapping[str, FloatArray], those: IntArray) -> dict[str, FloatArray]:
    """The variables with those contacts' slave for their master: the stretch is the slave's way beside the master."""
    changed = {name: value.copy() for name, value in values.items()}
    if "stretch" in changed:
        changed["stretch"][those] *= -1.0
    if "attitude" in changed:
        changed["attitude"][those] = np.roll(changed["attitude"][those], changed["attitude"].shape[1] // 2, axis=1)
    return changed


def may_come_after(variables: Variables | None, contacts: Contacts, positions: FloatArray, proportions: Proportions) -> BoolArray:
    """Which contacts (nc,) of meshed bodies, met on the way to come, are beside one with a spring and may take its place."""
    near = np.zeros(len(contacts), dtype=bool)
    if variables is None or PLACE not in variables.values:
        return near
    place = variables.values[PLACE]
    carrying = np.flatnonzero(~np.isnan(place[:, 0]) & (variables.identity < EXACT))
    new = np.flatnonzero((contacts.identity < EXACT) & ~np.isin(contacts.identity, variables.identity))
    if len(carrying) and len(new):
        meshed = np.zeros(len(carrying), dtype=bool)
        _, taker = _nearest(place[carrying], meshed, contacts.take(new), _centres(positions, proportions), proportions)
        near[new[taker]] = True
    return near


def comes_after(held: Contacts, positions: FloatArray, there: Contacts, later: FloatArray, proportions: Proportions) -> BoolArray:
    """Which of the contacts `there`, where nodes are `later` (n_nodes, d) [m] in a step, are one of those `held` at `positions` that has
    come to another facet of the same face, or nearly, or, of meshed bodies, is closed and leaves its face: beside that one, which says as
    much, its spring would act twice."""
    after = np.zeros(len(there), dtype=bool)
    lost = held.take((held.over_facets | _may(held, True) & (held.gap < 0)) & ~np.isin(held.identity, there.identity))
    new = np.flatnonzero(_may(there, True) & ~np.isin(there.identity, held.identity))
    if len(lost) and len(new):
        place = _place(lost, _centres(positions, proportions))
        giver, taker = _nearest(place, lost.identity >= EXACT, there.take(new), _centres(later, proportions), proportions)
        alike = np.einsum("ad,ad->a", _from_the_first(lost)[giver], _from_the_first(there)[new[taker]]) > ALIKE
        after[new[taker[alike]]] = True
    return after


def _may(contacts: Contacts, meshed: bool) -> BoolArray:
    """Which contacts (nc,) may come to another identity: exact shapes on meshes, and, of springs, those of meshed bodies."""
    return contacts.over_facets | (meshed & (contacts.identity < EXACT))


def _place(contacts: Contacts, centres: FloatArray) -> FloatArray:
    means = centres[contacts.bodies].reshape(len(contacts), -1)
    return np.column_stack([contacts.bodies, contacts.point, means, _from_the_first(contacts)])


def _from_the_first(contacts: Contacts) -> FloatArray:
    return np.where(contacts.bodies[:, :1] < contacts.bodies[:, 1:], 1.0, -1.0) * contacts.frame[:, 0]


def _nearest(
    before: FloatArray, exact: BoolArray, new: Contacts, centres: FloatArray, proportions: Proportions
) -> tuple[IntArray, IntArray]:
    """Which of the places `before` (n, 2 + 4 d), of exact shapes or not (n,), and of the new contacts belong together, two lists (k,)."""
    d = new.dimension
    bodies, point, then = before[:, :2].astype(np.int64), before[:, 2 : 2 + d], before[:, 2 + d : 2 + 3 * d].reshape(-1, 2, d)
    count = len(centres)
    own, others = (
        np.where(kind[:, None], pair, np.sort(pair, axis=1)) for kind, pair in ((exact, bodies), (new.identity >= EXACT, new.bodies))
    )
    taker, giver = of_same_key(own[:, 0] * count + own[:, 1], others[:, 0] * count + others[:, 1])
    same = exact[giver] == (new.identity[taker] >= EXACT)
    along = np.einsum("pd,pd->p", before[giver, 2 + 3 * d :], _from_the_first(new)[taker])
    same &= exact[giver] | (along > ALIKE)
    taker, giver = taker[same], giver[same]
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
