"""Axes of supports that are not the world's: the components of vectors along them, node by node."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray
from fcsim.linear.sparse.short_indices import with_short_indices


@dataclass(frozen=True, eq=False)
class DofAxes:
    """Triples (2D: pairs) of degrees of freedom whose components are taken along axes of their own; all others along the world's.

    first (k,) ascending numbers of each triple's first dof; frame (k, d, d), its rows the axes, orthonormal. With T the orthogonal
    matrix of these blocks and ones, a vector x in world axes is T x along the supports' axes.
    """

    first: IntArray
    frame: FloatArray

    @property
    def _dofs(self) -> IntArray:
        return self.first[:, None] + np.arange(self.frame.shape[-1])

    def along(self, x: FloatArray) -> FloatArray:
        """T x for x (n_dofs,) in world axes."""
        y, dofs = x.copy(), self._dofs
        y[dofs] = np.einsum("kij,kj->ki", self.frame, x[dofs])
        return y

    def world(self, y: FloatArray) -> FloatArray:
        """T^T y for y (n_dofs,) along the supports' axes."""
        x, dofs = y.copy(), self._dofs
        x[dofs] = np.einsum("kij,ki->kj", self.frame, y[dofs])
        return x

    def matrix(self, begin: int, end: int) -> sp.csr_array:
        """The rows and columns begin ... end - 1 of T as a csr_array; no triple may lie across these bounds."""
        own = (self.first >= begin) & (self.first < end)
        dofs, frame, size, d = self._dofs[own] - begin, self.frame[own], end - begin, self.frame.shape[-1]
        rest = np.setdiff1d(np.arange(size), dofs.ravel())
        rows = np.concatenate([rest, np.repeat(dofs, d, axis=1).ravel()])
        columns = np.concatenate([rest, np.tile(dofs, (1, d)).ravel()])
        return with_short_indices(sp.csr_array((np.concatenate([np.ones(len(rest)), frame.ravel()]), (rows, columns)), shape=(size, size)))

    def blocks(self, begin: int, end: int, width: int) -> FloatArray | None:
        """The frames (n, width, width) of the consecutive groups of `width` dofs in begin ... end - 1; None where all are the world's.

        A group holds one triple (a node) or two (a rigid body: its centre and its rotation).
        """
        own = (self.first >= begin) & (self.first < end)
        if not own.any():
            return None
        d = self.frame.shape[-1]
        frames = np.tile(np.eye(width), ((end - begin) // width, 1, 1))
        group, place = np.divmod(self.first[own] - begin, width)
        for offset in np.unique(place):
            here = place == offset
            frames[group[here], offset : offset + d, offset : offset + d] = self.frame[own][here]
        return frames
