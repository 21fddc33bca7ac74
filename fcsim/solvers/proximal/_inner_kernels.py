"""Newton's method on a path's regularised problem in the bodies' velocities, in one compiled call; see `path`.

What `Regularised.newton` does iteration by iteration with `pieces.InVelocities`: with statuses and K of z,

    (M + H K H^T) dv = H P(z) - p,    p = H r,    p + M dv, z - rho H^T dv.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.linear.block_factors._single_factor_kernels import factorise_single
from fcsim.linear.block_factors._single_kernels import solve_single
from fcsim.solvers.newton.systems._velocity_kernels import add_shares_to_rows
from fcsim.solvers.proximal._following_kernels import add_product, push_all, speeds
from fcsim.solvers.proximal._path_kernels import law, statuses

FOUND, NOT_FOUND = 0, 1
"""How `newton_on_pieces` ends."""


@njit(cache=True, nogil=True)
def product(faces, unknowns, h, fronts, of_mass, p):
    """W r (nc, 4) of p = H r (n,): the arguments as of `newton_on_pieces`."""
    n, u = len(p), np.empty((len(unknowns), 4))
    v, x, buffer = np.zeros(n + 1), np.empty(n), np.empty(n)
    order, begins, starts, below, offsets, _, _, _ = fronts
    solve_single(order, begins, starts, below, offsets, *of_mass, p, x, buffer, v)
    speeds(faces, unknowns, h, v, np.empty(h.shape[1]), u)
    return u


@njit(cache=True, nogil=True)
def newton_on_pieces(
    faces, unknowns, h, _, rows, places, masses, plan, fronts, mass, of_mass, z, p, mu, rho, target, runaway, most,
):  # fmt: skip
    """(how it ended, iterations, P(z) (nc, 3)) from z (nc, 3), p = H r (n,): until ||W (P(z) - r)|| is at most target.

    faces to mass: as of `follow_in_velocities`; of_mass: M factored, its last three of the fronts' arrays; runaway: growth of
    that at which it is given up; most: iterations.
    """
    n = len(p)
    z, first, done = z.copy(), np.inf, 0
    b, dv, u, now = np.zeros(n + 1), np.zeros(n + 1), np.empty((len(z), 4)), np.zeros(n + 1)
    for i in range(n):
        now[i] = p[i]
    x, buffer, own = np.empty(n), np.empty(n), np.empty(h.shape[1])
    order, begins, starts, below, offsets, values, borders, pivots = fronts
    while True:
        found, K = law(z, mu, rho, statuses(z, mu))
        b[:] = 0.0
        push_all(unknowns, h, found, b)
        b -= now
        solve_single(order, begins, starts, below, offsets, *of_mass, b, x, buffer, dv)
        speeds(faces, unknowns, h, dv, own, u)
        rest = np.sqrt(np.sum(u**2))
        if rest <= target:
            return FOUND, done, found
        first = min(first, rest)
        if done == most or not rest < runaway * first:
            return NOT_FOUND, done, found
        shares = masses.copy()
        add_shares_to_rows(shares, places, rows, K)
        if not factorise_single(plan, begins, starts, offsets, shares, values, borders, pivots):
            return NOT_FOUND, done, found
        solve_single(order, begins, starts, below, offsets, values, borders, pivots, b, x, buffer, dv)
        speeds(faces, unknowns, h, dv, own, u)
        add_product(mass, dv, 1.0, now)
        for a in range(len(z)):
            for i in range(3):
                z[a, i] -= rho[a] * u[a, i]  # not from u anew, of which a last bit is many of z
        done += 1
