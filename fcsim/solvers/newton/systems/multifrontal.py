"""Newton's linear system by multifrontal LU in single precision, corrected by GMRES to the system in double precision."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import DTypeLike, NDArray

from fcsim.arrays import BoolArray, FloatArray
from fcsim.linear.factors import SingularMatrix
from fcsim.linear.joints import BlockRows
from fcsim.linear.krylov import gmres
from fcsim.linear.multifrontal.lu import Multifrontal
from fcsim.problem import Delassus
from fcsim.solvers.newton.systems.direct import SparseSystem

ACCURACY = 3e-4
"""Defect of a step relative to the right-hand side: from a cold start Newton takes up to a third more iterations at 1e-2, none at 3e-4."""
ITERATIONS = 12
"""Iterations of GMRES before the factor's precision is doubled; one or two are enough unless the matrix is nearly singular."""


class MultifrontalSystem:
    """Newton's step with a defect of at most ACCURACY ||rhs||, for a block-sparse W of contacts that come in joints.

    Single precision takes half the time and memory of double; its LU is the preconditioner of GMRES. Once it did not get there the
    factors are taken in double precision, and where these are singular the LU with pivoting over the whole matrix takes over.
    """

    def __init__(self, operator: Delassus, rows: BlockRows | None = None) -> None:
        """rows: the operator's block rows where they were analysed already."""
        self.operator, self._d = operator, operator.dimension
        self._rows = BlockRows(operator.matrix, self._d) if rows is None else rows
        self._precision: DTypeLike = np.float32

    def shifted(self, shift: FloatArray) -> MultifrontalSystem:
        operator = self.operator.shifted(shift)
        return MultifrontalSystem(operator, BlockRows(operator.matrix, self._d, self._rows.pattern))

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        active = A.any(axis=(1, 2))
        dr = np.where(active[:, None], 0.0, rhs).ravel()
        Wdr = self._rows.product(dr) if dr.any() else np.zeros_like(dr)
        if active.any():
            right = (rhs - np.einsum("aij,aj->ai", A, Wdr.reshape(rhs.shape)))[active]
            step = self._active_step(A, B, active, right, float(np.linalg.norm(rhs)))
            if step is None:
                return SparseSystem(Delassus(self._rows.W, self._d)).solve(A, B, rhs)
            dr += step[0]
            Wdr += step[1]
        return dr, Wdr

    def _active_step(
        self, A: FloatArray, B: FloatArray, active: BoolArray, rhs: FloatArray, size: float
    ) -> tuple[FloatArray, FloatArray] | None:
        """The active contacts' part of dr (m,) with W times it, None where the fronts cannot give it."""
        A_active, B_active, number = A[active], B[active], np.cumsum(active) - 1
        images: list[FloatArray] = []  # W times the steps

        def product(x: FloatArray) -> FloatArray:
            images.append(self._rows.product(_spread(x, active)))
            Wx = images[-1].reshape(A.shape[:2])[active]
            return (np.einsum("aij,aj->ai", A_active, Wx) + np.einsum("aij,aj->ai", B_active, x.reshape(rhs.shape))).ravel()

        while True:
            try:
                factor = Multifrontal(self._rows, (A, B), active, self._precision)
                found = gmres(product, _preconditioner(factor, number), rhs.ravel(), ACCURACY * size, ITERATIONS)
            except SingularMatrix:
                found = None
            if found is not None:
                x, coefficients = found
                return _spread(x, active), coefficients @ images if images else np.zeros(active.size * self._d)
            if self._precision is np.float64:
                return None
            self._precision = np.float64
            images.clear()


def _spread(x: FloatArray, active: BoolArray) -> FloatArray:
    """x of the active contacts among zeros for the others (m,)."""
    whole = np.zeros((len(active), len(x) // np.count_nonzero(active)))
    whole[active] = x.reshape(-1, whole.shape[1])
    return whole.ravel()


def _preconditioner(factor: Multifrontal, number: NDArray[np.int64]) -> Callable[[FloatArray], FloatArray]:
    """The factor's solve for the unknowns of the active contacts, which `number` (nc,) numbers."""
    own = number[factor.contacts]

    def precondition(x: FloatArray) -> FloatArray:
        blocks = x.reshape(len(own), -1)
        step = np.empty_like(blocks)
        step[own] = factor.solve(blocks[own])
        return step.ravel()

    return precondition
