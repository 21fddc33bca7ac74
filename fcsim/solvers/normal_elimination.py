"""The border's system of the condensed elimination, without the normal components of its closed contacts."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla
from numpy.typing import NDArray

from fcsim.linear import DenseLU, SingularMatrix
from fcsim.solvers.krylov import gmres
from fcsim.solvers.newton_system import dofs_of

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

APPROXIMATE_FROM = 800
"""Unknowns from which an earlier factor and GMRES pay where a defect is allowed; smaller systems are solved to round-off."""
REUSED = 6
"""Iterations of GMRES that an earlier factor may take."""


class NormalElimination:
    """The border's system with the normal components of its closed contacts eliminated, for one choice of these.

    Their normal rows A_NN (W dr)_N = rhs_N do not depend on the iterate, so x_N = y - Z x_V, where V are their tangential components
    and all components of the other ("whole") contacts. Left is a system on V with the response S = G_VV - G_VN Z.
    """

    def __init__(self, response: FloatArray, closed: IntArray, whole: IntArray, released: BoolArray, column: IntArray, d: int) -> None:
        self.closed, self.whole, self._d = closed, whole, d
        first = d * column[closed]
        V = np.concatenate([(first[:, None] + np.arange(1, d)).ravel(), dofs_of(column[whole], d)])
        factor, info = sla.lapack.dpotrf(response[np.ix_(first, first)].T, lower=True, overwrite_a=True, clean=False)
        if info != 0:
            raise SingularMatrix(f"the normal compliance of {len(closed)} contacts is not positive definite")
        self._L = factor
        self._G_VN = response[np.ix_(V, first)]
        self._S = response[np.ix_(V, V)]
        # G_NV is G_VN^T up to the sign of the released contacts' columns: the symmetric product takes half the work
        Y = sla.blas.dtrsm(1.0, factor, response[np.ix_(first, V)].T, side=1, lower=True, trans_a=True, overwrite_b=True)
        correction = Y @ Y.T
        sign = np.repeat(np.where(released, -1.0, 1.0), d)
        self._S[: len(V) - len(sign)] -= correction[: len(V) - len(sign)]
        self._S[len(V) - len(sign) :] -= sign[:, None] * correction[len(V) - len(sign) :]
        self._Z = sla.blas.dtrsm(1.0, factor, Y, side=1, lower=True, overwrite_b=True).T
        self._factor: DenseLU | None = None

    def _normal_solve(self, rhs: FloatArray) -> FloatArray:
        return sla.lapack.dpotrs(self._L, rhs, lower=True)[0] if len(self.closed) else np.zeros_like(rhs)

    def solve(
        self,
        A: FloatArray,
        B: FloatArray,
        rhs: FloatArray,
        known: FloatArray,
        outer: FloatArray,
        inner: FloatArray,
        right: FloatArray,
        target: float,
    ) -> tuple[FloatArray, FloatArray]:
        """Return x of the closed and of the whole contacts; target: norm of the defect that is accepted, 0: round-off.

        Closed: A (W dr) + B x = rhs, where W dr is `known` for x = 0. Whole: outer (response to x) + inner x = right less the known.
        """
        d, k, w = self._d, len(self.closed), len(self.whole)
        split = k * (d - 1)
        Wdr_N = rhs[:, 0] / A[:, 0, 0]
        y = self._normal_solve(Wdr_N - known[:, 0])
        shift = self._G_VN @ y
        known_T = known[:, 1:] + shift[:split].reshape(k, d - 1)
        right_T = rhs[:, 1:] - A[:, 1:, 0] * Wdr_N[:, None] - B[:, 1:, 0] * y[:, None] - np.einsum("aij,aj->ai", A[:, 1:, 1:], known_T)
        right = right - np.einsum("aij,aj->ai", outer, shift[split:].reshape(w, d))
        given = np.concatenate([right_T.ravel(), right.ravel()])
        x = self._approximate(A, B, outer, inner, given, target) if target and len(self._S) > APPROXIMATE_FROM else None
        if x is None:
            x = DenseLU(self._matrix(A, B, outer, inner).T, overwrite=True).solve_transposed(given)
        return np.concatenate([(y - self._Z @ x)[:, None], x[:split].reshape(k, d - 1)], axis=1), x[split:].reshape(w, d)

    def _approximate(
        self, A: FloatArray, B: FloatArray, outer: FloatArray, inner: FloatArray, given: FloatArray, target: float
    ) -> FloatArray | None:
        """Solve on V by GMRES with the LU in single precision of an earlier iteration with the same sets, or else a new one."""

        def product(x: FloatArray) -> FloatArray:
            return self._product(A, B, outer, inner, x)

        def precondition(x: FloatArray) -> FloatArray:
            assert self._factor is not None
            return self._factor.solve_transposed(x.astype(np.float32)).astype(np.float64)

        found = None if self._factor is None else gmres(product, precondition, given, target, REUSED)
        if found is None:
            self._factor = None  # the old one makes room for the new
            self._factor = DenseLU(self._matrix(A, B, outer, inner).astype(np.float32).T, overwrite=True)
            found = gmres(product, precondition, given, target, REUSED)
        return None if found is None else found[0]

    def _matrix(self, A: FloatArray, B: FloatArray, outer: FloatArray, inner: FloatArray) -> FloatArray:
        """The matrix of the system on V."""
        d, k, w, n = self._d, len(self.closed), len(self.whole), len(self._S)
        split = k * (d - 1)
        J = np.empty((n, n))
        rows_T = J[:split].reshape(k, d - 1, n)
        np.matmul(A[:, 1:, 1:], self._S[:split].reshape(k, d - 1, n), out=rows_T)
        rows_T -= B[:, 1:, :1] * self._Z[:, None, :]
        own = np.arange(k)
        J[:split, :split].reshape(k, d - 1, k, d - 1)[own, :, own, :] += B[:, 1:, 1:]
        np.matmul(outer, self._S[split:].reshape(w, d, n), out=J[split:].reshape(w, d, n))
        own = np.arange(w)
        J[split:, split:].reshape(w, d, w, d)[own, :, own, :] += inner
        return J

    def _product(self, A: FloatArray, B: FloatArray, outer: FloatArray, inner: FloatArray, x: FloatArray) -> FloatArray:
        """The product of that matrix with x without forming it."""
        d, k = self._d, len(self.closed)
        split = k * (d - 1)
        Sx, x_T, x_whole = self._S @ x, x[:split].reshape(k, d - 1), x[split:].reshape(-1, d)
        closed = np.einsum("aij,aj->ai", A[:, 1:, 1:], Sx[:split].reshape(k, d - 1)) + np.einsum("aij,aj->ai", B[:, 1:, 1:], x_T)
        closed -= B[:, 1:, 0] * (self._Z @ x)[:, None]
        whole = np.einsum("aij,aj->ai", outer, Sx[split:].reshape(-1, d)) + np.einsum("aij,aj->ai", inner, x_whole)
        return np.concatenate([closed.ravel(), whole.ravel()])
