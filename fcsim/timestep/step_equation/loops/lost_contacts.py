"""Contacts that a step of statics loses: what is seen at its beginning, is no contact at its end, and lies in the other body there.

A contact is found no deeper than a share of a facet. Where a long step carries a surface deeper, its contacts are gone, nothing pushes the
bodies apart any more, and what is left is an equilibrium: of bodies that stand in one another. Points that have left a body's surface
another way, over its edge or by lifting off, are outside of it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model
from fcsim.contact_detection.contacts import Contacts, join
from fcsim.timestep.encounter import Encounter
from fcsim.witness.depths import depths

DEEP = 5e-3
"""Of the smaller body's size: how deep a lost point lies at least; points of averages over facets are off the surface by less."""


class Lost(NamedTuple):
    """Names of the bodies, the depth [m] of the first one's deepest point in the second one, and that relative to the smaller's size."""

    slave: str
    master: str
    depth: float
    share: float

    def __str__(self) -> str:
        return (
            f"contacts are lost on the way: {self.slave!r} lies {self.depth:.3g} m deep in {self.master!r}, deeper than contacts are "
            "found; slide and press by less in a step"
        )


def lost(model: Model, began: Encounter, seen: Contacts, before: FloatArray, after: FloatArray) -> Lost | None:
    """Return what is lost of the contacts of a step's beginning where `seen` ones are found at the nodes' positions `after` (n_nodes, d)
    [m], `before` at the beginning; None where nothing is. Contacts of a body with itself are not looked at."""
    known = began.contacts if began.left is None else join([began.contacts, began.left])
    gone = known.take(~np.isin(known.identity, seen.identity) & (known.bodies[:, 0] != known.bodies[:, 1]))
    if not len(gone):
        return None
    own, other = (np.where((gone.nodes >= 0) & (sign * gone.weights > 0), sign * gone.weights, 0.0) for sign in (1, -1))
    (slave, moved), (_, turned) = (_means(part, gone, before, after) for part in (own, other))
    least = DEEP * began.meeting.proportions.size_at(gone)
    far = np.flatnonzero(np.linalg.norm(moved - turned, axis=1) > least)
    if not len(far):
        return None
    depth = depths(model, after, slave[far], gone.bodies[far, 1], least[far])
    k = int(np.argmax(depth))
    if depth[k] == 0:
        return None
    a, b = (model.bodies[int(i)].name for i in gone.bodies[far[k]])
    return Lost(a, b, float(depth[k]), float(DEEP * depth[k] / least[far[k]]))


def _means(weights: FloatArray, contacts: Contacts, before: FloatArray, after: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Weighted means of the contacts' nodes at the end, and how far they have moved, both (n, d) [m]."""
    shares = weights / np.maximum(weights.sum(axis=1), 1e-300)[:, None]
    begin, end = (np.einsum("ak,akd->ad", shares, x[contacts.nodes]) for x in (before, after))
    return end, end - begin
