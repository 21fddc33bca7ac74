"""Proximal Newton on a dense W of few contacts in one compiled call: PROX-NEWTON's steps, NSN-AC with an adapting rho inside.

The equations are those of `newton._formulation_kernels`, the errors those of `problem._judge_kernels` (penetrations' too), the
constants those of `proximal`, compiled in; what stands here is the order of things that `proximal.steps` and `newton.iterations` have,
which are its twin in the tests.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.linear.block_factors._dense_kernels import affine, solve_dense
from fcsim.problem._judge_kernels import squared_natural_residual
from fcsim.solvers.newton._formulation_kernels import ALART_CURNIER, SPLIT, adapted_rho, disk_equations, split_compliances
from fcsim.solvers.newton.systems._direct_kernels import active_matrix
from fcsim.solvers.proximal.options import FORGOTTEN, PROXIMAL_NEWTON, RISE
from fcsim.solvers.proximal.steps import INEXACT, MOST_ALPHA, RUNAWAY, SUFFICIENT

ALPHA, SIGMA, EASY, LEAST_ALPHA = PROXIMAL_NEWTON.alpha, PROXIMAL_NEWTON.sigma, PROXIMAL_NEWTON.easy, PROXIMAL_NEWTON.alpha_least
ACCURACY = 1.0 / PROXIMAL_NEWTON.internal_error_ratio
INSIDE = 8
"""Newton's iterations on an inner problem at the most (the table's)."""
NARROWEST, WIDEST = 0.01, 100.0
"""Range of an adapting rho about its first value, that of `scaling.adaptive_range`."""


@njit(cache=True, nogil=True)
def newton_step(W, shift, A, B, F):
    """dr (m,) with A (W + shift) dr + B dr = -F; contacts with A = 0 are open and leave the system. Empty where it is singular."""
    nc, d = F.shape
    dr, active, count = np.zeros(nc * d), np.empty(nc, dtype=np.int64), 0
    for a in range(nc):
        if np.any(A[a]):
            active[count] = a
            count += 1
        else:
            for i in range(d):
                dr[a * d + i] = -F[a, i]
    active = active[:count]
    zero, rhs = np.zeros(nc * d), np.empty(count * d)
    coupling = affine(W, dr, zero, zero)
    for k in range(count):
        a = active[k]
        for i in range(d):
            rhs[k * d + i] = -F[a, i]
            for j in range(d):
                rhs[k * d + i] -= A[a, i, j] * coupling[a * d + j]
    J = np.empty((count * d, count * d))
    active_matrix(W, shift, A, B, active, J)
    if not solve_dense(J, rhs):
        return np.empty(0)
    for k in range(count):
        for i in range(d):
            dr[active[k] * d + i] = rhs[k * d + i]
    return dr


@njit(cache=True, nogil=True)
def inner_problem(W, blocks, shift, q, mu, weights, r, target, most):
    """Newton on (W + shift, q) from r (m,) until the residual is at most target; at most `most` iterations.

    blocks (nc, d, d): W_aa; shift (nc,). Return whether it is solved, the best iterate, its residual, and the iterations.
    """
    nc, d = blocks.shape[:2]
    own, by_unknown = blocks.copy(), np.repeat(shift, d)
    for a in range(nc):
        for i in range(d):
            own[a, i, i] += shift[a]
    first = 1.0 / split_compliances(own)
    rho, iterations, best, least = first, 0, r, np.inf
    u = affine(W, r, by_unknown, q)
    while True:
        residual = np.sqrt(squared_natural_residual(r, u, mu, weights, d))
        if residual < least:
            best, least = r, residual
        if residual <= target:
            return True, best, least, iterations
        if not np.isfinite(residual) or iterations >= most:
            return False, best, least, iterations
        F, A, B = disk_equations(u.reshape(nc, d), r.reshape(nc, d), mu, rho, ALART_CURNIER)
        dr = newton_step(W, shift, A, B, F)
        if not len(dr):
            return False, best, least, iterations
        following = r + dr
        iterations += 1
        if np.all(following == r):
            return False, best, least, iterations
        r, before = following, u
        u = affine(W, r, by_unknown, q)
        du = (u - before).reshape(nc, d)
        rho = adapted_rho(rho, NARROWEST * first, WIDEST * first, du, dr.reshape(nc, d), SPLIT)


@njit(cache=True, nogil=True)
def proximal_newton(W, q, mu, metric, weights, scale, tol, r, d, most, alone, decade):
    """Proximal steps from r (m,) until the error is at most tol, at most `most` iterations of Newton inside.

    metric (nc,): D; weights (nc,): s of the error; scale: what it is divided by. It is given up after `alone` iterations and `decade` for
    each power of ten by which its error has fallen. Return the best iterate, its error, and the iterations.
    """
    nc = len(mu)
    blocks = np.empty((nc, d, d))
    for a in range(nc):
        for i in range(d):
            for j in range(d):
                blocks[a, i, j] = W[a * d + i, a * d + j]
    none = np.zeros(nc * d)
    error = np.sqrt(squared_natural_residual(r, affine(W, r, none, q), mu, weights, d)) / scale
    alpha, floor, best, least, iterations, first = ALPHA, LEAST_ALPHA, r, error, 0, error
    while not error <= tol and iterations < most and np.isfinite(error):
        if iterations >= alone + decade * np.log10(first / least):
            break
        target = max(tol, min(error, 1.0)) * ACCURACY
        shift = alpha * metric
        moved = q - np.repeat(shift, d) * r
        solved, new, residual, inside = inner_problem(
            W, blocks, shift, moved, mu, weights, r, scale * target, min(INSIDE, most - iterations)
        )
        iterations += max(inside, 1)
        reached, new_error = residual / scale, np.inf
        if solved or reached <= error:
            new_error = np.sqrt(squared_natural_residual(new, affine(W, new, none, q), mu, weights, d)) / scale
        good = solved or new_error <= tol or (new_error < SUFFICIENT * error and reached <= INEXACT * error)
        if good or new_error < error:
            r, error = new, new_error
            if error < least:
                best, least = r, error
        if good and error <= RUNAWAY * least:
            if solved:
                alpha = max(alpha / SIGMA if inside <= EASY else alpha, floor)
                floor = max(FORGOTTEN * floor, LEAST_ALPHA)
        else:
            if error > RUNAWAY * least:
                r, error = best, least
            floor = alpha
            alpha *= RISE
            if alpha > MOST_ALPHA:
                break
    return best, least, iterations
