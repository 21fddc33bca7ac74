"""NSGS-AC from the arrays of a problem to the judged answer in one compiled call.

The sweeps are those of `gauss_seidel._sweep_kernels`, errors (penetrations' too) and checks those of
`problem._judge_kernels`; what stands here is the order
of things that `gauss_seidel.sweeps.iterate` has for the light evaluation of the error, and no other.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.linear._block_rows_kernels import block_rows_of_dense, own_blocks, product
from fcsim.problem._judge_kernels import squared_natural_residual, violations
from fcsim.solvers.gauss_seidel._sweep_kernels import change_to_await_next
from fcsim.solvers.gauss_seidel.one_contact import ONE_CONTACT
from fcsim.solvers.newton._formulation_kernels import split_compliances

sweep = ONE_CONTACT["AC"].sweep

SOLVED, MAX_ITERATIONS, STAGNATED, DIVERGED, NOT_HERE = 0, 1, 2, 3, 4
"""How `solve_by_sweeps` ends; NOT_HERE: a contact has no compliance of its own (both bodies held), which the general way settles, or
`auto` leaves the problem to its race, which has the better Newton for it."""


@njit(cache=True, nogil=True)
def embedded(W, q, r, d):
    """Block rows of W (starts, columns, blocks), q and r (nc, 3); in 2D with a second tangent of unit compliance and no velocity."""
    nc = len(q) // d
    starts, columns, own = block_rows_of_dense(W, d)
    blocks, q3, r3 = np.zeros((len(columns), 3, 3)), np.zeros((nc, 3)), np.zeros((nc, 3))
    for a in range(nc):
        for i in range(d):
            q3[a, i], r3[a, i] = q[d * a + i], r[d * a + i]
        for k in range(starts[a], starts[a + 1]):
            for i in range(d):
                for j in range(d):
                    blocks[k, i, j] = own[k, i, j]
            if d == 2 and columns[k] == a:
                blocks[k, 2, 2] = 1.0
    return starts, columns, blocks, q3, r3


@njit(cache=True, nogil=True)
def error_of(starts, columns, blocks, q3, r3, mu, compliance, scale, r, u, d):
    """The error at r3 (nc, 3), with r and u (m,) filled in."""
    u3 = product(starts, columns, blocks, q3, r3)
    for a in range(len(mu)):
        for i in range(d):
            r[d * a + i], u[d * a + i] = r3[a, i], u3[a, i]
    residual = np.sqrt(squared_natural_residual(r, u, mu, compliance, d))
    return residual / scale if scale > 0.0 else (0.0 if residual == 0.0 else np.inf)


@njit(cache=True, nogil=True)
def judged(W, q, mu, compliance, r, d):
    """u (m,) from r by the problem's own equation, whatever a method carried; the scaled and the published residual, and `violations`."""
    u = np.empty_like(q)
    for i in range(len(q)):
        u[i] = q[i]
        for j in range(len(q)):
            u[i] += W[i, j] * r[j]
    scaled = np.sqrt(squared_natural_residual(r, u, mu, compliance, d))
    plain = np.sqrt(squared_natural_residual(r, u, mu, np.ones(len(mu)), d, False))
    return u, scaled, plain, violations(r, u, q, mu, d)


@njit(cache=True, nogil=True)
def own_compliances(W, nc, d):
    """tr(W_aa) / d (nc,)."""
    compliance = np.zeros(nc)
    for a in range(nc):
        for i in range(d):
            compliance[a] += W[d * a + i, d * a + i] / d
    return compliance


@njit(cache=True, nogil=True)
def solve_by_sweeps(W, q, mu, start, d, published, floor, tol, most, local_tolerance, local_iterations, rarely, history):
    """Sweep from `start` (m,) until the error is at most tol; at most `most` sweeps, the full error at least every `rarely` ones.

    published: whether the published error decides; history (rows, 2): sweeps and error are noted there as long as there is room.
    Return how it ended, sweeps, rows of the history, r and u (m,), what errors divide by, the scaled and the published residual, and
    `violations`. Long because a call of a compiled function from Python costs as much as some sweeps: it is one.
    """
    nc = len(mu)
    zero, none = np.zeros_like(q), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    compliance = own_compliances(W, nc, d)
    if not np.all(compliance > 0.0):
        return NOT_HERE, 0, 0, zero, q, 0.0, 0.0, 0.0, none
    weights = np.ones(nc) if published else compliance
    scale = max(np.sqrt(np.sum(q * q)), floor)
    r, u, best = zero.copy(), q.copy(), zero
    sweeps, rows, ended = 0, 0, SOLVED
    resting = np.sqrt(squared_natural_residual(zero, q, mu, weights, d))
    if not (resting == 0.0 or (scale > 0.0 and resting / scale <= tol)):
        starts, columns, blocks, q3, r3 = embedded(W, q, start, d)
        diagonal, shift = own_blocks(starts, columns, blocks), np.zeros(nc)
        largest = split_compliances(diagonal[:, :d, :d].copy())
        if not np.all(largest > 0.0):
            return NOT_HERE, 0, 0, zero, q, 0.0, 0.0, 0.0, none
        rho, order, frozen = np.ascontiguousarray(1.0 / largest[:, :2]), np.arange(nc), np.zeros(nc, dtype=np.int64)
        error = error_of(starts, columns, blocks, q3, r3, mu, weights, scale, r, u, d)
        history[0, 0], history[0, 1], rows = 0, error, 1
        tau, last, least, best = tol, 0, error, r.copy()
        unfiltered, never = np.bool_(False), np.int64(0)  # False and 0 alone are types of their own to numba: a sweep more to compile
        while not error <= tol:
            if not np.isfinite(error):
                ended = DIVERGED
                break
            if sweeps >= most:
                ended = MAX_ITERATIONS
                break
            count = max(1, min(rarely - (sweeps - last), most - sweeps))
            change, size, _, done = sweep(
                starts,
                columns,
                blocks,
                diagonal,
                shift,
                q3,
                mu,
                rho,
                order,
                r3,
                frozen,
                local_tolerance,
                local_iterations,
                1.0,
                unfiltered,
                never,
                0.0,
                count,
                tau,
            )
            sweeps += done
            light = np.sqrt(change / size) if size > 0.0 else change
            if not np.isfinite(light):
                ended = DIVERGED
                break
            if not (light <= tau or sweeps - last >= rarely) and sweeps < most:
                continue
            error = error_of(starts, columns, blocks, q3, r3, mu, weights, scale, r, u, d)
            last = sweeps
            if rows < len(history):
                history[rows, 0], history[rows, 1] = sweeps, error
                rows += 1
            if error < least:
                least, best = error, r.copy()
            if light == 0.0 and error > tol:
                ended = STAGNATED
                break
            if light <= tau and error > tol:
                tau = change_to_await_next(tau, light, tol / error)
        if ended != SOLVED:
            r = best
    u, scaled, plain, found = judged(W, q, mu, compliance, r, d)
    return ended, sweeps, rows, r, u, scale, scaled, plain, found
