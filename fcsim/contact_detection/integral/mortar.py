"""The mortar rules: a contact for each multiplier of the slave surface and master body, its gap averaged over what the body covers.

The multipliers' functions chi_j are the shape functions of the slave nodes ("mortar"), or 1 on each slave facet ("mortar-faces"). With
a_j = int chi_j over the covered part (`segment_to_segment` says where phi, psi, the gap g and the slave's normal n live)

    weights of the slave's nodes  int chi_j phi_k / a_j,   of the master's nodes  - int chi_j psi_l / a_j,   N_j = - int chi_j n / |.|

so that gap_j = N_j . int chi_j (x_s - x_m) / a_j is the weighted gap and r_j / a_j the multiplier, a traction.

Hyperstaticity: "mortar" has no more contacts than slave nodes, and W full rank, as long as a node is in one pair and over one body; a node
at the edge of two joints, or above the joint of two masters, has a contact in each, too many for its dofs if all its neighbours do alike
(a wall of bricks). "mortar-faces" has no more contacts than slave facets: the rule for such joints, as "faces" is among those of
node-to-segment; of triangles there are twice as many as nodes, and W is singular on meshes that match.

Balance: the weights sum to zero, so H r has no resultant. Its moment is sum_j d_j x r_j with d_j the mean of x_s - x_m: zero on flat closed
surfaces; on curved ones facets of size h are chords at a distance O(h^2) from each other with n off N_j by O(h), so d_j is off N_j by
O(h^3) and so is the lever of a closed contact's force (0 for "mortar-faces" on plane facets, whose N_j is - n).

Edges: only what the master covers counts, so the forces are continuous where the slave is drawn over the master's edge, but for the share
of a multiplier that loses its last cover: it acts at the edge until then. A node whose facets overlap two sides of one body has one
contact with the mean of both normals; see `split_at_sharp_edges`.

Patch test: a uniform pressure p gives the nodal forces p int phi_k and - p int psi_l to round-off on triangles and parallelograms, and
to the order of the Gauss rule (degree 4) on other quadrilaterals, whose shape functions are rational in the plane. Facets of second
order are cut into linear ones, whose chi_j are positive, while phi and psi are the shape functions of the facets themselves: a uniform
pressure passes there as tightly (M. A. Puso, T. A. Laursen, J. Solberg, CMAME 197, 2008).

Sources: Puso and Laursen 2004 (weighted gap; here the normal is averaged over the covered part only) and those of `segment_to_segment`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_array

from fcsim.arrays import FloatArray, IntArray
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.frames import frames
from fcsim.contact_detection.integral._overlap_kernels import mortar_sums
from fcsim.contact_detection.integral.segment_to_segment import SIX_POINTS, Configuration, Segments, SegmentToSegment
from fcsim.contact_detection.surfaces import facets as contact_facets
from fcsim.contact_detection.surfaces.facets import Facets
from fcsim.contact_detection.surfaces.surface import SurfacePair


class Mortar(SegmentToSegment):
    """Mortar contacts of slave nodes, sorted by (pair, slave node, master body); see `Detector`.

    A contact is kept while its gap <= alert and the body covers more than least_share of the multiplier's part of the surface.
    identities (pairs,): how many different numbers the contacts of each pair can have.
    """

    rule = SIX_POINTS

    def __init__(self, pairs: Sequence[SurfacePair], edge_tolerance: float, penetration: float) -> None:
        super().__init__(pairs, edge_tolerance, penetration)
        self.multiplier = self._multipliers()
        self.n_bodies = 1 + int(self.masters.bodies.max(initial=0))
        numbered = np.zeros(len(pairs), dtype=np.int64)  # multipliers are numbered pair after pair
        np.maximum.at(numbered, self.pair_of_slave, 1 + self.multiplier.max(axis=1, initial=-1))
        ends = np.maximum.accumulate(numbered)
        self.first = np.concatenate([[0], ends[:-1]])
        self.pair_of_multiplier = np.repeat(np.arange(len(pairs)), ends - self.first)
        self.identities = (ends - self.first) * self.n_bodies
        self.body_of_multiplier = np.zeros(len(self.pair_of_multiplier), dtype=np.int64)
        self.body_of_multiplier[self.multiplier] = self.slaves.bodies[:, None]

    def _multipliers(self) -> IntArray:
        """Numbers (nf, j) of the multipliers on each slave facet."""
        return contact_facets.topology(self.slaves).vertex

    def _functions(self, found: Segments) -> FloatArray:
        """Their functions chi (nq, j) at the Gauss points."""
        return found.phi

    def contacts(self, now: Configuration, slave: IntArray, master: IntArray) -> tuple[Contacts, IntArray]:
        """Contacts among the possible pairs of facets, and their surface pairs."""
        found = self.segments(now, slave, master)
        slave, master = found.slave, found.master
        phi, psi = self.slaves.shape(slave[found.row], found.phi), self.masters.shape(master[found.row], found.psi)
        share, own, others = mortar_sums(found.row, len(slave), found.weight, self._functions(found), phi, psi)
        key, row = np.unique(self.multiplier[slave] * self.n_bodies + self.masters.bodies[master][:, None], return_inverse=True)
        row = row.reshape(share.shape)
        size = _sum_by(row, share, len(key))
        multiplier, body = np.divmod(key, self.n_bodies)
        kept = size > self.least_share * self._full_size(now)[multiplier]

        normal = np.stack([_sum_by(row, part, len(key)) for part in self._normals(now, found, share)], axis=1)[kept]
        normal /= np.sqrt(np.einsum("nd,nd->n", normal, normal))[:, None]
        of_contact, shape = np.where(kept, np.cumsum(kept) - 1, -1)[row], (int(kept.sum()), len(now.x))
        nodes = self.slaves.moving_nodes[slave], self.masters.moving_nodes[master]
        weights = _rows(of_contact, np.concatenate([own, -others], axis=2), np.concatenate(nodes, axis=1), shape)
        weights.data *= np.repeat(1.0 / size[kept], np.diff(weights.indptr))
        if self.masters.parents is None and self.slaves.parents is None:
            on_master = csr_array((np.minimum(weights.data, 0.0), weights.indices, weights.indptr), shape=weights.shape)
            point = -(on_master @ now.x)
        else:  # shape functions of second order have both signs
            point = (_rows(of_contact, others, nodes[1], shape) @ now.x) / size[kept][:, None]
        gap, bulge = np.einsum("nd,nd->n", weights @ now.x, normal), self._mean_bulge(found, row, -now.slave.normal[slave], size)
        if bulge is not None:
            bulge = np.einsum("nd,nd->n", bulge[kept], normal)
            gap = gap - bulge
        near = gap <= self.alert[self.pair_of_multiplier[multiplier[kept]]]
        multiplier, body = multiplier[kept][near], body[kept][near]
        touched, padded = _padded(weights if near.all() else weights[near])
        pair = self.pair_of_multiplier[multiplier]
        contacts = Contacts(
            point=point[near],
            frame=frames(normal[near]),
            gap=gap[near],
            mu=self.mu[pair],
            nodes=touched,
            weights=padded,
            bodies=np.stack([self.body_of_multiplier[multiplier], body], axis=1),
            identity=(multiplier - self.first[pair]) * self.n_bodies + body,
            bulge=None if bulge is None else bulge[near],
            area=size[kept][near],
        )
        return contacts, pair

    def _normals(self, now: Configuration, found: Segments, share: FloatArray) -> list[FloatArray]:
        """- int chi_j n (np, j) of each pair of facets, by components; of twisted slaves n is that of the place."""
        facet = now.slave.normal[found.slave]
        parts = [share * -n[:, None] for n in facet.T]
        twisted, turned = self.turned(now, found)
        if twisted.any():
            row = found.row[twisted]
            chi = found.weight[twisted, None] * self._functions(found)[twisted]
            cell = row[:, None] * share.shape[1] + np.arange(share.shape[1])
            for part, n, mean in zip(parts, turned.T, facet[row].T, strict=True):
                part -= _sum_by(cell, chi * (n - mean)[:, None], share.size).reshape(share.shape)
        return parts

    def _bulge(self, facets: Facets) -> FloatArray | None:
        """Of facets of second order, whose own shape functions measure the gap, what is beyond their own curve."""
        if facets.bulge is None or facets.parents is None:
            return facets.bulge
        beyond = facets.parents.beyond
        return np.where((facets.parents.kind == 0)[:, None, None], facets.bulge, 0.0 if beyond is None else beyond)

    def _mean_bulge(self, found: Segments, row: IntArray, normal: FloatArray, size: FloatArray) -> FloatArray | None:
        """- int chi_j b n / a_j of each multiplier j that the rows (np, j) name, - n (np, d) the `normal`; None where all is flat."""
        b = self.bulge(found)
        if b is None:
            return None
        at_points = found.weight[:, None] * self._functions(found) * b[:, None]
        shares = np.broadcast_to(row[found.row], at_points.shape)
        along = [_sum_by(shares, at_points * n[:, None], len(size)) for n in normal[found.row].T]
        return np.stack(along, axis=1) / np.where(size > 0, size, 1.0)[:, None]

    def _full_size(self, now: Configuration) -> FloatArray:
        """About int chi_j over the whole slave surface: an equal share of each facet for each of its multipliers."""
        real = self.slaves.nodes[:, : self.multiplier.shape[1]] >= 0
        equal = np.broadcast_to((self.area(now.slave.size) / real.sum(axis=1))[:, None], real.shape)[real]
        return _sum_by(self.multiplier[real], equal, len(self.pair_of_multiplier))


class FaceMortar(Mortar):
    """Mortar contacts of slave facets (multipliers constant on each), sorted by (pair, slave facet, master body); see `Detector`."""

    def _multipliers(self) -> IntArray:
        return np.arange(len(self.slaves.nodes))[:, None]

    def _normals(self, now: Configuration, found: Segments, share: FloatArray) -> list[FloatArray]:
        """With the mean normal of a facet, its points lie on one line with the master's: no moment."""
        return [share * -n[:, None] for n in now.slave.normal[found.slave].T]

    def _functions(self, found: Segments) -> FloatArray:
        return np.ones((len(found.row), 1))


