"""`auto` on few contacts in one compiled call: sweeps as long as they will soon arrive, else proximal Newton."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.problem._cone_kernels import cone_projection
from fcsim.solvers.small._gauss_seidel_kernels import NOT_HERE, SOLVED, STAGNATED, judged, own_compliances, solve_by_sweeps
from fcsim.solvers.small._newton_kernels import proximal_newton


@njit(cache=True, nogil=True)
def projected(r, mu, d):
    """P_K(r) (m,): Newton's reactions leave the cone by what is left of its equations, where those of sweeps never do."""
    inside = np.empty_like(r)
    for a in range(len(mu)):
        i = a * d
        r0, r1, r2 = cone_projection(r[i], r[i + 1], r[i + 2] if d == 3 else 0.0, mu[a])
        inside[i], inside[i + 1] = r0, r1
        if d == 3:
            inside[i + 2] = r2
    return inside


@njit(cache=True, nogil=True)
def solve_automatically(
    W, q, mu, start, d, published, floor, tol, most, local_tolerance, local_iterations, rarely, watched, history, within
):  # fmt: skip
    """`solve_by_sweeps`, and where it does not arrive proximal Newton from its best iterate, then from zero, of `within` iterations each.

    Arguments and what is returned as there; iterations are sweeps and Newton's together. Newton's answer is brought back to the cone where
    that leaves it one.
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
            admissible = projected(reached, mu, d)
            u, scaled, plain, found = judged(W, q, mu, compliance, admissible, d)
            if (plain if published else scaled) <= tol * scale:
                return SOLVED, iterations, rows, admissible, u, scale, scaled, plain, found
            u, scaled, plain, found = judged(W, q, mu, compliance, reached, d)
            return SOLVED, iterations, rows, reached, u, scale, scaled, plain, found
    return STAGNATED, iterations, rows, r, u, scale, scaled, plain, found
