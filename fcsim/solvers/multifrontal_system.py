"""Newton's linear system by GMRES with multifrontal factors in single precision, fresh or of an earlier iteration, as preconditioner."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.linear import SingularMatrix
from fcsim.solvers.multifrontal import BlockRows, Multifrontal
from fcsim.solvers.newton_system import SparseSystem

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

import os
FORCING=float(os.environ.get('FORC','1e-2'))
"""Defect, relative to the right-hand side, at which a Newton step is accepted."""
FRESH = 20
"""Iterations of GMRES that a fresh factor gets: one is enough unless the matrix is nearly singular in its precision."""
SHARE = float(os.environ.get('LIM','0.5'))
"""An earlier factor may cost so much of a fresh one in iterations."""
CORRECTIONS = 3
"""Times that GMRES in single precision is started again from the true defect."""
HOPE = 1.5
"""GMRES is given up when the mean reduction so far would take more than so many times the iterations that it has."""
LOG=[]

class MultifrontalSystem:
    """Newton's step with a defect of about FORCING ||rhs||, for a block-sparse W of contacts that come in joints.

    The fronts of `multifrontal` hold the LU of A W + B in single precision, the preconditioner of GMRES (Y. Saad, M. H. Schultz, SIAM J.
    Sci. Stat. Comput. 7, 1986). An earlier iteration's or step's factor serves as long as the iterations that it needs cost less than
    a fresh one. Where single precision does not get there the factor is taken in double precision, and where that is singular the
    LU with pivoting over the whole matrix takes over.
    """

    def __init__(self, W: Any, dimension: int) -> None:
        self._d = dimension
        self._factor: Multifrontal | None = None
        self._set(BlockRows(W, dimension))

    def _set(self, rows: BlockRows) -> None:
        self._rows, self._W = rows, rows.W
        self._single = sp.bsr_array((rows.blocks.astype(np.float32), rows.indices, rows.indptr), shape=rows.W.shape)
        self._own = rows.diagonal_blocks()
        # reading W and the fronts, against assembling and eliminating them (at a common processor's rates)
        entries = max(rows.W.nnz, 1)
        self._affordable = int(SHARE * (8e-9 * entries + 1.3e-11 * rows.tree.flops(self._d)) / (1e-9 * entries))

    def follow(self, W: Any) -> bool:
        if W.shape != self._W.shape:
            return False
        self._set(BlockRows(W, self._d, self._rows))
        return True

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        active = np.any(A, axis=(1, 2))
        solution = None
        if self._factor is not None:
            solution = self._corrected(A, B, rhs, active, self._affordable)
        for precision in (np.float32, np.float64):
            if solution is None:
                self._factor = None  # the old one makes room for the new
                try:
                    self._factor = Multifrontal(self._rows, A, B, active, precision)
                    solution = self._corrected(A, B, rhs, active, FRESH)
                except SingularMatrix:
                    pass
        if solution is None:
            self._factor = None
            return SparseSystem(self._W, self._d).solve(A, B, rhs)
        return solution

    def _corrected(self, A: FloatArray, B: FloatArray, rhs: FloatArray, active: BoolArray, limit: int) -> tuple[FloatArray, FloatArray] | None:
        """(dr, W dr) by GMRES in single precision on the true defect; None where that does not bring it down."""
        target = FORCING * float(np.linalg.norm(rhs))
        dr = np.where(active[:, None], 0.0, rhs)  # open contacts: dr is known
        for _ in range(CORRECTIONS):
            Wdr = self._W @ dr.ravel() if np.any(dr) else np.zeros(dr.size)
            defect = rhs - _times(A, Wdr.reshape(rhs.shape)) - _times(B, dr)
            if np.linalg.norm(defect) <= 2 * target:
                return dr.ravel(), Wdr
            step = self._gmres(A, B, defect, active, target, limit)
            if step is None:
                return None
            dr = dr + step
        return None

    def _gmres(self, A: FloatArray, B: FloatArray, defect: FloatArray, active: BoolArray, target: float, limit: int) -> FloatArray | None:
        """Right-preconditioned GMRES from 0; None where `limit` iterations do not bring the defect to the target."""
        beta = float(np.linalg.norm(defect))
        basis = [defect / beta]
        steps: list[FloatArray] = []
        H = np.zeros((limit + 1, limit))
        for j in range(limit):
            z = self._preconditioned(A, B, basis[j], active)
            w = _times(A, (self._single @ z.ravel().astype(np.float32)).reshape(z.shape)) + _times(B, z)
            steps.append(z)
            for i, v in enumerate(basis):
                H[i, j] = np.vdot(v, w)
                w -= H[i, j] * v
            H[j + 1, j] = np.linalg.norm(w)
            if not np.isfinite(H[j + 1, j]):
                return None
            least = np.zeros(j + 2)
            least[0] = beta
            y = np.linalg.lstsq(H[: j + 2, : j + 1], least, rcond=None)[0]
            left = float(np.linalg.norm(least - H[: j + 2, : j + 1] @ y))
            if left <= target:
                LOG.append(j+1)
                return np.tensordot(y, steps, 1)
            if H[j + 1, j] == 0 or j >= 3 and np.log(left / beta) * HOPE * limit > np.log(target / beta) * (j + 1):
                break
            basis.append(w / H[j + 1, j])
        LOG.append(-j-1)
        return None

    def _preconditioned(self, A: FloatArray, B: FloatArray, defect: FloatArray, active: BoolArray) -> FloatArray:
        """The factor's step where it has the contact, that of its own block where it was open then, 0 where it is open now."""
        assert self._factor is not None
        own = self._factor.contacts
        step = np.zeros_like(defect)
        step[own] = self._factor.solve(defect[own])
        known = np.zeros(len(active), dtype=bool)
        known[own] = True
        step[~active] = 0
        new = np.flatnonzero(active & ~known)
        if len(new):
            step[new] = np.linalg.solve(A[new] @ self._own[new] + B[new], defect[new][:, :, None])[:, :, 0]
        return step


def _times(blocks: FloatArray, x: FloatArray) -> FloatArray:
    return np.matmul(blocks, x[:, :, None])[:, :, 0]
