"""Nonsmooth Newton on the global problem: unknowns (v, r), matrix [[M, -H], [A H^T, B]], factored by MUMPS without forming W."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim import runtime
from fcsim.errors import InputError
from fcsim.linear import Factor, Mumps, SingularMatrix, SuperLU
from fcsim.problem import GlobalProblem
from fcsim.reduction import Reduction
from fcsim.solvers.base import Iterate, Monitor, Status
from fcsim.solvers.formulations import FORMULATIONS
from fcsim.solvers.newton import NewtonOptions
from fcsim.solvers.scaling import RHO_RULES

FloatArray = NDArray[np.float64]


class _SaddleMatrix:
    """[[M, -H, -G], [A H^T, B, 0], [G^T, 0, 0]] on a pattern found once, so that MUMPS analyses it once.

    Explicit zeros of A and B stay in the pattern; new values are summed into place by one bincount.
    """

    def __init__(self, p: GlobalProblem) -> None:
        d, n, m, nc = p.dimension, p.n, p.m, p.nc
        M, H = sp.coo_array(p.M), sp.coo_array(p.H)
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

    def __call__(self, A: FloatArray, B: FloatArray) -> Any:
        AHT = A[self._contact, :, self._component] * self._h[:, None]
        values = np.concatenate([*self._constant, AHT.ravel(), B.ravel(), self._border])
        data = np.bincount(self._place, weights=values, minlength=len(self._indices))
        return sp.csr_array((data, self._indices, self._indptr), shape=(self._size, self._size))


def newton_global(reduction: Reduction, r: FloatArray, monitor: Monitor, options: NewtonOptions) -> Iterate:
    """Newton on (v, r[, l]) from the starting point r (m,)."""
    if options.line_search != "none":
        raise InputError(f"option line_search: expected 'none' with linear='kkt', got {options.line_search!r}")
    p = reduction.problem
    d, nc, m, n = p.dimension, p.nc, p.m, p.n
    H, HT = sp.csr_array(p.H), sp.csr_array(p.H.T)
    rho = RHO_RULES[options.rho](reduction.diagonal_blocks) * options.rho_factor
    formulation = FORMULATIONS[options.formulation]
    saddle = _SaddleMatrix(p)
    factor: Factor | None = None
    v, multiplier = reduction.velocity(r)
    while True:
        u = HT @ v + p.w
        error = monitor.record(r, u)
        if error <= monitor.tol:
            return Iterate(r, Status.SOLVED)
        if not np.isfinite(error):
            return Iterate(r, Status.DIVERGED)
        if monitor.iterations >= options.max_iterations:
            return Iterate(r, Status.MAX_ITERATIONS)
        if monitor.out_of_time():
            return Iterate(r, Status.TIME_LIMIT)
        F, A, B = formulation(u.reshape(nc, d), r.reshape(nc, d), p.mu, rho)
        rhs = [H @ r + p.f - p.M @ v, -F.ravel()]
        if p.G is not None and p.b is not None:
            rhs = [rhs[0] + p.G @ multiplier, rhs[1], -(p.G.T @ v + p.b)]
        try:
            if isinstance(factor, Mumps):
                factor.refactor(saddle(A, B))
            else:
                factor = Mumps(saddle(A, B)) if runtime.has_petsc() else SuperLU(saddle(A, B))
            step = factor.solve(np.concatenate(rhs))
        except SingularMatrix:
            return Iterate(r, Status.SINGULAR)
        v, r = v + step[:n], r + step[n : n + m]
        if multiplier is not None:
            multiplier = multiplier + step[n + m :]
        monitor.iterations += 1
