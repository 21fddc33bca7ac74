"""Gradients with respect to matrices: outer products, which are not formed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, Matrix
from fcsim.brief import shown
from fcsim.errors import InputError


def checked_change(value: Matrix, name: str, shape: tuple[int, int]) -> Matrix:
    """A change of a matrix, dense or sparse; InputError where it has another shape or no finite real numbers."""
    change = value if sp.issparse(value) else np.asarray(value)
    if change.shape != shape:
        raise InputError(f"{name}: expected a change of shape {shape}, got {shown(value)}")
    if change.dtype.kind not in "fiu":
        raise InputError(f"{name}: expected a change of real numbers, got values of type {change.dtype}")
    if not np.all(np.isfinite(change.data if sp.issparse(change) else change)):
        raise InputError(f"{name}: expected finite numbers, got NaN or infinity")
    return change


@dataclass(frozen=True, eq=False)
class OuterProduct:
    """The matrix left right^T, left (k,), right (l,): the entry (i, j) says how the result changes with that entry of the data."""

    left: FloatArray
    right: FloatArray

    def dot(self, direction: Matrix) -> float:
        """sum_ij left_i right_j direction_ij: the change of the result for this change (k, l) of the matrix."""
        return float(self.left @ (checked_change(direction, "direction", (len(self.left), len(self.right))) @ self.right))

    def array(self) -> FloatArray:
        """All entries (k, l)."""
        return np.outer(self.left, self.right)
