"""The system on the border of a condensed elimination: the unknowns that the linearised equations leave open there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fcsim.linear import DenseLU
from fcsim.solvers._front_kernels import border_matrix
from fcsim.solvers.krylov import gmres

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

APPROXIMATE_FROM = 500
"""Unknowns from which an earlier factor and GMRES pay where a defect is allowed; smaller systems are solved by their own factor."""
REUSED = 6
"""Iterations of GMRES that an earlier factor may take."""


class BorderSystem:
    """outer (known + G x) + inner x = rhs on the unknown components of x (k, d), with outer and inner block diagonal (k, d, d).

    The factor is kept: while the same components are unknown it is GMRES' preconditioner for the systems to come.
    """

    def __init__(self) -> None:
        self._unknown = np.empty(0, dtype=np.int64)
        self._factor: DenseLU | None = None
        self._J: FloatArray | None = None  # None where the factor has taken its place

    def complete(
        self,
        x: FloatArray,
        unknown: BoolArray,
        G: FloatArray,
        known: FloatArray,
        outer: FloatArray,
        inner: FloatArray,
        rhs: FloatArray,
        target: float,
        same: bool = False,
    ) -> None:
        """Fill in the unknown components (k, d) of x, which are zero; target: norm of the defect that is accepted, 0: round-off.

        G may have more rows and columns than unknowns: the first k d count. same: all but x, known and rhs are those of the last call."""
        dofs = np.flatnonzero(unknown)
        if not len(dofs):
            return
        n = x.size
        response = known + (G[:n, :n] @ x.ravel()).reshape(x.shape) if x.any() else known
        left = rhs - np.einsum("aij,aj->ai", outer, response) - np.einsum("aij,aj->ai", inner, x)
        if not same:
            self._J = np.empty((len(dofs), len(dofs)), dtype=G.dtype)
            border_matrix(G, outer.ravel(), inner.ravel(), dofs, x.shape[1], self._J)
        x[unknown] = self._solve(left[unknown], dofs, target)

    def _solve(self, rhs: FloatArray, unknown: NDArray[np.int64], target: float) -> FloatArray:
        J = self._J
        if J is not None:
            if target and len(rhs) > APPROXIMATE_FROM and self._factor is not None and np.array_equal(unknown, self._unknown):
                found = gmres(J.__matmul__, self._factor.solve_transposed, rhs, target, REUSED)
                if found is not None:
                    return found[0]
            self._factor = self._J = None  # the old one makes room for the new
            self._factor, self._unknown = DenseLU(J.T, overwrite=True), unknown
        assert self._factor is not None
        return self._factor.solve_transposed(rhs)


def split_known(A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, BoolArray]:
    """The components of x = W dr (k, d) that A x + B dr = rhs gives for every dr, zero elsewhere, and which ones are unknown.

    All of a sticking contact (B = 0), the normal one of a closed contact where row N of A is (A_NN, 0, 0) and of B zero, as Alart and
    Curnier's and Jean and Moreau's are.
    """
    unknown = np.ones(rhs.shape, dtype=bool)
    x = np.zeros_like(rhs)
    sticking = ~B.any(axis=(1, 2))
    x[sticking] = np.linalg.solve(A[sticking], rhs[sticking][:, :, None])[:, :, 0]
    unknown[sticking] = False
    normal = ~sticking & (A[:, 0, 0] != 0) & ~A[:, 0, 1:].any(axis=1) & ~B[:, 0].any(axis=1)
    x[normal, 0] = rhs[normal, 0] / A[normal, 0, 0]
    unknown[normal, 0] = False
    return x, unknown
