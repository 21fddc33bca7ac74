"""Newton's linear system by multifrontal LU in single precision, corrected by GMRES to the system in double precision."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fcsim.linear import SingularMatrix
from fcsim.solvers.krylov import gmres
from fcsim.solvers.multifrontal import BlockRows, Multifrontal
from fcsim.solvers.newton_system import SparseSystem, without_open

FloatArray = NDArray[np.float64]

ACCURACY = 1e-4
"""Defect of a step relative to the right-hand side: at 1e-2 Newton takes up to a third more iterations from a cold start."""
ITERATIONS = 12
"""Iterations of GMRES before the factor's precision is doubled; one or two are enough unless the matrix is nearly singular."""


class MultifrontalSystem:
    """Newton's step with a defect of at most ACCURACY ||rhs||, for a block-sparse W of contacts that come in joints.

    Single precision takes half the time and memory of double; its LU is the preconditioner of GMRES. Once it did not get there the
    factors are taken in double precision, and where these are singular the LU with pivoting over the whole matrix takes over.
    """

    def __init__(self, W: Any, dimension: int) -> None:
        """W: dense, sparse, or block rows that were analysed already."""
        self._d = dimension
        self._rows = W if isinstance(W, BlockRows) else BlockRows(W, dimension)
        self._W = self._rows.W
        self._precision: Any = np.float32

    def follow(self, W: Any) -> bool:
        return False

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        active, right, dr = without_open(self._W, A, rhs)
        if len(active):
            step = self._active_step(A, B, active, right, float(np.linalg.norm(rhs)))
            if step is None:
                return SparseSystem(self._W, self._d).solve(A, B, rhs)
            dr[active] = step
        return dr.ravel(), self._W @ dr.ravel()

    def _active_step(self, A: FloatArray, B: FloatArray, active: NDArray[np.int64], rhs: FloatArray, size: float) -> FloatArray | None:
        """dr (k, d) of the active contacts, None where the fronts cannot give it."""
        A_active, B_active, whole = A[active], B[active], np.zeros(A.shape[:2])
        taking_part = np.zeros(len(A), dtype=bool)
        taking_part[active] = True
        rank = np.cumsum(taking_part) - 1

        def product(x: FloatArray) -> FloatArray:
            whole[active] = x.reshape(rhs.shape)
            Wx = (self._W @ whole.ravel()).reshape(whole.shape)[active]
            return (np.einsum("aij,aj->ai", A_active, Wx) + np.einsum("aij,aj->ai", B_active, whole[active])).ravel()

        while True:
            try:
                factor = Multifrontal(self._rows, A, B, taking_part, self._precision)
                found = gmres(product, _preconditioner(factor, rank), rhs.ravel(), ACCURACY * size, ITERATIONS)
            except SingularMatrix:
                found = None
            if found is not None:
                return found[0].reshape(rhs.shape)
            if self._precision is np.float64:
                return None
            self._precision = np.float64


def _preconditioner(factor: Multifrontal, rank: NDArray[np.int64]) -> Callable[[FloatArray], FloatArray]:
    """The factor's solve for the unknowns of the active contacts, which `rank` (nc,) numbers."""
    own = rank[factor.contacts]

    def precondition(x: FloatArray) -> FloatArray:
        blocks = x.reshape(len(own), -1)
        step = np.empty_like(blocks)
        step[own] = factor.solve(blocks[own])
        return step.ravel()

    return precondition
