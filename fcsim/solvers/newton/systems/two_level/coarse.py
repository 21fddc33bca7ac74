"""The coarse matrix of the two-level preconditioner: analysed once, factored for each A and B, solved with in each iteration."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.linear.elimination_tree import elimination_tree
from fcsim.linear.factors import SingularMatrix
from fcsim.solvers.newton.systems.two_level._coarse_kernels import eliminate, solve_fronts

PADDING = 0.15
"""Share of zeros in a front."""


class CoarsePattern:
    """Where S (n k, n k) has blocks (k, k), and the order of its elimination: columns (blocks,), ascending, those of row i from begins[i]
    on, a symmetric pattern with the diagonal."""

    def __init__(self, columns: IntArray, begins: IntArray) -> None:
        self.columns, self.begins = columns, begins
        n = len(begins) - 1
        row = np.repeat(np.arange(n), np.diff(begins))
        self.diagonal = np.flatnonzero(row == columns)
        self.mirror = np.searchsorted(row * n + columns, columns * n + row)
        tree = elimination_tree(begins, columns, PADDING)
        self.tree = (tree.order, tree.first, tree.starts, tree.rows)
        self.sizes = np.stack([np.diff(tree.first), np.diff(tree.starts)], axis=1)


class CoarseFactor:
    """S^-1 by fronts, in double precision: beside the stiffness of joints, inertia is round-off in single precision."""

    def __init__(self, pattern: CoarsePattern, S: FloatArray) -> None:
        """S (blocks, k, k): the blocks in the pattern's order; SingularMatrix where a front is singular."""
        k = S.shape[1]
        self._order, _, _, rows = pattern.tree
        self._sizes = k * pattern.sizes
        self._borders = (k * rows[:, None] + np.arange(k)).ravel()
        own, border = self._sizes.T
        self._values = np.empty(int(np.sum(own * (own + 2 * border))))
        try:
            eliminate(pattern.tree, pattern.begins, pattern.columns, pattern.mirror, S, self._values)
        except np.linalg.LinAlgError:
            raise SingularMatrix("the bodies' motions on their joints are singular") from None

    def solve(self, c: FloatArray) -> FloatArray:
        """S^-1 c (n, k)."""
        x = c[self._order].astype(np.float64).ravel()
        solve_fronts(self._values, self._sizes, self._borders, x)
        solution = np.empty_like(c)
        solution[self._order] = x.reshape(c.shape)
        return solution
