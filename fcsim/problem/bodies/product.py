"""Products with W body by body, h C (h^T x), in the place of W's block rows: bodies that share C are columns of one product of matrices.

C of one part serves all its bodies from the cache; W's block rows, hundreds of megabytes for a wall of many hundred bricks, come from
memory.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.problem.bodies._shares_kernels import gather_forces, spread_velocities, sum_of_pairs
from fcsim.problem.bodies.shares import BodyShares
from fcsim.threads import pieces, side_by_side

OPERATIONS_A_PIECE = 2_000_000
"""Of products with a compliance that one thread takes: a tenth of a millisecond."""


class ShareProduct:
    """x (m,) -> W x, body by body: h C (h^T x), bodies of one compliance together."""

    def __init__(self, shares: BodyShares, side: IntArray) -> None:
        """side (pairs,): see `BodyShares.bodies`."""
        self._shares = shares
        self._pairs = np.full((shares.nc, 2), -1)
        self._pairs[shares.contacts, side] = np.arange(len(shares.contacts))
        self._alike = []
        for begin, C, kind in shares.runs:
            for k in np.unique(kind):
                self._alike.append((begin + np.flatnonzero(kind == k), C[k]))

    def __call__(self, x: FloatArray) -> FloatArray:
        s, d = self._shares, self._shares.dimension
        x = np.ascontiguousarray(x).reshape(-1, d)
        of_pairs = np.zeros((len(s.contacts), d))
        h = (s.first, s.contacts, s.begins, s.unknowns, s.weights)
        cut = [(bodies[i:j], C) for bodies, C in self._alike for i, j in pieces(len(bodies), max(1, OPERATIONS_A_PIECE // (C.size or 1)))]
        side_by_side([partial(_add_bodies, h, bodies, C, x, of_pairs) for bodies, C in cut])
        return sum_of_pairs(self._pairs, of_pairs).ravel()


def _add_bodies(
    h: tuple[IntArray, IntArray, IntArray, IntArray, FloatArray], bodies: IntArray, C: FloatArray, x: FloatArray, of_pairs: FloatArray
) -> None:
    """Write h C h^T x of `bodies`, which share C, to their rows of of_pairs (pairs, d)."""
    forces = np.zeros((len(bodies), len(C)))
    gather_forces(*h, bodies, x, forces)
    spread_velocities(*h, bodies, forces @ C, of_pairs)