def _sum_by(row: IntArray, values: FloatArray, count: int) -> FloatArray:
    """Sums (count,) of the values of each row."""
    return np.bincount(row.ravel(), values.ravel(), minlength=count).astype(np.float64, copy=False)  # integers where there is no value


def _rows(row: IntArray, sums: FloatArray, nodes: IntArray, shape: tuple[int, int]) -> csr_array:
    """Sparse matrix of the sums (np, j, k) that belong to row (np, j), left out where it is -1, and node (np, k)."""
    i = np.broadcast_to(row[:, :, None], sums.shape)
    k = np.broadcast_to(nodes[:, None], sums.shape)
    real = (i >= 0) & (sums != 0.0)
    matrix = csr_array((sums[real], (i[real], k[real])), shape=shape)
    matrix.sum_duplicates()
    return matrix


def _padded(matrix: csr_array) -> tuple[IntArray, FloatArray]:
    """Nodes and weights (rows, k) of a sparse matrix, -1 and 0 where a row has fewer than k entries."""
    count = np.diff(matrix.indptr)
    real = np.arange(count.max(initial=0)) < count[:, None]
    nodes, weights = np.full(real.shape, -1), np.zeros(real.shape)
    nodes[real], weights[real] = matrix.indices, matrix.data
    return nodes, weights
