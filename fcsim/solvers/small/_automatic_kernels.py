"""`auto` on few contacts in one compiled call: sweeps as long as they will soon arrive, else proximal Newton."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.solvers.small._gauss_seidel_kernels import NOT_HERE, SOLVED, STAGNATED, judged, own_compliances, solve_by_sweeps
from fcsim.solvers.small._newton_kernels import proximal_newton


@njit(cache=True, nogil=True)
def solve_automatically(
    W, q, mu, start, d, published, floor, tol, most, local_tolerance, local_iterations, rarely, watched, history, within
):  # fmt: skip
    """`solve_by_sweeps`, and where it does not arrive proximal Newton from its best iterate, then from zero, of `within` iterations each.

    Arguments and what is returned as there; iterations are sweeps and Newton's together.
    """
    ended, sweeps, rows, r, u, scale, scaled, plain, found = solve_by_sweeps(
        W, q, mu, start, d, published, floor, tol, most, local_tolerance, local_iterations, rarely, watched, history
    )
    if ended in (SOLVED, NOT_HERE):
        return ended, sweeps, rows, r, u, scale, scaled, plain, found
    compliance, iterations = own_compliances(W, len(mu), d), sweeps
    weights = np.ones(len(mu)) if published else compliance
    for attempt in range(2):
        first = r if attempt == 0 else np.zeros_like(r)
        reached, error, inside = proximal_newton(W, q, mu, compliance, weights, scale, tol, first, d, within)
        iterations += inside
        if rows < len(history):
            history[rows, 0], history[rows, 1] = iterations, error
            rows += 1
        if error <= tol:
            u, scaled, plain, found = judged(W, q, mu, compliance, reached, d)
            return SOLVED, iterations, rows, reached, u, scale, scaled, plain, found
    return STAGNATED, iterations, rows, r, u, scale, scaled, plain, found
