"""The result of detection: contacts as arrays of points, frames, gaps, nodes and weights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.brief import brief
from fcsim.contact_detection._contact_matrix_kernels import along_normals

CABLES = 1 << 61
"""Identities of cables, which are contacts that pull, begin here (`fcsim.linkage.cables`): above those of all surfaces."""
WITHIN = 1 << 59
"""Identities of points within flat faces (`fcsim.contact_law.areas.within_faces`) begin here."""
EXACT, KIND = 1 << 60, 56
"""Identities of contacts with exact shapes (`ExactContacts`) begin at EXACT, above those of meshed bodies; 2^KIND for each kind."""
OVER_FACETS = {2: (2, 3, 5), 3: (4, 5, 7, 8)}
"""By dimension, the kinds of these whose identity has a facet, an edge or a vertex of a mesh that exact shapes roll and slide over: balls,
sides, (3D) rims, and vertices under them."""


@dataclass(frozen=True, eq=False)
class Contacts:
    """nc contacts in d dimensions; the normal points from the master surface to the slave candidate.

    point    (nc, d) [m] foot point on the master surface; of a mortar contact the weighted mean of the feet
    frame    (nc, d, d)  rows N, T1[, T2]: orthonormal, right-handed
    gap      (nc,) [m]   (candidate - foot point) . N = N . sum of weights times nodes, less the bulge; negative = penetration
    mu       (nc,)       Coulomb friction coefficient
    nodes    (nc, k)     global node numbers, -1 = none
    weights  (nc, k)     + shape functions on the slave's nodes, - shape functions on the master's; they sum to zero
    bodies   (nc, 2)     body numbers (slave, master)
    identity (nc,)       the same number for the same (pair, candidate, master body) at every step: what a warm start matches
    bulge    (nc,) [m]   how far curved surfaces stand out over the facets there, see `fcsim.mesh.curves.bulges`; None: flat
    area     (nc,) [m^2; 2D: m] that points of an integral rule stand for; 0 where points within the same flat face are to share it; nan, or
             None for all: see `Proportions.area_at`
    """

    point: FloatArray
    frame: FloatArray
    gap: FloatArray
    mu: FloatArray
    nodes: IntArray
    weights: FloatArray
    bodies: IntArray
    identity: IntArray
    bulge: FloatArray | None = None
    area: FloatArray | None = None

    __repr__ = brief

    def __len__(self) -> int:
        return len(self.gap)

    @property
    def dimension(self) -> int:
        return self.frame.shape[-1]

    @property
    def cables(self) -> BoolArray:
        """Which of them (nc,) are cables."""
        return np.asarray(self.identity >= CABLES)

    @property
    def within_faces(self) -> BoolArray:
        """Which of them (nc,) are points within flat faces, not of their nodes."""
        return np.asarray((self.identity >= WITHIN) & (self.identity < EXACT))

    @property
    def over_facets(self) -> BoolArray:
        """Which of them (nc,) are of an exact shape on a mesh: their identity is another one where the shape comes to another facet."""
        return np.isin((self.identity - EXACT) >> KIND, OVER_FACETS[self.dimension])

    @property
    def on_master(self) -> FloatArray:
        """Weights (nc, k) >= 0 of the foot point: minus the negative weights, which sum to 1 unless shape functions of second order have
        both signs; then scaled to that sum, so that they give a point among the master's nodes."""
        weights = np.where(self.nodes < 0, 0.0, -np.minimum(self.weights, 0.0))
        total = weights.sum(axis=1, keepdims=True)
        return np.where(np.abs(total - 1) > 1e-6, weights / np.where(total > 0, total, 1.0), weights)

    def along_normals(self, vectors: FloatArray) -> FloatArray:
        """N . (sum of weights times the nodes' vectors) (nc,) for vectors (n_nodes, d): how gaps change, or gaps with the bulge."""
        if self.dimension == 3 and vectors.dtype == np.float64:
            along: FloatArray = along_normals(self.nodes, self.weights, self.frame, vectors)
            return along
        weights = np.where(self.nodes < 0, 0.0, self.weights)
        return np.einsum("ak,akd,ad->a", weights, vectors[self.nodes], self.frame[:, 0])

    def take(self, chosen: NDArray[np.bool_] | IntArray) -> Contacts:
        """Return the chosen contacts (a mask (nc,) or numbers)."""
        there = [field.name for field in fields(self) if getattr(self, field.name) is not None]
        return Contacts(**{name: getattr(self, name)[chosen] for name in there})


def join(parts: Sequence[Contacts]) -> Contacts:
    """Concatenate contacts; the narrower lists of nodes are filled with -1, their weights with 0."""
    width = max(part.nodes.shape[1] for part in parts)

    def padded(array: NDArray, value: int) -> NDArray:
        return np.pad(array, ((0, 0), (0, width - array.shape[1])), constant_values=value)

    parts = [part for part in parts if len(part)] or parts[:1]  # most kinds of contact are there in no step of most scenes
    narrow = any(part.nodes.shape[1] < width for part in parts)
    wide = [replace(part, nodes=padded(part.nodes, -1), weights=padded(part.weights, 0)) for part in parts] if narrow else parts
    for name, none in (("bulge", 0.0), ("area", np.nan)):
        if any(getattr(part, name) is not None for part in wide):
            wide = [replace(part, **{name: np.full(len(part), none)}) if getattr(part, name) is None else part for part in wide]
    there = [field.name for field in fields(Contacts) if getattr(wide[0], field.name) is not None]
    return Contacts(**{name: np.concatenate([getattr(part, name) for part in wide]) for name in there})
