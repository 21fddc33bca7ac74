"""Overlaps of slave and master facets (segments) and Gauss points on them: what the integral rules `mortar` and `segments` share.

Both facets are projected on the slave facet's tangent plane along its normal n; where they overlap (in 2D an interval, in 3D a polygon,
cut into triangles) Gauss points x_s on the slave and x_m on the master stand opposite each other, x_m - x_s = g n, with the shape
functions phi_k of the slave facet and psi_l of the master facet there. The slave's normal in a point of a twisted quadrilateral is that of
the bilinear facet there (`turned`), for contacts to act along.

Sources: M. A. Puso and T. A. Laursen, A mortar segment-to-segment contact method for large deformation solid mechanics, CMAME 193, 2004;
K. A. Fischer and P. Wriggers, Frictionless 2D contact formulations for finite deformations based on the mortar method, Computational
Mechanics 36, 2005; D. A. Dunavant, High degree efficient symmetrical Gaussian quadrature rules for the triangle, IJNME 21, 1985.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.frames import frames
from fcsim.contact_detection.integral._overlap_kernels import gauss_points, overlap_polygons
from fcsim.contact_detection.surfaces import facets as contact_facets
from fcsim.contact_detection.surfaces.broad_phase import near_facets
from fcsim.contact_detection.surfaces.facets import FacetGeometry, Facets, corner_vectors
from fcsim.contact_detection.surfaces.surface import OPPOSING, SurfacePair
from fcsim.mesh.curves.bulges import heights

_SLIVER = 1e-12  # overlaps of a smaller part of the slave segment are round-off
_STEEPEST = 0.1  # n . n_0 of the steepest normal that a twisted facet has


def _symmetric(*orbits: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Barycentric coordinates and weights of a triangle's rule: for each (a, weight) the points (1 - 2a, a, a) in all orders."""
    points = np.concatenate([a + (1 - 3 * a) * np.eye(3) for a, _ in orbits])
    return points, np.repeat([weight for _, weight in orbits], 3)


CENTRE = np.full((1, 3), 1 / 3), np.ones(1)  # degree 1
THREE_POINTS = _symmetric((1 / 6, 1 / 3))  # degree 2
SIX_POINTS = _symmetric((0.445948490915965, 0.223381589678011), (0.091576213509771, 0.109951743655322))  # degree 4, Dunavant
TWO_POINTS = np.array([0.5 - 0.5 / np.sqrt(3), 0.5 + 0.5 / np.sqrt(3)])  # of [0, 1], weights 1/2: degree 3


class Configuration(NamedTuple):
    """Positions (n_nodes, d) [m] and the facets there."""

    x: FloatArray
    slave: FacetGeometry
    master: FacetGeometry


class Segments(NamedTuple):
    """Overlapping facets: slave, master (np,), area (np,) [m^2; 2D: m]; and Gauss points on them, in order:

    row (nq,) of the facet pair, number (nq,) among the points of the pair, weight (nq,) [m^2; 2D: m], gap (nq,) [m] along the slave's
    normal, phi (nq, ks), psi (nq, km).
    """

    slave: IntArray
    master: IntArray
    area: FloatArray
    row: IntArray
    number: IntArray
    weight: FloatArray
    gap: FloatArray
    phi: FloatArray
    psi: FloatArray


