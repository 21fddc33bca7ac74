"""Newton's linear system (A (W + D) + B) dr = rhs by the LU of the whole, on the contacts that are not open.

What uses the structure of the contacts or an earlier factor is in `condensed` and `multifrontal`.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import scipy.sparse as sp

from fcsim import runtime
from fcsim.arrays import FloatArray, IntArray
from fcsim.linear.block_factors.lu import BlockLU
from fcsim.linear.block_rows import dofs_of
from fcsim.linear.factors import MUMPS_FROM, DenseLU, Mumps, SingularMatrix, SuperLU
from fcsim.problem import Delassus
from fcsim.solvers.newton.systems._direct_kernels import active_matrix, newton_blocks
from fcsim.solvers.newton.systems.interface import without_open

DEFECT = 1e-6
"""Defect, relative to the right-hand side, above which a step by block LU is not trusted."""


class DenseSystem:
    """Of a dense W: LAPACK's LU."""

    def __init__(self, operator: Delassus) -> None:
        self.operator = operator
        self._W = np.ascontiguousarray(operator.W)
        self._shift = np.zeros(operator.nc) if operator.shift is None else operator.shift

    def shifted(self, shift: FloatArray) -> DenseSystem:
        return DenseSystem(self.operator.shifted(shift))

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        active, rhs, dr = without_open(self.operator, A, rhs)
        if len(active):
            J = np.empty((rhs.size, rhs.size))
            active_matrix(self._W, self._shift, A, B, active, J)
            dr[active] = DenseLU(J.T, overwrite=True).solve_transposed(rhs.ravel()).reshape(rhs.shape)
        return dr.ravel(), self.operator @ dr.ravel()


class SparseSystem:
    """Of a sparse W: block LU on the pattern's elimination tree, or MUMPS for many entries where petsc4py is there.

    Where the defect shows that rows would have had to be exchanged between contacts, SuperLU takes the step again.
    """

    def __init__(self, operator: Delassus) -> None:
        self.operator = operator
        self._rows, self._analysis = operator.analysis

    def shifted(self, shift: FloatArray) -> SparseSystem:
        return SparseSystem(self.operator.shifted(shift))

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        active, left, dr = without_open(self.operator, A, rhs)
        if not len(active):
            return dr.ravel(), self.operator @ dr.ravel()
        blocks = newton_blocks(self._analysis.indptr, self._analysis.indices, self._rows.data, A, B)
        if self._rows.nnz > MUMPS_FROM and runtime.has_petsc():
            dr[active] = Mumps(self._active_rows(blocks, active)).solve(left.ravel()).reshape(left.shape)
            return dr.ravel(), self.operator @ dr.ravel()
        taking_part, known = np.zeros(len(A), dtype=bool), dr
        taking_part[active] = True
        right = np.zeros_like(rhs)
        right[active] = left
        with suppress(SingularMatrix):
            dr = known + BlockLU(self._analysis, blocks, taking_part).solve(right.ravel()).reshape(rhs.shape)
            Wdr = self.operator @ dr.ravel()
            defect = np.einsum("aij,aj->ai", A, Wdr.reshape(rhs.shape)) + np.einsum("aij,aj->ai", B, dr) - rhs
            if np.linalg.norm(defect) <= DEFECT * np.linalg.norm(rhs):
                return dr.ravel(), Wdr
        dr = known
        factor = SuperLU(self._active_rows(blocks, active).T, symmetric_pattern=True)  # its rows are the columns that SuperLU reads
        dr[active] = factor.solve_transposed(left.ravel()).reshape(left.shape)
        return dr.ravel(), self.operator @ dr.ravel()

    def _active_rows(self, blocks: FloatArray, active: IntArray) -> sp.csr_array:
        """The matrix of these blocks on the active contacts."""
        d = self.operator.dimension
        J = sp.csr_array(sp.bsr_array((blocks, self._analysis.indices, self._analysis.indptr), shape=self._rows.shape))
        dofs = dofs_of(active, d)
        return J[dofs][:, dofs]
