"""The algebra of products of half-lines and second-order cones: Jordan product, eigenvalues, steps to the boundary, Nesterov-Todd scaling.

A point is flat: the half-lines first, then the cones one by one, of a cone's numbers the axis first. The product is x o y = (x . y,
x_0 y_1 + y_0 x_1) for x = (x_0, x_1) in a cone, its identity e = (1, 0), its eigenvalues x_0 -+ ||x_1||, their product det x.

Sources: Faraut, Koranyi, "Analysis on symmetric cones", 1994; Nesterov, Todd, SIAM J. Optim. 8, 1998; Andersen, Dahl, Liu, Vandenberghe,
"Interior-point methods for large-scale cone programming", 2011.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray


class ConeProduct(Protocol):
    """How many half-lines, how many second-order cones, and the numbers in each of these."""

    @property
    def half_lines(self) -> int: ...

    @property
    def cones(self) -> int: ...

    @property
    def cone_size(self) -> int: ...


class NesterovTodd:
    """The scaling V of s and z in a product of half-lines and second-order cones, V z = V^-1 s = point (symmetric V)."""

    def __init__(self, product: ConeProduct, s: FloatArray, z: FloatArray) -> None:
        self._l, self._shape = product.half_lines, (product.cones, product.cone_size)
        l = self._l
        self._d = np.sqrt(s[:l] / z[:l])
        S, Z = s[l:].reshape(self._shape), z[l:].reshape(self._shape)
        size_s, size_z = np.sqrt(determinant(S)), np.sqrt(determinant(Z))
        S, Z = S / size_s[:, None], Z / size_z[:, None]
        gamma = np.sqrt(np.maximum(0.5 * (1 + np.einsum("ai,ai->a", S, Z)), 1))  # >= 1 but for round-off
        w = (S + reflect(Z)) / (2 * gamma[:, None])
        w[:, 0] += 1
        self._v = w / np.sqrt(2 * w[:, :1])
        self._beta = np.sqrt(size_s / size_z)
        self.point = self.apply(z)

    def apply(self, x: FloatArray, inverse: bool = False) -> FloatArray:
        """V x or V^-1 x: beta (2 v v^T - J), its inverse (2 J v (J v)^T - J) / beta."""
        l = self._l
        X = x[l:].reshape(self._shape)
        v, beta, d = (reflect(self._v), 1 / self._beta, 1 / self._d) if inverse else (self._v, self._beta, self._d)
        Y = beta[:, None] * (2 * np.einsum("ai,ai->a", v, X)[:, None] * v - reflect(X))
        return np.concatenate([d * x[:l], Y.ravel()])

    def inverse_square(self) -> sp.csr_array:
        """V^-2 as a sparse matrix."""
        k = self._shape[1]
        v = reflect(self._v)
        J = np.diag(np.r_[1.0, -np.ones(k - 1)])
        inverse = (2 * v[:, :, None] * v[:, None, :] - J) / self._beta[:, None, None]
        blocks = inverse @ inverse
        n = len(blocks)
        cones = sp.bsr_array((blocks, np.arange(n), np.arange(n + 1)), shape=(n * k, n * k)) if n else sp.csr_array((0, 0))
        return sp.csr_array(sp.block_diag([sp.diags_array(self._d**-2.0), cones], format="csr"))


def reflect(x: FloatArray) -> FloatArray:
    """J x = (x_0, -x_1, ...) of vectors (n, k)."""
    y = -x
    y[:, 0] = x[:, 0]
    return y


def determinant(x: FloatArray) -> FloatArray:
    """det x = x_0^2 - ||x_1, ...||^2 (n,) of vectors (n, k) in the cone, kept above zero."""
    norm = np.sqrt(np.einsum("ai,ai->a", x[:, 1:], x[:, 1:]))
    return np.maximum((x[:, 0] - norm) * (x[:, 0] + norm), 1e-300)


class ConeAlgebra:
    """Jordan product, its inverse, identity and steps to the boundary in the product of cones."""

    def __init__(self, product: ConeProduct) -> None:
        self._l, self._shape = product.half_lines, (product.cones, product.cone_size)
        self.degree = product.half_lines + product.cones
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
        first = np.einsum("ai,ai->a", reflect(X), Y) / determinant(X)
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
            a = np.einsum("ai,ai->a", reflect(D), D)
            b = np.einsum("ai,ai->a", reflect(X), D)
            c = determinant(X)
            root = np.sqrt(np.maximum(b * b - a * c, 0))
            # the roots of a t^2 + 2 b t + c written so that nothing cancels; the least positive one is where the boundary is met
            m = -(b + np.copysign(root, b))
            with np.errstate(divide="ignore", invalid="ignore"):
                roots = np.stack([m / a, c / m])
            roots = np.where((roots > 0) & (b * b >= a * c), roots, np.inf)
            falling = np.where(D[:, 0] < 0, -X[:, 0] / np.where(D[:, 0] < 0, D[:, 0], -1), np.inf)
            t = min(t, float(roots.min()), float(falling.min()))
        return t
