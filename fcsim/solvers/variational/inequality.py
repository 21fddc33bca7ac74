"""The problem as a variational inequality on a product of convex sets, the common ground of projection, splitting and QP methods.

Find r in C with F(r) . (s - r) >= 0 for all s in C. Three readings (Acary, Brémond, Huber 2018, Sections 3 and 4):

* Coulomb: C = K, F(r) = u + g(u), u = W r + q; not the gradient of anything;
* given sliding s (Acary, Cadoux, Lemaréchal, Malick 2011): C = K, F(r) = W r + q + mu s N, a convex QP over second-order cones;
* given threshold (Tresca): C = {r_N >= 0, ||r_T|| <= mu p}, F(r) = W r + q, a convex QP over half-cylinders.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.linear._block_rows_kernels import product
from fcsim.linear.block_cholesky import Analysis, BlockCholesky
from fcsim.linear.block_rows import compressed_blocks
from fcsim.linear.factors import MUMPS_FROM, Factor, Mumps, SingularMatrix, SuperLU, factorise, is_symmetric
from fcsim.problem import LocalProblem, diagonal_blocks
from fcsim.runtime import has_petsc
from fcsim.solvers.base import Monitor, Status
from fcsim.solvers.variational._set_kernels import add_de_saxce, de_saxce_term, step_cone, step_cylinder, step_disk

COMPRESSED_FROM, COMPRESSION = 20_000, 1e-9
"""Unknowns from which W + rho I is factored by compressed blocks, and to which accuracy: a third of the time at 100 000."""


@dataclass(frozen=True, eq=False)
class Cone:
    """K = {||r_T|| <= mu r_N}."""

    mu: FloatArray

    def step(self, r: FloatArray, F: FloatArray, rho: float, out: FloatArray) -> float:
        """out = P_C(r - rho F), arrays (nc, d); return ||out - r||^2."""
        return step_cone(r, F, self.mu, rho, out)


@dataclass(frozen=True, eq=False)
class Cylinder:
    """{r_N >= 0, ||r_T|| <= radius}; with d = 1 the half-line r_N >= 0."""

    radius: FloatArray

    def step(self, r: FloatArray, F: FloatArray, rho: float, out: FloatArray) -> float:
        """As `Cone.step`."""
        return step_cylinder(r, F, self.radius, rho, out)


@dataclass(frozen=True, eq=False)
class Disk:
    """{||r_T|| <= radius} for tangential vectors (nc, d - 1)."""

    radius: FloatArray

    def step(self, r: FloatArray, F: FloatArray, rho: float, out: FloatArray) -> float:
        """As `Cone.step`."""
        return step_disk(r, F, self.radius, rho, out)


ConvexSet = Cone | Cylinder | Disk


class ShiftedInverse:
    """(W + rho I)^-1 of a dense symmetric W: by its Cholesky factor, after some use by the inverse itself, a quicker product."""

    name = "dense Cholesky (LAPACK)"

    def __init__(self, A: FloatArray, patience: int = 40) -> None:
        self._factor, info = sla.lapack.dpotrf(A, lower=True, clean=False)
        if info != 0:
            raise SingularMatrix(f"matrix of size {len(A)} is not positive definite")
        self._patience = patience
        self._inverse: FloatArray | None = None

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Return A^-1 rhs."""
        if self._inverse is None and self._patience > 0:
            self._patience -= 1
            return sla.lapack.dpotrs(self._factor, rhs, lower=True)[0]
        if self._inverse is None:
            lower = np.tril(sla.lapack.dpotri(self._factor, lower=True)[0])
            self._inverse = lower + np.tril(lower, -1).T
        return self._inverse @ rhs


def coulomb_term(u: FloatArray, mu: FloatArray, dimension: int) -> FloatArray:
    """De Saxcé's g(u) = (mu ||u_T||, 0, 0) for flat u (m,)."""
    return de_saxce_term(u, mu, dimension)


def power_norm(apply: Callable[[FloatArray], FloatArray], size: int) -> float:
    """The largest eigenvalue in magnitude of x -> apply(x) on R^size by the power method, from below within a few percent."""
    if not size:
        return 0.0
    x = np.random.default_rng(0).standard_normal(size)
    length, norm = math.sqrt(x @ x), 0.0
    for _ in range(30):
        x = apply(x / (length or 1.0))
        length = math.sqrt(x @ x)
        if abs(length - norm) <= 1e-3 * length:
            break
        norm = length
    return length


def _shifted(W: Any, rho: float) -> Any:
    """W + rho I of a sparse W, by block rows where W is."""
    if W.format == "bsr" and W.blocksize[0] == W.blocksize[1]:
        row = np.repeat(np.arange(len(W.indptr) - 1), np.diff(W.indptr))
        own = np.flatnonzero(row == W.indices)
        if len(own) == len(W.indptr) - 1:  # each diagonal block stands there once
            W = W.copy()
            W.data[own] += rho * np.eye(W.blocksize[0])
            return W
    return W + rho * sp.eye_array(W.shape[0], format="csr")


