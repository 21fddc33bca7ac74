"""Nonsmooth Gauss-Seidel on the local problem: contact after contact, each solved with the others' reactions fixed.

Sources: Jourdan, Alart, Jean, "A Gauss-Seidel like algorithm to solve frictional contact problems", Comput. Methods Appl. Mech. Eng.
155, 1998; Acary, Brémond, Huber 2018 (NSGS-AC; light criterion eq. 14).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.errors import InputError
from fcsim.problem import LocalProblem
from fcsim.solvers._kernels import sweep_alart_curnier
from fcsim.solvers.base import Iterate, Monitor, Options, Status
from fcsim.solvers.scaling import split_spectral_norm

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class GaussSeidelOptions(Options):
    """local_tolerance: of a contact's own equations, relative to its reaction; local_iterations: cap of its Newton method;
    stagnation_sweeps: how many sweeps may pass without the error falling by a tenth before giving up (0 = never).
    """

    max_iterations: int = 10_000
    local_tolerance: float = 1e-14
    local_iterations: int = 20
    stagnation_sweeps: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.local_tolerance >= 0:
            raise InputError(f"option local_tolerance: expected a number >= 0, got {self.local_tolerance}")
        if self.local_iterations < 1:
            raise InputError(f"option local_iterations: expected an integer >= 1, got {self.local_iterations}")


def block_rows(W: Any, dimension: int) -> tuple[NDArray[np.int64], NDArray[np.int64], FloatArray]:
    """Return W by block rows: indptr (nc + 1,), block columns, blocks (nnz, 3, 3).

    A 2D problem is embedded: its second tangent gets a unit compliance and no velocity, so its reaction stays zero.
    """
    d = dimension
    if isinstance(W, np.ndarray):
        nc = W.shape[0] // d
        tiles = W.reshape(nc, d, nc, d)
        row, column = np.nonzero(np.any(tiles, axis=(1, 3)) | np.eye(nc, dtype=bool))
        blocks = np.ascontiguousarray(tiles[row, :, column, :])
        indptr = np.searchsorted(row, np.arange(nc + 1))
    else:
        bsr = sp.bsr_array(W, blocksize=(d, d))
        nc = bsr.shape[0] // d
        row = np.repeat(np.arange(nc), np.diff(bsr.indptr))
        indptr, column, blocks = bsr.indptr.astype(np.int64), bsr.indices.astype(np.int64), bsr.data
    if d == 2:
        embedded = np.zeros((len(blocks), 3, 3))
        embedded[:, :2, :2] = blocks
        embedded[row == column, 2, 2] = 1
        blocks = embedded
    return indptr.astype(np.int64), column.astype(np.int64), np.ascontiguousarray(blocks)


def nsgs_alart_curnier(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: GaussSeidelOptions) -> Iterate:
    """NSGS-AC: sweeps with a local Newton method on the Alart-Curnier equations, from the starting point r (m,).

    The light criterion ||r_k+1 - r_k|| / ||r_k+1|| < tau (eq. 14) says when to compute the full error; tau follows the ratio of
    the two, so that few full errors are computed.
    """
    d, nc = problem.dimension, problem.nc
    indptr, indices, blocks = block_rows(problem.W, d)
    diagonal, q, rows = np.zeros((nc, 3, 3)), np.zeros((nc, 3)), np.zeros((nc, 3))
    diagonal[:, :d, :d] = problem.diagonal_blocks
    if d == 2:
        diagonal[:, 2, 2] = 1
    q[:, :d], rows[:, :d] = problem.q.reshape(nc, d), r.reshape(nc, d)
    rho = np.ascontiguousarray(split_spectral_norm(problem.diagonal_blocks)[:, :2])
    order = np.arange(nc)

    def flat() -> FloatArray:
        return rows[:, :d].ravel().copy()

    r = flat()
    error = monitor.record(r, problem.W @ r + problem.q)
    tau, last_progress, least = monitor.tol, monitor.iterations, error
    while error > monitor.tol:
        if monitor.iterations >= options.max_iterations:
            return Iterate(r, Status.MAX_ITERATIONS)
        if monitor.out_of_time():
            r = flat()
            error = monitor.record(r, problem.W @ r + problem.q)
            return Iterate(r, Status.SOLVED if error <= monitor.tol else Status.TIME_LIMIT)
        change, size, _ = sweep_alart_curnier(
            indptr, indices, blocks, diagonal, q, problem.mu, rho, order, rows, options.local_tolerance, options.local_iterations
        )
        monitor.iterations += 1
        if not np.isfinite(size):
            return Iterate(r, Status.DIVERGED)
        light = np.sqrt(change / size) if size > 0 else 0.0
        if light <= tau or monitor.iterations % 100 == 0 or monitor.iterations == options.max_iterations:
            r = flat()
            error = monitor.record(r, problem.W @ r + problem.q)
            if light <= tau and error > monitor.tol:
                tau = min(0.5 * tau, light * monitor.tol / error)
                if light == 0.0:
                    return Iterate(r, Status.STAGNATED)
            if error < 0.9 * least:
                least, last_progress = error, monitor.iterations
            elif options.stagnation_sweeps and monitor.iterations - last_progress >= options.stagnation_sweeps:
                return Iterate(r, Status.STAGNATED)
    return Iterate(r, Status.SOLVED)
