"""Newton's method on a path's regularised problem in the bodies' velocities, in one compiled call; see `path`.

What `Regularised.newton` does iteration by iteration with `pieces.InVelocities`: with statuses and K of z,

    (M + H K H^T) dv = H (P(z) - r),    dr = P(z) - r - K H^T dv,    r + dr, z - rho H^T dv.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.linear.block_factors._lu_kernels import factorise, solve
from fcsim.solvers.newton.systems._velocity_kernels import add_shares_to_rows
from fcsim.solvers.proximal._path_kernels import law, statuses

FOUND, NOT_FOUND = 0, 1
"""How `newton_on_pieces` ends."""


@njit(cache=True)
def impulses(unknowns, h, r, n):
    """H r (n,) of r (nc, d): h (nc, d, k) on the unknowns (nc, k), -1 where a contact has fewer."""
    nc, d, k = h.shape
    b = np.zeros(n)
    for a in range(nc):
        for i in range(d):
            f = r[a, i]
            if f == 0.0:
                continue
            for j in range(k):
                if unknowns[a, j] < 0:
                    break
                b[unknowns[a, j]] += f * h[a, i, j]
    return b


@njit(cache=True)
def velocities(unknowns, h, v):
    """H^T v (nc, d) of v (n,)."""
    nc, d, k = h.shape
    u = np.zeros((nc, d))
    for a in range(nc):
        for j in range(k):
            if unknowns[a, j] < 0:
                break
            speed = v[unknowns[a, j]]
            for i in range(d):
                u[a, i] += h[a, i, j] * speed
    return u


@njit(cache=True)
def product(unknowns, h, factor, r):
    """W r (nc, d) with the factor of M by fronts."""
    return velocities(unknowns, h, solve(*factor, 1, impulses(unknowns, h, r, len(factor[0]))))


@njit(cache=True)
def newton_on_pieces(unknowns, h, places, masses, pattern, factor, factor_of_mass, z, r, mu, rho, target, runaway, most):
    """(how it ended, iterations, P(z) (nc, d)) from z, r (nc, d): until ||W (P(z) - r)|| is at most target, for so many iterations.

    unknowns to factor: as of `follow_in_velocities`; runaway: growth of that at which it is given up; most: iterations.
    """
    nc, d = z.shape
    z, r, first, done = z.copy(), r.copy(), np.inf, 0
    while True:
        found, K = law(z, mu, rho, statuses(z, mu))
        F = found - r
        b = impulses(unknowns, h, F, len(factor[0]))
        rest = np.sqrt(np.sum(velocities(unknowns, h, solve(*factor_of_mass, 1, b)) ** 2))
        if rest <= target:
            return FOUND, done, found
        first = min(first, rest)
        if done == most or not rest < runaway * first:
            return NOT_FOUND, done, found
        shares = masses.copy()
        add_shares_to_rows(shares, places, h, K)
        if not factorise(*pattern, shares.reshape(-1, 1, 1), *factor):
            return NOT_FOUND, done, found
        du = velocities(unknowns, h, solve(*factor, 1, b))
        for a in range(nc):
            for i in range(d):
                total = F[a, i]
                for j in range(d):
                    total -= K[a, i, j] * du[a, j]
                r[a, i] += total
                z[a, i] -= rho[a] * du[a, i]  # not from u anew, of which a last bit is many of z
        done += 1
