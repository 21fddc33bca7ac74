"""Newton's iterations on a regularised problem in the bodies' velocities, compiled: those of `newton.iterations` with `VelocitySystem`."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.linear.block_factors._dense_kernels import solve_dense
from fcsim.linear.block_factors._lu_kernels import factorise, solve
from fcsim.problem._judge_kernels import squared_natural_residual
from fcsim.solvers.newton._formulation_kernels import adapted_rho, disk_equations
from fcsim.solvers.newton.systems._velocity_kernels import add_shares, add_shares_to_rows, contacts_eliminated

ON_ITS_WAY, ARRIVED, SINGULAR, STILL, ENDLESS = 0, 1, 2, 3, 4
"""How `newton_in_velocities` ends: after its iterations, at the target, at a singular matrix, at a step of nothing, at no number."""


@njit(cache=True)
def at_rest(unknowns, h, c, n):
    """H c (n,) for c (nc, d): h (nc, d, k) on the unknowns (nc, k), -1 where a contact has fewer."""
    nc, d, k = h.shape
    right = np.zeros(n)
    for a in range(nc):
        for j in range(k):
            if unknowns[a, j] < 0:
                break
            for i in range(d):
                right[unknowns[a, j]] += h[a, i, j] * c[a, i]
    return right


@njit(cache=True)
def newton_in_velocities(
    unknowns, h, n, mass, places, masses, indptr, indices, mirror, order, front, starts, rows, number, width, border, offsets, values,
    pivots, own, first, least, most, mu, weights, r, u, rho, target, iterations,
):  # fmt: skip
    """Newton's iterations in place on r, u (m,) and rho (nc, d) until the residual is at most target, `iterations` at the most.

    mass (n, n): M where the bodies' matrix is eliminated dense, else empty, and `masses` is M in the pattern of (indptr, indices), of whose
    fronts the arrays between `mirror` and `pivots` are those of `BlockLU`; places: where that has the contacts' shares. own (m,) > 0:
    the contacts' shift and own compliances; first, least, most (nc, d): where rho began and its range; weights (nc,): s of the residual.
    Return how it ended, the iterations, the best iterate (m,) and its residual. u is carried along: who believes it computes it anew.
    Long because it is one iteration from its residual to the next.
    """
    nc, d, k = h.shape
    done, best, smallest = 0, r.copy(), np.inf
    shift = own.reshape(nc, d)
    du, dr = np.empty((nc, d)), np.empty((nc, d))
    while True:
        residual = np.sqrt(squared_natural_residual(r, u, mu, weights, d))
        if residual < smallest:
            smallest = residual
            best[:] = r
        if residual <= target:
            return ARRIVED, done, best, smallest
        if not np.isfinite(residual):
            return ENDLESS, done, best, smallest
        if done >= iterations:
            return ON_ITS_WAY, done, best, smallest
        F, A, B = disk_equations(u.reshape(nc, d), r.reshape(nc, d), mu, rho, False)
        K, c, singular = contacts_eliminated(A, B, shift, -F)
        if singular >= 0:
            return SINGULAR, done, best, smallest
        dv = at_rest(unknowns, h, c, n)
        if len(mass):
            S = mass.copy()
            add_shares(S, unknowns, h, K)
            if not solve_dense(S, dv):
                return SINGULAR, done, best, smallest
        else:
            shares = masses.copy()
            add_shares_to_rows(shares, places, h, K)
            if not factorise(
                indptr, indices, mirror, shares.reshape(-1, 1, 1), order, front, starts, rows, number, width, border, offsets, values,
                pivots,
            ):  # fmt: skip
                return SINGULAR, done, best, smallest
            dv = solve(order, front, starts, rows, number, width, border, offsets, values, pivots, 1, dv)
        moved = False
        for a in range(nc):
            for i in range(d):
                du[a, i] = 0.0
            for j in range(k):
                if unknowns[a, j] < 0:
                    break
                for i in range(d):
                    du[a, i] += h[a, i, j] * dv[unknowns[a, j]]
            for i in range(d):
                dr[a, i] = c[a, i]
                for j in range(d):
                    dr[a, i] -= K[a, i, j] * du[a, j]
            for i in range(d):
                du[a, i] += shift[a, i] * dr[a, i]
                before = r[a * d + i]
                r[a * d + i] += dr[a, i]
                u[a * d + i] += du[a, i]
                moved = moved or r[a * d + i] != before
        done += 1
        if not moved:
            return STILL, done, best, smallest
        rho[:] = adapted_rho(rho, least, most, du, dr, True)
