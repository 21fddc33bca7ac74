"""Nonsmooth Newton on the KKT form of a global problem: unknowns (v, r), matrix [[M, -H], [A H^T, B]] by MUMPS, without forming W.

The same for a mixed local problem: unknowns (r, l), matrix [[A W + B, A V], [V^T, R]], without eliminating l.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim import runtime
from fcsim.arrays import FloatArray, Matrix
from fcsim.errors import InputError
from fcsim.linear.factors import Factor, Mumps, SuperLU, factorise
from fcsim.problem.problem import GlobalForm
from fcsim.problem.reduction import Elimination, Reduction
from fcsim.solvers.base import Iterate, Monitor
from fcsim.solvers.newton.iterations import newton_iterations
from fcsim.solvers.newton.options import NewtonOptions


class _SaddleMatrix:
    """[[M, -H, -G], [A H^T, B, 0], [G^T, 0, 0]] on a pattern found once, so that MUMPS analyses it once.

    Explicit zeros of A and B stay in the pattern; new values are summed into place by one bincount.
    """

    def __init__(self, p: GlobalForm) -> None:
        d, n, m, nc = p.dimension, p.n, p.m, p.nc
        M, H = sp.coo_array(p.entries), sp.coo_array(p.H)
        contact = H.col // d
        local = np.arange(d)
        rows = [M.row, H.row, (n + contact[:, None] * d + local).ravel()]
        columns = [M.col, n + H.col, np.repeat(H.row, d)]
        dofs = (n + np.arange(nc)[:, None] * d + local)[:, :, None]
        rows.append(np.broadcast_to(dofs, (nc, d, d)).ravel())
        columns.append(np.broadcast_to(dofs.transpose(0, 2, 1), (nc, d, d)).ravel())
        self._constant = [M.data, -H.data]
        self._border = np.empty(0)
        size = n + m
        if p.G is not None:
            G = sp.coo_array(p.G)
            rows += [G.row, size + G.col]
            columns += [size + G.col, G.row]
            self._border = np.concatenate([-G.data, G.data])
            size += G.shape[1]
        key = np.concatenate([np.asarray(i, dtype=np.int64) for i in rows]) * size + np.concatenate(columns)
        unique, self._place = np.unique(key, return_inverse=True)
        self._indices = unique % size
        self._indptr = np.searchsorted(unique, np.arange(size + 1) * size)
        self._size = size
        self._contact, self._component, self._h = contact, H.col % d, H.data

    def __call__(self, A: FloatArray, B: FloatArray) -> sp.csr_array:
        AHT = A[self._contact, :, self._component] * self._h[:, None]
        values = np.concatenate([*self._constant, AHT.ravel(), B.ravel(), self._border])
        data = np.bincount(self._place, weights=values, minlength=len(self._indices))
        return sp.csr_array((data, self._indices, self._indptr), shape=(self._size, self._size))


class GlobalSpace:
    """(v, r[, l]) with M v = H r + G l + f, G^T v + b = 0 and u = H^T v + w, which every iterate satisfies."""

    def __init__(self, reduction: Reduction, r: FloatArray) -> None:
        p = self._problem = reduction.problem
        self._H, self._HT = sp.csr_array(p.H), sp.csr_array(p.H.T)
        self._saddle = _SaddleMatrix(p)
        self._factor: Factor | None = None
        self._r, self.needed, self.foreseen = r, 0.0, False
        self._v, self.multiplier = reduction.velocity(r)
        self.recompute()

    def recompute(self) -> None:
        self.u = self._HT @ self._v + self._problem.w
        self.exact = True

    def step(self, A: FloatArray, B: FloatArray, F: FloatArray) -> tuple[FloatArray, FloatArray]:
        p, n = self._problem, self._problem.n
        # the linear rows are zero but for round-off, which is not left to grow
        rhs = [self._H @ self._r + p.f - p.M @ self._v, -F.ravel()]
        if p.G is not None and p.b is not None and self.multiplier is not None:
            rhs = [rhs[0] + p.G @ self.multiplier, rhs[1], -(p.G.T @ self._v + p.b)]
        self._factor = _factorise(self._saddle(A, B), self._factor)
        self._step = self._factor.solve(np.concatenate(rhs))
        return self._step[n : n + p.m], self._HT @ self._step[:n]

    def gradient(self, A: FloatArray, B: FloatArray, F: FloatArray) -> tuple[FloatArray, FloatArray]:
        raise InputError(NO_GRADIENT)

    def move(self, t: float) -> None:
        p, n, step = self._problem, self._problem.n, t * self._step
        self._v, self._r = self._v + step[:n], self._r + step[n : n + p.m]
        if self.multiplier is not None:
            self.multiplier = self.multiplier + step[n + p.m :]
        self.recompute()


def newton_global(reduction: Reduction, r: FloatArray, monitor: Monitor, options: NewtonOptions) -> Iterate:
    """Newton on (v, r[, l]) from the starting point r (m,)."""
    if options.safeguard:
        raise InputError(NO_GRADIENT)
    space = GlobalSpace(reduction, r)
    return newton_iterations(space, r, reduction.diagonal_blocks, reduction.problem.mu, monitor, options)


class MixedSpace:
    """(r, l) with u = W r + V l + q and V^T r + R l + s = 0, which every iterate satisfies."""

    def __init__(self, elimination: Elimination, r: FloatArray) -> None:
        p = self._problem = elimination.problem
        self.needed, self.foreseen = 0.0, False
        self._r, self._l = r, elimination.multiplier(r)
        self._sparse = sp.issparse(p.W)
        kind = sp.csr_array if self._sparse else np.asarray
        self._W, self._V, self._R = kind(p.W), *(kind(x) if self._sparse else _dense(x) for x in (p.V, p.R))
        self.recompute()

    def recompute(self) -> None:
        self.u = self._W @ self._r + self._V @ self._l + self._problem.q
        self.exact = True

    def step(self, A: FloatArray, B: FloatArray, F: FloatArray) -> tuple[FloatArray, FloatArray]:
        p = self._problem
        nc, d = A.shape[:2]
        # [[A W + B, A V], [V^T, R]] (dr, dl) = -(F, V^T r + R l + s), whose last rows are zero but for round-off
        rhs = -np.concatenate([F.ravel(), self._V.T @ self._r + self._R @ self._l + p.s])
        if self._sparse:
            blocks = [sp.csr_array(sp.bsr_array((x, np.arange(nc), np.arange(nc + 1)), blocksize=(d, d))) for x in (A, B)]
            matrix = sp.csr_array(sp.block_array([[blocks[0] @ self._W + blocks[1], blocks[0] @ self._V], [self._V.T, self._R]]))
        else:
            J = (A @ self._W.reshape(nc, d, p.m)).reshape(p.m, p.m)
            own = np.arange(nc)
            J.reshape(nc, d, nc, d)[own, :, own, :] += B
            matrix = np.block([[J, (A @ self._V.reshape(nc, d, -1)).reshape(p.m, -1)], [self._V.T, self._R]])
        step = factorise(matrix).solve(rhs)
        self._dr, self._dl = step[: p.m], step[p.m :]
        return self._dr, self._W @ self._dr + self._V @ self._dl

    def gradient(self, A: FloatArray, B: FloatArray, F: FloatArray) -> tuple[FloatArray, FloatArray]:
        raise InputError(NO_GRADIENT)

    def move(self, t: float) -> None:
        self._r, self._l = self._r + t * self._dr, self._l + t * self._dl
        self.recompute()


def newton_mixed(elimination: Elimination, r: FloatArray, monitor: Monitor, options: NewtonOptions) -> Iterate:
    """Newton on (r, l) of a mixed local problem from the starting point r (m,), without filling W in by elimination."""
    if options.safeguard:
        raise InputError(NO_GRADIENT)
    space = MixedSpace(elimination, r)
    return newton_iterations(space, r, elimination.diagonal_blocks, elimination.problem.mu, monitor, options)


NO_GRADIENT = "option safeguard: expected off with linear='kkt', which has no W to form the gradient with"


def _dense(matrix: Matrix) -> FloatArray:
    return matrix if isinstance(matrix, np.ndarray) else matrix.toarray()


def _factorise(matrix: sp.csr_array, factor: Factor | None) -> Factor:
    """MUMPS on the pattern analysed before, SuperLU where petsc4py is not there."""
    if isinstance(factor, Mumps):
        factor.refactor(matrix)
        return factor
    return Mumps(matrix) if runtime.has_petsc() else SuperLU(matrix)
