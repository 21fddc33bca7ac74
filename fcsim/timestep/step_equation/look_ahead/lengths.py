"""What counts where a step leads: contacts by their numbers, lengths and turns of what moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.contact_detection import Detection, ExactContacts, innermost
from fcsim.contact_detection.contacts import Contacts, join
from fcsim.contact_detection.sweep import brought_back
from fcsim.contact_law.handed_on import comes_after
from fcsim.timestep.encounter import Encounter

BORNE = 1e-5
"""Of the smaller body's size: less overlap than this is left to the next step."""

THROWN = 1e-3
"""Of the smaller body's size: a contact that is carried farther than meant, since what bent it did not come about, is bent less."""

SLID, BENT = 1e-2, 1e-4
"""Of the smaller body: what slides by less in a load step has the contacts of its beginning; gaps that are off by less are as meant."""

TURNED = 0.2
"""A turn [rad] within which what is met along a straight way is met."""

_BODIES = 1 << 31  # more than there are


def places(known: IntArray, wanted: IntArray) -> tuple[IntArray, BoolArray]:
    """Where the numbers `wanted` stand among the ascending `known` ones, len(known) for those that do not, and which do."""
    place = np.searchsorted(known, wanted)
    there = np.append(known, -1)[place] == wanted
    return np.where(there, place, len(known)), there


def moves(met: Encounter, moved: FloatArray) -> bool:
    """Whether nodes' displacements (n_nodes, d) [m] differ by a length that counts."""
    smallest = float(met.meeting.proportions.size.min(initial=np.inf))
    return bool(np.ptp(moved, axis=0).max(initial=0.0) > BORNE * smallest)


def turns(model: Model, moved: FloatArray) -> FloatArray:
    """The largest motion (nbodies,) [m] of a body's nodes beside their mean one, of their motions (n_nodes, d); of places half its size."""
    own = np.diff(model.node_offset)
    some, first = np.flatnonzero(own), model.node_offset[:-1][own > 0]
    mean = np.add.reduceat(moved, first, axis=0) / own[some, None]
    beside = np.abs(moved - np.repeat(mean, own[some], axis=0)).max(axis=1)
    turns = np.zeros(len(own))
    turns[some] = np.maximum.reduceat(beside, first)
    return turns


def back_at(begin: FloatArray, detection: Detection, contacts: Contacts, later: FloatArray) -> Contacts:
    """Contacts found at `later` (n_nodes, d) [m] as they stand at `begin`, see `brought_back`; those of exact shapes with the weights of
    points that touched in the same place there, see `ExactContacts.rolled_back`. Cables have no such points."""
    within = innermost(detection)
    if not isinstance(within, ExactContacts):
        return brought_back(contacts, begin)
    cables = contacts.cables
    if not cables.any():
        return within.on_their_master(brought_back(within.rolled_back(contacts, later, begin), begin), begin)
    bodies, width = contacts.take(~cables), 2 * (contacts.dimension + 1)  # cables on surfaces may have more nodes
    bodies = replace(bodies, nodes=bodies.nodes[:, :width], weights=bodies.weights[:, :width])
    return join([back_at(begin, detection, bodies, later), brought_back(contacts.take(cables), begin)])


def of_other_facets(met: Encounter, there: Contacts, later: FloatArray) -> BoolArray:
    """Which of the contacts `there`, at `later` (n_nodes, d) [m], are contacts with springs that have come to another facet: (nc,)."""
    if met.compliance is None:
        return np.zeros(len(there), dtype=bool)
    meeting = met.meeting
    return comes_after(meeting.contacts, meeting.positions, there, later, meeting.proportions)


def ways(contacts: Contacts, moved: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How far (nc,) [m] contacts go along their normals and beside them as nodes move by `moved` (n_nodes, d) [m]."""
    way = np.einsum("ak,akd->ad", np.where(contacts.nodes < 0, 0.0, contacts.weights), moved[contacts.nodes])
    along, *beside = np.einsum("aid,ad->ia", contacts.frame, way)
    return np.abs(along), np.linalg.norm(beside, axis=0)


def of_pairs(contacts: Contacts, pairs: IntArray) -> BoolArray:
    """Which contacts (nc,) are those of the pairs of bodies (n, 2), the smaller number first."""
    own, sought = (bodies[:, 0] * _BODIES + bodies[:, 1] for bodies in (np.sort(contacts.bodies, axis=1), pairs))
    return np.asarray(np.isin(own, sought))