class Operator:
    """W (m, m) with d unknowns a contact and what is derived from it once: norm, block rows, factors of W + rho I."""

    def __init__(self, W: Any, dimension: int) -> None:
        self.W, self.dimension = W, dimension
        self.size = W.shape[0]
        self._factors: dict[tuple[float, bool], Factor] = {}
        self._derived: dict[str, Any] = {}

    def affine(self, x: FloatArray, q: FloatArray) -> FloatArray:
        """W x + q (m,)."""
        W = self.W
        if sp.issparse(W) and W.format == "bsr" and W.blocksize == (3, 3):  # twice as quick as SciPy's product for any size of block
            return product(W.indptr, W.indices, W.data, q.reshape(-1, 3), x.reshape(-1, 3)).ravel()
        return W @ x + q

    @cached_property
    def norm(self) -> float:
        """||W||_2 by power iterations on W, or on W^T W where that differs, from below within a few percent."""
        zero = np.zeros(self.size)
        if self.symmetric:
            return power_norm(lambda x: self.affine(x, zero), self.size) or 1.0
        WT = self.W.T
        return float(np.sqrt(power_norm(lambda x: WT @ self.affine(x, zero), self.size))) or 1.0

    @cached_property
    def least_singular_value(self) -> float:
        """The least singular value of W by inverse iteration, or 1e-6 ||W|| where that is larger."""
        floor = 1e-6 * self.norm
        inverse = power_norm(self.factor(floor, self.symmetric).solve, self.size)
        return max(1 / (inverse or 1.0) - floor, floor)

    @cached_property
    def symmetric(self) -> bool:
        """Whether W equals its transpose up to round-off."""
        return is_symmetric(self.W)

    @cached_property
    def symmetric_part(self) -> Operator:
        """(W + W^T) / 2."""
        return self if self.symmetric else Operator(0.5 * (self.W + self.W.T), self.dimension)

    @cached_property
    def diagonal_blocks(self) -> FloatArray:
        """The contacts' own blocks W_aa (nc, d, d)."""
        return diagonal_blocks(self.W, self.dimension)

    def derived(self, name: str, make: Callable[[Operator], Any]) -> Any:
        """What `make` derives from this operator, made once under that name."""
        if name not in self._derived:
            self._derived[name] = make(self)
        return self._derived[name]

    def factor(self, rho: float, symmetric: bool) -> Factor:
        """The factor of W + rho I, computed once for each rho: Cholesky where symmetric, LU otherwise."""
        key = (rho, symmetric)
        if key not in self._factors:
            if len(self._factors) >= 4:
                del self._factors[next(iter(self._factors))]
            self._factors[key] = self._factorise(rho, symmetric)
        return self._factors[key]

    def _factorise(self, rho: float, symmetric: bool) -> Factor:
        if sp.issparse(self.W):
            return self._factorise_sparse(rho, symmetric)
        shifted = self.W + rho * np.eye(self.size)
        if symmetric:
            try:
                return ShiftedInverse(shifted)
            except SingularMatrix:  # W slightly indefinite
                pass
        return factorise(shifted)

    def _factorise_sparse(self, rho: float, symmetric: bool) -> Factor:
        # MUMPS pays off for many entries only, and its factors differ in the last bits from run to run
        many = self.W.nnz > MUMPS_FROM and has_petsc()
        if symmetric:
            try:
                if many:
                    compression = COMPRESSION if self.size > COMPRESSED_FROM else 0.0
                    return Mumps(_shifted(self.W, rho), positive_definite=True, compression=compression)
                blocks = self.derived("blocks", _blocks)
                return BlockCholesky(self.derived("analysis", lambda _: Analysis(blocks)), blocks.data, rho)
            except SingularMatrix:  # W slightly indefinite
                pass
        return factorise(sp.csr_array(_shifted(self.W, rho))) if many else SuperLU(_shifted(self.W, rho), symmetric_pattern=True)


def _blocks(operator: Operator) -> Any:
    """W by block rows with every diagonal block, W itself where it is so stored."""
    W, d = operator.W, operator.dimension
    if W.format == "bsr" and W.blocksize == (d, d):
        row = np.repeat(np.arange(len(W.indptr) - 1), np.diff(W.indptr))
        if np.count_nonzero(row == W.indices) == len(W.indptr) - 1:
            return W
    indptr, column, blocks = compressed_blocks(sp.csc_array(W), d)
    return sp.bsr_array((blocks, column, indptr), shape=W.shape)


