"""Contacts within flat faces of rigid bodies: points that springs per area need where all others are at the rim of a joint.

Two faces of one facet each meet at their corners: four springs k A / 4 there turn three times as stiffly as the joint does, k I. Where the
nodes of two flat faces cannot have the second moments of their overlap (`flat_faces`), nine points within that of each two facets (three
in 2D) are contacts, too (`points_within`), and all have areas that together have the sum, the centre and the second moments of the overlap.
The rim stays: what tips does so over its edge.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fcsim.arrays import BoolArray, FloatArray
from fcsim.contact_detection import Detection, Everything, innermost
from fcsim.contact_detection.contacts import Contacts, join
from fcsim.contact_detection.detection import Around
from fcsim.contact_detection.frames import frames
from fcsim.contact_law.areas.points_within import points_within
from fcsim.contact_law.cohesive import Cohesive
from fcsim.contact_law.compliant import Compliant
from fcsim.contact_law.law import Law
from fcsim.contact_law.proportions import Proportions
from fcsim.contact_law.table import LawTable


@dataclass(frozen=True, eq=False)
class WithinFaces(Around):
    """A detection and, where its law has springs per area, the points within flat faces of rigid bodies that they need, kept up to the gap
    alert (nbodies,) [m], and beside contacts that are as open."""

    law: Law
    proportions: Proportions
    alert: FloatArray

    def __call__(self, positions: FloatArray, displacement: FloatArray | None = None) -> Contacts:
        """Contacts at `positions` (n_nodes, d) [m], see `Detection`."""
        contacts = self.detection(positions, displacement)
        chosen = has_springs_by_area(self.law, contacts)
        patches = self.proportions.flat_patches(contacts, chosen, positions) if chosen.any() else None
        if patches is None or not (coarse := patches.coarse(patches.areas()) > 0).any():
            return contacts
        found, patch, identity = points_within(patches, coarse)
        reach, first = np.full(len(coarse), -np.inf), np.full(len(coarse), -1)
        first[patches.patch[::-1]] = patches.own[::-1]
        reach[patches.patch] = self.alert[contacts.bodies[patches.own]].min(axis=1)
        np.maximum.at(reach, patches.patch, contacts.gap[patches.own])
        facets, here = patches.faces.facets, patches.faces.now.slave
        slave, master = found.slave[found.row], found.master[found.row]
        points = Contacts(
            point=np.einsum("nk,nkd->nd", found.psi, here.corners[master]),
            frame=frames(-here.normal[slave]),
            gap=found.gap,
            mu=contacts.mu[first[patch]],
            nodes=np.concatenate([facets.nodes[slave], facets.nodes[master]], axis=1),
            weights=np.concatenate([found.phi, -found.psi], axis=1),
            bodies=np.stack([facets.bodies[slave], facets.bodies[master]], axis=1),
            identity=identity,
            area=found.weight,
        )
        shared = np.full(len(contacts), np.nan)
        shared[patches.own[coarse[patches.patch]]] = 0.0
        together = join([replace(contacts, area=shared), points.take(found.gap <= reach[patch])])
        return together.take(np.argsort(together.identity, kind="stable"))


def has_springs_by_area(law: object, contacts: Contacts) -> BoolArray:
    """Which contacts (nc,) have springs whose stiffness is per area."""
    if isinstance(law, LawTable):
        number = law.number_of(contacts)
        each = [has_springs_by_area(one, contacts) & (number == k) for k, one in enumerate(law.laws)]
        return np.asarray(np.any(each, axis=0))
    if isinstance(law, Compliant | Cohesive):
        return np.full(len(contacts), law.springs is not None and not law.springs.each)
    beside = getattr(law, "law", None)
    return np.zeros(len(contacts), dtype=bool) if beside is None else has_springs_by_area(beside, contacts)


def with_points_within_faces(detection: Detection, law: Law, proportions: Proportions) -> Detection:
    """The detection with the points within flat faces that its law needs: of `Everything`, which names no rule for its points."""
    every = innermost(detection)
    return WithinFaces(detection, law, proportions, every.lengths.alert) if isinstance(every, Everything) else detection
