"""Newton's linear system (A (W + D) + B) dr = rhs by the LU of the whole, on the contacts that are not open.

What uses the structure of the contacts or an earlier factor is in `condensed` and `multifrontal`.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim import runtime
from fcsim.arrays import FloatArray, IntArray
from fcsim.linear.factors import MUMPS_FROM, DenseLU, Factor, Mumps, SuperLU
from fcsim.problem import Delassus
from fcsim.solvers.newton.systems._direct_kernels import active_matrix, active_rows
from fcsim.solvers.newton.systems.interface import without_open


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
    """Of a sparse W: SuperLU, or MUMPS for many entries where petsc4py is there."""

    def __init__(self, operator: Delassus, rows: tuple[IntArray, IntArray, FloatArray] | None = None) -> None:
        """rows: `_complete_rows` of W where another system has them already."""
        self.operator = operator
        self._rows = _complete_rows(operator) if rows is None else rows
        self._shift = np.zeros(operator.nc) if operator.shift is None else operator.shift

    def shifted(self, shift: FloatArray) -> SparseSystem:
        return SparseSystem(self.operator.shifted(shift), self._rows)

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        d = self.operator.dimension
        active, rhs, dr = without_open(self.operator, A, rhs)
        if len(active):
            dr[active] = self._factor(A, B, active).solve(rhs.ravel()).reshape(-1, d)
        return dr.ravel(), self.operator @ dr.ravel()

    def _factor(self, A: FloatArray, B: FloatArray, active: IntArray) -> Factor:
        """A (W + D) + B on the active contacts, factored."""
        starts, columns, blocks = self._rows
        place = np.full(len(A), -1, dtype=np.int32)
        place[active] = np.arange(len(active))
        k = len(active) * self.operator.dimension
        values, indices, pointers = np.empty(blocks.size), np.empty(blocks.size, dtype=np.int32), np.empty(k + 1, dtype=np.int32)
        n = active_rows(blocks, starts, columns, self._shift, A, B, active, place, values, indices, pointers)
        J = sp.csr_array((values[:n], indices[:n], pointers), shape=(k, k))
        if n > MUMPS_FROM and runtime.has_petsc():
            return Mumps(J)
        return _Transposed(SuperLU(J.T, symmetric_pattern=True))  # its rows are the columns that SuperLU reads


class _Transposed:
    """A^-T by the factor of A."""

    def __init__(self, factor: SuperLU) -> None:
        self.name, self._factor = factor.name, factor

    def solve(self, rhs: FloatArray) -> FloatArray:
        return self._factor.solve_transposed(rhs)


def _complete_rows(operator: Delassus) -> tuple[IntArray, IntArray, FloatArray]:
    """W by sorted block rows with every diagonal block: starts (nc + 1,), columns, blocks (nnz, d, d)."""
    d, nc = operator.dimension, operator.nc
    W = sp.bsr_array(operator.W, blocksize=(d, d))
    if not W.has_canonical_format:
        W = W.copy()  # the caller's stays as it is
        W.sum_duplicates()
    row = np.repeat(np.arange(nc), np.diff(W.indptr))
    absent = np.setdiff1d(np.arange(nc), row[row == W.indices])  # diagonal blocks that W does not store
    if not len(absent):
        return W.indptr.astype(np.int32), W.indices.astype(np.int32), W.data
    rows, columns = np.concatenate([row, absent]), np.concatenate([W.indices, absent])
    sort = np.lexsort((columns, rows))
    blocks = np.concatenate([W.data, np.zeros((len(absent), d, d))])[sort]
    return np.searchsorted(rows[sort], np.arange(nc + 1)).astype(np.int32), columns[sort].astype(np.int32), blocks
