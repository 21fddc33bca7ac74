"""Gradients with respect to matrices: outer products, which are not formed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray, Matrix


@dataclass(frozen=True, eq=False)
class OuterProduct:
    """The matrix left right^T, left (k,), right (l,): the entry (i, j) says how the result changes with that entry of the data."""

    left: FloatArray
    right: FloatArray

    def dot(self, direction: Matrix) -> float:
        """sum_ij left_i right_j direction_ij: the change of the result for this change (k, l) of the matrix."""
        return float(self.left @ (direction @ self.right))

    def array(self) -> FloatArray:
        """All entries (k, l)."""
        return np.outer(self.left, self.right)