class SegmentToSegment(ABC):
    """Slave and master facets of `pairs` and their overlaps; what does not depend on positions is computed here once.

    edge_tolerance, relative to the facets' size: what covers less than its square of a node's or facet's area carries nothing.
    penetration: Gauss points count while |gap| <= max(alert, penetration * size), size that of the smaller facet.
    """

    rule: tuple[FloatArray, FloatArray]

    def __init__(self, pairs: Sequence[SurfacePair], edge_tolerance: float, penetration: float) -> None:
        self.pairs, self.penetration, self.least_share = tuple(pairs), penetration, edge_tolerance**2
        self.slaves = contact_facets.join([pair.slave for pair in pairs], sort=True)
        self.masters = contact_facets.join([pair.master for pair in pairs], sort=True)
        self.slave_sides, self.master_sides = ((f.nodes >= 0).sum(axis=1) for f in (self.slaves, self.masters))
        self.pair_of_slave = np.repeat(np.arange(len(pairs)), np.diff(self.slaves.offsets))
        self.slave_bulge, self.master_bulge = (self._bulge(facets) for facets in (self.slaves, self.masters))
        self.alert, self.mu = np.array([pair.alert for pair in pairs]), np.array([pair.mu for pair in pairs])

    def at(self, x: FloatArray) -> tuple[Contacts, IntArray]:
        """Contacts at positions x (n_nodes, d) [m], and their surface pairs."""
        now = self.configuration(x)
        return self.contacts(now, *self.search(now))

    @abstractmethod
    def contacts(self, now: Configuration, slave: IntArray, master: IntArray) -> tuple[Contacts, IntArray]:
        """Contacts among the possible pairs of facets, and their surface pairs."""

    def _bulge(self, facets: Facets) -> FloatArray | None:
        """How far the surface bulges over the facets that gaps are measured to."""
        return facets.bulge

    def bulge(self, found: Segments) -> FloatArray | None:
        """How far (nq,) [m] both surfaces stand out over the facets at the Gauss points; None where all is flat."""
        both = [
            heights(bulge, facet[found.row], shape)
            for bulge, facet, shape in ((self.slave_bulge, found.slave, found.phi), (self.master_bulge, found.master, found.psi))
            if bulge is not None
        ]
        return np.sum(both, axis=0) if both else None

    def configuration(self, x: FloatArray) -> Configuration:
        """The facets at positions x (n_nodes, d) [m]."""
        return Configuration(x, contact_facets.geometry(self.slaves, x), contact_facets.geometry(self.masters, x))

    def search(self, now: Configuration) -> tuple[IntArray, IntArray]:
        """Possible pairs (slave facet, master facet) in order."""
        found = []
        for number, alert in enumerate(self.alert):
            ours = slice(self.slaves.offsets[number], self.slaves.offsets[number + 1])
            theirs = slice(self.masters.offsets[number], self.masters.offsets[number + 1])
            size = np.minimum(now.master.size[theirs], now.slave.size[ours].max(initial=0.0))
            reach = now.master.radius[theirs] + np.maximum(alert, self.penetration * size)
            slave, master = near_facets(now.slave.centre[ours], now.slave.radius[ours], now.master.centre[theirs], reach)
            found.append((slave + ours.start, master + theirs.start))
        slave, master = (np.concatenate(part) for part in zip(*found, strict=True))
        other = self.slaves.bodies[slave] != self.masters.bodies[master]
        slave, master = slave[other], master[other]
        order = np.argsort(slave * len(self.masters.nodes) + master)
        return slave[order], master[order]

    def segments(self, now: Configuration, slave: IntArray, master: IntArray) -> Segments:
        """The overlaps among the possible pairs, with the Gauss points near enough to count."""
        size = np.minimum(now.slave.size[slave], now.master.size[master])
        reach = np.maximum(self.alert[self.pair_of_slave[slave]], self.penetration * size)
        sides = self.slave_sides, self.master_sides
        found = intervals(now, slave, master) if self.slaves.width == 2 else polygons(now, slave, master, reach, sides, self.rule)
        near = np.abs(found.gap) <= reach[found.row]
        if not near.all():
            found = Segments(*found[:3], *(array[near] for array in found[3:]))
        touched = np.zeros(len(slave), dtype=bool)
        touched[found.row] = True
        row = (np.cumsum(touched) - 1)[found.row]
        return found._replace(slave=slave[touched], master=master[touched], area=found.area[touched], row=row)

    def turned(self, now: Configuration, found: Segments) -> tuple[BoolArray, FloatArray]:
        """Which Gauss points (nq,) are on twisted slave facets; and their n / (n . n_0), the normal there over that of the facet: areas
        are those of its tangent plane."""
        twisted, vectors = corner_vectors(now.slave, found.slave)
        at = twisted[found.row]
        row = found.row[at]
        normal = np.einsum("qk,qkd->qd", found.phi[at], vectors[row])
        along = np.einsum("qd,qd->q", normal, now.slave.normal[found.slave[row]])
        return at, normal / np.maximum(along, _STEEPEST * np.sqrt(np.einsum("qd,qd->q", normal, normal)))[:, None]

    def area(self, size: FloatArray) -> FloatArray:
        """Areas (2D: lengths) of facets of that size."""
        return size if self.slaves.width == 2 else size**2


def polygons(
    now: Configuration,
    slave: IntArray,
    master: IntArray,
    reach: FloatArray,
    sides: tuple[IntArray, IntArray],
    rule: tuple[FloatArray, FloatArray],
) -> Segments:
    """Overlaps of pairs of facets in 3D not farther apart than reach (np,) [m]; sides: numbers of corners of all slaves, all masters."""
    frame = frames(now.slave.normal)
    ours = (now.slave.corners, sides[0], frame, now.slave.centre)
    theirs = (now.master.corners, sides[1])
    polygon, corners, area = overlap_polygons(slave, master, *ours, now.slave.size, *theirs, now.master.normal, OPPOSING, reach)
    count = np.maximum(corners - 2, 0) * len(rule[1])
    first = np.concatenate([[0], np.cumsum(count)])
    points = gauss_points(slave, master, polygon, corners, first, *ours, *theirs, *rule)
    row = np.repeat(np.arange(len(slave)), count)
    return Segments(slave, master, area, row, np.arange(len(row)) - first[row], *points)


def intervals(now: Configuration, slave: IntArray, master: IntArray, points: FloatArray = TWO_POINTS) -> Segments:
    """Overlaps in 2D, on the slave segments' lines, however far apart, and points of equal weights on them, places in [0, 1]."""
    length, ours, theirs = now.slave.size[slave], now.slave.corners[slave], now.master.corners[master]
    normal = now.slave.normal[slave]
    tangent = (ours[:, 1] - ours[:, 0]) / length[:, None]
    arm = theirs - ours[:, :1]
    place, height = np.einsum("nkd,nd->nk", arm, tangent), np.einsum("nkd,nd->nk", arm, normal)
    begin, end = np.maximum(place.min(axis=1), 0.0), np.minimum(place.max(axis=1), length)
    facing = np.einsum("nd,nd->n", normal, now.master.normal[master]) < OPPOSING
    row = np.flatnonzero(facing & (end - begin > _SLIVER * length))
    s = begin[row, None] + (end - begin)[row, None] * points
    t = (s - place[row, :1]) / (place[row, 1] - place[row, 0])[:, None]
    phi, psi = (np.stack([1 - z, z], axis=2).reshape(-1, 2) for z in (s / length[row, None], t))
    row, number = np.repeat(row, len(points)), np.tile(np.arange(len(points)), len(row))
    area = np.maximum(end - begin, 0.0)
    return Segments(slave, master, area, row, number, area[row] / len(points), np.einsum("nk,nk->n", psi, height[row]), phi, psi)
