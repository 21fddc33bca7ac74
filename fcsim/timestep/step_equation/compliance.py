"""What stands for M^-1 in a step's problem: the model's factor, the compliance of joints, and W summed from the parts' compliances."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray, Matrix
from fcsim.assembly.compliance import SystemFactor
from fcsim.problem.delassus_sum import DelassusSum
from fcsim.timestep.step_equation._turned_rows_kernels import turned_rows


@dataclass(frozen=True, eq=False)
class StepCompliance:
    """The `MassFactor` of a step (see `fcsim.problem.reduction`): products with the few entries of H are all that a step adds.

    joint: (m,) the diagonal of C, u = H^T v + C r + w; None = rigid. The problem has an unknown of its own, C r, after the bodies'
    for each entry that is not zero, with C^-1 on the diagonal of M and 1 in H: so the problem that solvers and FCLIB files see is an
    ordinary one, and W = H^T M^-1 H + C.
    summed: W of this H where it is known already, from another right side of the step.
    """

    factor: SystemFactor
    joint: FloatArray | None = None
    summed: Matrix | None = None

    @cached_property
    def _soft(self) -> IntArray:
        """Which contact unknowns have a compliance."""
        return np.flatnonzero(self.joint) if self.joint is not None else np.empty(0, dtype=np.int64)

    @property
    def unknowns(self) -> int:
        """Number of the problem's unknowns."""
        model = self.factor.model
        return (len(model.free_dofs) if model.driven == "eliminated" else model.n_dofs) + len(self._soft)

    def matrix(self) -> sp.csr_array:
        """M of the problem."""
        matrix = self.factor.matrix()
        if self.joint is None:
            return matrix
        return sp.csr_array(sp.block_diag([matrix, sp.diags_array(1 / self.joint[self._soft])], format="csr"))

    def with_joints(self, H: sp.sparray) -> sp.sparray:
        """The problem's H (n, m) from that of the bodies' unknowns."""
        if self.joint is None:
            return H
        k = len(self._soft)
        return sp.csr_array(sp.vstack([H, sp.csr_array((np.ones(k), (np.arange(k), self._soft)), shape=(k, H.shape[1]))]))

    def load(self, f: FloatArray) -> FloatArray:
        """The problem's f (n,) from that of the bodies' unknowns."""
        return f if self.joint is None else np.concatenate([f, np.zeros(len(self._soft))])

    def bodies(self, v: FloatArray) -> FloatArray:
        """The bodies' unknowns of the problem's v (n,)."""
        return v if self.joint is None else v[: len(v) - len(self._soft)]

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Return M^-1 rhs for rhs (n,) of the problem's unknowns."""
        if self.joint is None:
            return self.factor.solve(rhs)
        own = len(rhs) - len(self._soft)
        return np.concatenate([self.factor.solve(rhs[:own]), self.joint[self._soft] * rhs[own:]])

    def delassus(self, H: sp.sparray, dimension: int) -> Matrix:
        """Return W = H^T M^-1 H (m, m) for H (n, m) on the problem's unknowns."""
        if self.summed is not None:
            return self.summed
        model = self.factor.model
        H = sp.csc_array(H if self.joint is None else sp.csr_array(H)[: H.shape[0] - len(self._soft)])
        if model.driven == "eliminated":
            H = sp.csc_array((H.data, model.free_dofs[H.indices], H.indptr), shape=(model.n_dofs, H.shape[1]))
        if self.factor.rotation is not None:
            H = self._in_frames(H)
        W = DelassusSum(H, *self.factor.places, len(model.bodies), dimension)
        for first, compliances, kind in self.factor.compliances():
            W.add(first, compliances, kind)
        matrix = W.matrix()
        return matrix if self.joint is None else _with_diagonal(matrix, self.joint, dimension)

    def _in_frames(self, H: sp.csc_array) -> sp.csc_array:
        """H along the supports' axes as they are in the axes of the bodies' compliances."""
        model = self.factor.model
        axes = model.axes_matrix
        H = H if axes is None else sp.csc_array(axes.T @ H)
        sizes = np.diff(model.node_offset[: len(model.deformable) + 1])
        if not H.has_sorted_indices:
            H = H.sorted_indices()
        body = np.repeat(np.arange(len(sizes)), sizes)
        indptr, indices, data = turned_rows(H.indptr, H.indices, H.data, body, self.factor.rotation)
        turned = sp.csc_array((data, indices, indptr), shape=H.shape)
        return turned if axes is None else sp.csc_array(axes @ turned)


def _with_diagonal(W: Matrix, diagonal: FloatArray, d: int) -> Matrix:
    """W + diag, in the storage of W."""
    if isinstance(W, np.ndarray):
        W[np.diag_indices_from(W)] += diagonal
        return W
    return sp.bsr_array(W + sp.diags_array(diagonal), blocksize=(d, d))
