"""Primal-dual interior-point method for programs in conic form, with Nesterov-Todd scaling and Mehrotra's predictor and corrector.

Sources: Nesterov, Todd, SIAM J. Optim. 8, 1998; Andersen, Dahl, Liu, Vandenberghe, "Interior-point methods for large-scale cone
programming", 2011; Acary, Armand, Nguyen, Shpakovych, Optim. Methods Softw. 2023 (friction).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, Matrix
from fcsim.linear.factors import Factor, SingularMatrix, factorise
from fcsim.problem.shifted_factor import ShiftedInverse
from fcsim.solvers.base import Iterate, Status
from fcsim.solvers.variational.conic import ConicRows, scaled_program
from fcsim.solvers.variational.inequality import Inequality
from fcsim.solvers.variational.watches import Watch


class _NesterovTodd:
    """The scaling V of s and z in a product of half-lines and second-order cones, V z = V^-1 s = point (symmetric V)."""

    def __init__(self, rows: ConicRows, s: FloatArray, z: FloatArray) -> None:
        self._l, self._shape = rows.half_lines, (rows.cones, rows.cone_size)
        l = self._l
        self._d = np.sqrt(s[:l] / z[:l])
        S, Z = s[l:].reshape(self._shape), z[l:].reshape(self._shape)
        size_s, size_z = np.sqrt(_determinant(S)), np.sqrt(_determinant(Z))
        S, Z = S / size_s[:, None], Z / size_z[:, None]
        gamma = np.sqrt(np.maximum(0.5 * (1 + np.einsum("ai,ai->a", S, Z)), 1))  # >= 1 but for round-off
        w = (S + _reflect(Z)) / (2 * gamma[:, None])
        w[:, 0] += 1
        self._v = w / np.sqrt(2 * w[:, :1])
        self._beta = np.sqrt(size_s / size_z)
        self.point = self.apply(z)

    def apply(self, x: FloatArray, inverse: bool = False) -> FloatArray:
        """V x or V^-1 x: beta (2 v v^T - J), its inverse (2 J v (J v)^T - J) / beta."""
        l = self._l
        X = x[l:].reshape(self._shape)
        v, beta, d = (_reflect(self._v), 1 / self._beta, 1 / self._d) if inverse else (self._v, self._beta, self._d)
        Y = beta[:, None] * (2 * np.einsum("ai,ai->a", v, X)[:, None] * v - _reflect(X))
        return np.concatenate([d * x[:l], Y.ravel()])

    def inverse_square(self) -> sp.csr_array:
        """V^-2 as a sparse matrix."""
        k = self._shape[1]
        v = _reflect(self._v)
        J = np.diag(np.r_[1.0, -np.ones(k - 1)])
        inverse = (2 * v[:, :, None] * v[:, None, :] - J) / self._beta[:, None, None]
        blocks = inverse @ inverse
        n = len(blocks)
        cones = sp.bsr_array((blocks, np.arange(n), np.arange(n + 1)), shape=(n * k, n * k)) if n else sp.csr_array((0, 0))
        return sp.csr_array(sp.block_diag([sp.diags_array(self._d**-2.0), cones], format="csr"))


def _reflect(x: FloatArray) -> FloatArray:
    y = -x
    y[:, 0] = x[:, 0]
    return y


def _determinant(x: FloatArray) -> FloatArray:
    norm = np.sqrt(np.einsum("ai,ai->a", x[:, 1:], x[:, 1:]))
    return np.maximum((x[:, 0] - norm) * (x[:, 0] + norm), 1e-300)


class _Algebra:
    """Jordan product, its inverse, identity and steps to the boundary in the product of cones."""

    def __init__(self, rows: ConicRows) -> None:
        self._l, self._shape = rows.half_lines, (rows.cones, rows.cone_size)
        self.degree = rows.half_lines + rows.cones
        cones = np.zeros(self._shape)
        cones[:, 0] = 1
        self.identity = np.concatenate([np.ones(self._l), cones.ravel()])

    def product(self, x: FloatArray, y: FloatArray) -> FloatArray:
        X, Y = x[self._l :].reshape(self._shape), y[self._l :].reshape(self._shape)
        Z = X[:, :1] * Y + Y[:, :1] * X
        Z[:, 0] = np.einsum("ai,ai->a", X, Y)
        return np.concatenate([x[: self._l] * y[: self._l], Z.ravel()])

    def divide(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """The z with x o z = y."""
        X, Y = x[self._l :].reshape(self._shape), y[self._l :].reshape(self._shape)
        first = np.einsum("ai,ai->a", _reflect(X), Y) / _determinant(X)
        Z = (Y - first[:, None] * X) / X[:, :1]
        Z[:, 0] = first
        return np.concatenate([y[: self._l] / x[: self._l], Z.ravel()])

    def least(self, x: FloatArray) -> float:
        """The least eigenvalue: how far inside x is."""
        X = x[self._l :].reshape(self._shape)
        values = np.concatenate([x[: self._l], X[:, 0] - np.sqrt(np.einsum("ai,ai->a", X[:, 1:], X[:, 1:]))])
        return float(values.min(initial=np.inf))

    def longest_step(self, x: FloatArray, dx: FloatArray) -> float:
        """The largest t <= 1 with x + t dx in the product of cones."""
        l = self._l
        t = 1.0
        down = dx[:l] < 0
        if down.any():
            t = min(t, float((-x[:l][down] / dx[:l][down]).min()))
        X, D = x[l:].reshape(self._shape), dx[l:].reshape(self._shape)
        if len(X):
            a = np.einsum("ai,ai->a", _reflect(D), D)
            b = np.einsum("ai,ai->a", _reflect(X), D)
            c = _determinant(X)
            root = np.sqrt(np.maximum(b * b - a * c, 0))
            # the roots of a t^2 + 2 b t + c written so that nothing cancels; the least positive one is where the boundary is met
            m = -(b + np.copysign(root, b))
            with np.errstate(divide="ignore", invalid="ignore"):
                roots = np.stack([m / a, c / m])
            roots = np.where((roots > 0) & (b * b >= a * c), roots, np.inf)
            falling = np.where(D[:, 0] < 0, -X[:, 0] / np.where(D[:, 0] < 0, D[:, 0], -1), np.inf)
            t = min(t, float(roots.min()), float(falling.min()))
        return t


def _direction(
    system: Factor,
    V: _NesterovTodd,
    algebra: _Algebra,
    program: tuple[Matrix, sp.csr_array, sp.csr_array],
    rx: FloatArray,
    rz: FloatArray,
    target: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """dx and the scaled V^-1 ds, V dz with P dx + A^T dz = -rx, A dx + ds = -rz, point o (V^-1 ds + V dz) = target.

    The scaled pair sums up to b = point \\ target: nothing cancels where s or z is near the boundary. One step of iterative refinement.
    """
    P, A, AT = program
    b = algebra.divide(V.point, target)
    rhs = -rx - AT @ V.apply(V.apply(rz, inverse=True) + b, inverse=True)
    dx = system.solve(rhs)
    dx = dx + system.solve(rhs - P @ dx - AT @ V.apply(V.apply(A @ dx, inverse=True), inverse=True))
    dz = V.apply(A @ dx + rz, inverse=True) + b
    return dx, b - dz, dz


@np.errstate(over="ignore", divide="ignore", invalid="ignore")  # the last iterations may meet infinity: they end there
def primal_dual(vi: Inequality, r: FloatArray, watch: Watch, max_iterations: int = 60) -> Iterate:
    """The program by our primal-dual method; one Cholesky factorisation of P + A^T V^-2 A an iteration."""
    status = watch.visit(vi.project(r), None, True)
    if status is not None:
        return Iterate(vi.project(r), status)
    rows, P, c, scale = scaled_program(vi)
    algebra = _Algebra(rows)
    A, AT = rows.A, sp.csr_array(rows.A.T)
    program = P, A, AT

    def factor(V2: sp.csr_array) -> Factor:
        weight = sp.coo_array(AT @ V2 @ A)
        weight.sum_duplicates()
        if not isinstance(P, np.ndarray):
            return factorise(sp.csr_array(P + sp.csr_array(weight)))
        matrix = P.copy()
        matrix[weight.coords] += weight.data
        return ShiftedInverse(matrix) if vi.operator.symmetric else factorise(matrix)

    # step 0: the minimiser without cones gives x, s and z, pushed inside
    x = factor(sp.eye_array(len(rows.h), format="csr")).solve(AT @ rows.h - c)
    z = A @ x - rows.h
    s = -z + max(0.0, 1e-2 * np.abs(z).max(initial=1.0) - algebra.least(-z)) * algebra.identity
    z = z + max(0.0, 1e-2 * np.abs(z).max(initial=1.0) - algebra.least(z)) * algebra.identity
    answer, least = vi.project(r), np.inf
    for _ in range(max_iterations):
        rx, rz = P @ x + c + AT @ z, A @ x + s - rows.h
        gap = float(s @ z)
        candidate = np.zeros_like(r)
        candidate[rows.free] = scale * x
        candidate = vi.project(candidate)
        if not (np.all(np.isfinite(candidate)) and gap > 1e-20):  # as far as floating point goes
            break
        u = vi.velocity(candidate)
        residual = vi.residual(candidate, u, watch.compliance)
        if residual < least:
            answer, least = candidate, residual
        status = watch.visit(candidate, u, residual <= watch.target)
        if status is not None:
            return Iterate(candidate if status is Status.SOLVED else answer, status)
        try:
            V = _NesterovTodd(rows, s, z)  # step 1: scaling and factorisation
            V2 = V.inverse_square()
            system = factor(V2)
        except (SingularMatrix, FloatingPointError):
            break

        squared = algebra.product(V.point, V.point)
        dx, ds, dz = _direction(system, V, algebra, program, rx, rz, -squared)  # step 2: predictor
        t = min(algebra.longest_step(V.point, ds), algebra.longest_step(V.point, dz))
        sigma = (1 - t) ** 3
        centre = sigma * gap / algebra.degree * algebra.identity
        target = centre - squared - algebra.product(ds, dz)
        dx, ds, dz = _direction(system, V, algebra, program, (1 - sigma) * rx, (1 - sigma) * rz, target)  # step 3: corrector
        t = min(1.0, 0.99 * min(algebra.longest_step(V.point, ds), algebra.longest_step(V.point, dz)))
        x, s, z = x + t * dx, s + t * V.apply(ds), z + t * V.apply(dz, inverse=True)
        watch.tick()
        if t < 1e-8:
            break
    return Iterate(answer, Status.STAGNATED)