@dataclass(frozen=True, eq=False)
class Inequality:
    """Find r in C with F(r) . (s - r) >= 0, F(r) = W r + q [+ g(W r + q) with the friction coefficients mu where given]."""

    operator: Operator
    q: FloatArray
    convex_set: ConvexSet
    mu: FloatArray | None = None

    @staticmethod
    def coulomb(problem: LocalProblem) -> Inequality:
        """Coulomb's law by De Saxcé's term: C = K, F(r) = u + g(u)."""
        return Inequality(Operator(problem.W, problem.dimension), problem.q, Cone(problem.mu), problem.mu)

    @property
    def lipschitz(self) -> float:
        """The Lipschitz constant of F: ||W|| times that of u -> u + g(u), the largest singular value of [[1, mu], [0, 1]]."""
        mu = 0.0 if self.mu is None else float(self.mu.max(initial=0.0))
        return self.operator.norm * 0.5 * (mu + np.sqrt(mu * mu + 4))

    def velocity(self, r: FloatArray) -> FloatArray:
        """u = W r + q (m,)."""
        return self.operator.affine(r, self.q)

    def map(self, u: FloatArray) -> FloatArray:
        """F (m,) where u = W r + q is known."""
        if self.mu is None:
            return u
        F = np.empty_like(u)
        add_de_saxce(self._rows(u), self.mu, self._rows(F))
        return F

    def project(self, z: FloatArray) -> FloatArray:
        """Return P_C(z)."""
        return self.step(z, z, 0.0)[0]

    def step(self, r: FloatArray, F: FloatArray, rho: float) -> tuple[FloatArray, float]:
        """Return P_C(r - rho F) and its distance to r."""
        out = np.empty_like(r)
        change = self.convex_set.step(self._rows(r), self._rows(F), rho, self._rows(out))
        return out, float(np.sqrt(change))

    def residual(self, r: FloatArray, u: FloatArray) -> float:
        """The natural residual ||r - P_C(r - F(r))||."""
        return self.step(r, self.map(u), 1.0)[1]

    def _rows(self, x: FloatArray) -> FloatArray:
        return x.reshape(-1, self.operator.dimension)


class Watch(Protocol):
    """Who decides when an iteration ends: for the whole problem the monitor's error, for a sub-problem its natural residual.

    `target` is the natural residual ||r - P_C(r - F(r))|| to reach.
    """

    target: float

    def visit(self, r: FloatArray, u: FloatArray | None, due: bool) -> Status | None:
        """See the iterate r with u = W r + q (None: computed where needed) and say how to stop, None to go on.

        The residual is computed where it is `due`: where a cheap bound or measure does not exclude that it is small enough.
        """

    def tick(self) -> None:
        """Count an iteration."""


class ProblemWatch:
    """Stops a method on the problem itself: the full error is computed where due, and every `period` iterations."""

    def __init__(self, velocity: Callable[[FloatArray], FloatArray], monitor: Monitor, max_iterations: int, period: int = 100) -> None:
        self._velocity, self._monitor, self._limit, self._period = velocity, monitor, max_iterations, period
        self.target = monitor.tol * monitor.scale
        self._next = monitor.iterations

    def visit(self, r: FloatArray, u: FloatArray | None, due: bool) -> Status | None:
        monitor = self._monitor
        last = monitor.iterations >= self._limit
        late = monitor.out_of_time()
        if due or last or late or monitor.iterations >= self._next:
            self._next = monitor.iterations + self._period
            error = monitor.record(r, self._velocity(r) if u is None else u)
            if error <= monitor.tol:
                return Status.SOLVED
            if not np.isfinite(error):
                return Status.DIVERGED
        if last:
            return Status.MAX_ITERATIONS
        return Status.TIME_LIMIT if late else None

    def tick(self) -> None:
        self._monitor.iterations += 1


class SubproblemWatch:
    """Stops the solution of a sub-problem at its natural residual `target`; its iterations are its own."""

    def __init__(self, inequality: Inequality, monitor: Monitor, target: float, max_iterations: int) -> None:
        self._vi, self._monitor, self._limit = inequality, monitor, max_iterations
        self.target = target
        self.iterations = 0

    def visit(self, r: FloatArray, u: FloatArray | None, due: bool) -> Status | None:
        if due:
            residual = self._vi.residual(r, self._vi.velocity(r) if u is None else u)
            if residual <= self.target:
                return Status.SOLVED
            if not np.isfinite(residual):
                return Status.DIVERGED
        if self.iterations >= self._limit:
            return Status.MAX_ITERATIONS
        return Status.TIME_LIMIT if self._monitor.out_of_time() else None

    def tick(self) -> None:
        self.iterations += 1


class LightCriterion:
    """When a cheap estimate of the residual says that the true one is worth computing: each time it fell by half (compare eq. 14)."""

    def __init__(self, start: float) -> None:
        self._threshold = start

    def due(self, estimate: float) -> bool:
        if estimate <= self._threshold or not np.isfinite(estimate):
            self._threshold = 0.5 * estimate
            return True
        return False
