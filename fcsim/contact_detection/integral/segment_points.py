"""The segment Gauss point rule: each Gauss point of an overlap of two facets is a contact of its own.

Its frame is that of the slave facet there, N = - n, its weights phi_k and - psi_l at the point (see `segment_to_segment`): 2 points a
segment in 2D; in 3D 3 in each triangle of the overlap, the centre alone where all facets are triangles (six and three where facets
are of second order). That is exact for the forces of a uniform pressure on triangles and parallelograms, so that the contact patch test
is passed on any two meshes.

Hyperstaticity: the points are many more than the nodes can tell apart. W is singular, the reactions at the points are not unique, though
what they do to the nodes is; methods that need W regular fail. Its rank is at most d (slave + master nodes in contact - fields that both
sides have, such as 1, x, y), see docs/contact_rules.md.

Balance: action and reaction are on one line along n, g apart: no resultant, and the moment g N x r, which is zero for closed contacts.

Source: K. A. Fischer and P. Wriggers 2005; G. Zavarise and P. Wriggers, A segment-to-segment contact strategy, Math. Comput. Modelling
28, 1998.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fcsim.arrays import IntArray
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.frames import frames
from fcsim.contact_detection.integral._overlap_kernels import MAX_CORNERS
from fcsim.contact_detection.integral.segment_to_segment import CENTRE, SIX_POINTS, THREE_POINTS, Configuration, SegmentToSegment
from fcsim.contact_detection.surfaces.facets import Facets
from fcsim.contact_detection.surfaces.surface import SurfacePair


class SegmentPoints(SegmentToSegment):
    """Contacts at Gauss points, sorted by (pair, slave facet, master facet, point); see `Detector`.

    Contacts are kept while -penetration * size <= gap <= alert, on segments of more than least_share of the smaller facet.
    identities (pairs,): how many different numbers the contacts of each pair can have.
    """

    def __init__(self, pairs: Sequence[SurfacePair], edge_tolerance: float, penetration: float) -> None:
        super().__init__(pairs, edge_tolerance, penetration)
        triangles = self.slaves.width == self.masters.width == 3
        second = self.slaves.parents is not None or self.masters.parents is not None
        self.rule = (THREE_POINTS if second else CENTRE) if triangles else SIX_POINTS if second else THREE_POINTS
        self.n_masters = np.diff(self.masters.offsets)
        self.points_a_segment = (MAX_CORNERS - 2) * max(len(self.rule[1]), len(THREE_POINTS[1]))
        self.identities = np.diff(self.slaves.offsets) * self.n_masters * self.points_a_segment

    def contacts(self, now: Configuration, slave: IntArray, master: IntArray) -> tuple[Contacts, IntArray]:
        """Contacts among the possible pairs of facets, and their surface pairs."""
        found = self.segments(now, slave, master)
        b = self.bulge(found)
        if b is not None:
            found = found._replace(gap=found.gap - b)
        smaller = np.minimum(now.slave.size[found.slave], now.master.size[found.master])
        normal, (twisted, turned), area = now.slave.normal[found.slave[found.row]], self.turned(now, found), found.weight
        if twisted.any():
            steep = np.sqrt(np.einsum("qd,qd->q", turned, turned))
            area = area.copy()
            area[twisted] *= steep
            turned /= steep[:, None]
            found.gap[twisted] *= np.einsum("qd,qd->q", turned, normal[twisted])
            normal[twisted] = turned
        wide = found.area > self.least_share * self.area(smaller)
        keep = wide[found.row] & (found.gap <= self.alert[self.pair_of_slave[found.slave]][found.row])
        keep &= found.gap >= -self.penetration * smaller[found.row]
        row = found.row[keep]
        slave, master = found.slave[row], found.master[row]
        pair = self.pair_of_slave[slave]
        local = (slave - self.slaves.offsets[pair]) * self.n_masters[pair] + master - self.masters.offsets[pair]
        contacts = Contacts(
            point=np.einsum("nk,nkd->nd", found.psi[keep], now.master.corners[master]),
            frame=frames(-normal[keep]),
            gap=found.gap[keep],
            mu=self.mu[pair],
            nodes=np.concatenate([_nodes(self.slaves)[slave], _nodes(self.masters)[master]], axis=1),
            weights=np.concatenate([self.slaves.shape(slave, found.phi[keep]), -self.masters.shape(master, found.psi[keep])], axis=1),
            bodies=np.stack([self.slaves.bodies[slave], self.masters.bodies[master]], axis=1),
            identity=local * self.points_a_segment + found.number[keep],
            area=area[keep],
        )
        if b is None:
            return contacts, pair
        return replace(contacts, bulge=contacts.along_normals(now.x) - contacts.gap), pair


def _nodes(facets: Facets) -> IntArray:
    """Nodes (nf, k) whose weights are the facets' `shape`, -1 = none."""
    return facets.nodes if facets.parents is None else facets.parents.nodes
