"""The result of detection: contacts as arrays of points, frames, gaps, nodes and weights."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Contacts:
    """nc contacts in d dimensions; the normal points from the master surface to the slave candidate.

    point    (nc, d) [m] foot point on the master surface
    frame    (nc, d, d)  rows N, T1[, T2]: orthonormal, right-handed
    gap      (nc,) [m]   (candidate - foot point) . N, negative = penetration
    mu       (nc,)       Coulomb friction coefficient
    nodes    (nc, k)     global node numbers, -1 = none
    weights  (nc, k)     + shape functions on the slave's nodes, - shape functions on the master's; they sum to zero
    bodies   (nc, 2)     body numbers (slave, master)
    identity (nc,)       the same number for the same (pair, candidate, master body) at every step: what a warm start matches
    """

    point: FloatArray
    frame: FloatArray
    gap: FloatArray
    mu: FloatArray
    nodes: IntArray
    weights: FloatArray
    bodies: IntArray
    identity: IntArray

    def __len__(self) -> int:
        return len(self.gap)

    @property
    def dimension(self) -> int:
        return self.frame.shape[-1]

    def take(self, chosen: NDArray[np.bool_] | IntArray) -> Contacts:
        """Return the chosen contacts (a mask (nc,) or numbers)."""
        return Contacts(*(getattr(self, field.name)[chosen] for field in fields(self)))
