"""The coarse matrix of the two-level preconditioner, factored once and solved with many times by a kernel that goes through its fronts."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray
from fcsim.linear.fronts import Multifrontal
from fcsim.linear.joints import BlockRows
from fcsim.solvers.newton.systems.two_level._coarse_kernels import solve_fronts


class CoarseFactor:
    """S^-1 of a sparse S (n k, n k): LU by fronts in double precision, of which sweeps read the matrices in single precision."""

    def __init__(self, blocks: FloatArray, columns: IntArray, begins: IntArray) -> None:
        """blocks (nb, k, k): those of row i from begins[i] on, in ascending `columns`, a symmetric pattern with the diagonal;
        SingularMatrix where a front is singular."""
        n, k = len(begins) - 1, blocks.shape[1]
        rows = BlockRows(sp.bsr_array((blocks, columns, begins), shape=(n * k, n * k)), k)
        factor = Multifrontal(rows, np.broadcast_to(np.eye(k), (n, k, k)), np.zeros((n, k, k)), np.ones(n, dtype=bool))
        self._order, fronts = factor.contacts, list(factor.fronts)
        parts = [part.ravel() for _, _, inverse, F21, F12 in fronts for part in (F21, inverse, F12)]
        self._values = np.concatenate([np.empty(0), *parts], dtype=np.float32)
        self._sizes = np.array([(own.stop - own.start, len(border)) for own, border, *_ in fronts], dtype=np.int64).reshape(-1, 2)
        self._borders = np.concatenate([np.empty(0, dtype=np.int64), *(border for _, border, *_ in fronts)])

    def solve(self, c: FloatArray) -> FloatArray:
        """S^-1 c (n, k) in single precision."""
        x = c[self._order].astype(np.float32).ravel()
        solve_fronts(self._values, self._sizes, self._borders, x)
        solution = np.empty(c.shape, dtype=np.float32)
        solution[self._order] = x.reshape(c.shape)
        return solution
