"""NNCG: the nonsmooth nonlinear conjugate gradient method, whose gradient is what a Gauss-Seidel sweep changes.

With S a sweep from the start s_k, r_k = S(s_k) and g_k = s_k - r_k the numbered steps are

    1. r = S(s), g = s - r
    2. beta = ||g||^2 / ||g_last||^2                                   (Fletcher-Reeves)
    3. beta > 1: p = 0, s = r                                          (restart)
       else:     s = r + beta p, p = beta p - g

On rank-deficient W of grains and blocks it takes a half to an eighth of the sweeps of plain Gauss-Seidel, where that creeps.

Source: M. Silcowitz-Hansen, S. Niebe, K. Erleben, "A nonsmooth nonlinear conjugate gradient method for interactive contact force
problems", The Visual Computer 26, 2010.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.linear.block_rows import embed_vector
from fcsim.problem import LocalProblem
from fcsim.solvers.base import Iterate, Monitor
from fcsim.solvers.gauss_seidel.one_contact import ONE_CONTACT
from fcsim.solvers.gauss_seidel.rows import ContactRows
from fcsim.solvers.gauss_seidel.sweeps import SweepOptions, contact_order, iterate


def nncg(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: SweepOptions, rows: ContactRows | None = None) -> Iterate:
    """NNCG from the starting point r (m,); the iterates are those after a sweep, in the cone. rows: the problem's, where known already."""
    d, nc = problem.dimension, problem.nc
    solver = ONE_CONTACT[options.one_contact]
    if rows is None:
        rows = ContactRows.of(problem, solver.rho)
    reaction = embed_vector(r, d)
    order, frozen = contact_order(nc, options), np.zeros(nc, dtype=np.int64)
    start, direction, last = reaction.copy(), np.zeros_like(reaction), 0.0

    def sweep(tolerance: float, tau: float, count: int) -> tuple[float, int]:
        nonlocal last
        last, size, done, _ = solver.sweep_conjugate(
            *(rows.indptr, rows.indices, rows.blocks, rows.diagonal, rows.shift, rows.q, rows.mu, rows.rho, order(), reaction, frozen),
            *(start, direction, last, tolerance, options.local_iterations, options.relaxation),
            *(count if options.shuffle != "each sweep" else 1, tau if options.error_evaluation == "light" else 0.0),
        )
        return float(np.sqrt(last / size)) if size > 0 else float(last), done

    def point() -> tuple[FloatArray, FloatArray]:
        return reaction[:, :d].flatten(), rows.velocity(reaction)[:, :d].flatten()

    return iterate(sweep, point, nc, monitor, options)
