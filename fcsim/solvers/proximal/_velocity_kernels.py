"""Newton's iterations on a regularised problem in the bodies' velocities, compiled: those of `newton.iterations` with `VelocitySystem`."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.linear.block_factors._dense_kernels import solve_dense
from fcsim.linear.block_factors._single_factor_kernels import factorise_single
from fcsim.linear.block_factors._single_kernels import solve_single
from fcsim.problem._judge_kernels import squared_natural_residual
from fcsim.solvers.newton._formulation_kernels import rho_factor
from fcsim.solvers.newton.systems._velocity_kernels import add_shares, add_shares_to_rows

ON_ITS_WAY, ARRIVED, SINGULAR, STILL, ENDLESS = 0, 1, 2, 3, 4
"""How `newton_in_velocities` ends: after its iterations, at the target, at a singular matrix, at a step of nothing, at no number."""


@njit(cache=True, fastmath={"contract"})
def eliminated(u, r, mu, rho, shift, K, c):
    """Into K (nc, d, d), c (nc, d) `contacts_eliminated` of `disk_equations` (Alart and Curnier) for the right side -F, in closed form;
    returns the first contact whose own equations are singular, or -1.

    With y = r - rho u: open contacts have K = 0, c = -r; what sticks K = 1 / shift. Beside the disk of radius mu y_N, n = y_T / ||y_T||,
    P = radius / ||y_T|| (1 - n n^T):

        (P rho shift + 1 - P) [K_T, c_T] = [A_T, -F_T] - mu n (rho_N shift_N - 1) [K_N, c_N].
    """
    nc, d = u.shape
    for a in range(nc):
        y0 = r[a, 0] - rho[a, 0] * u[a, 0]
        if not y0 > 0.0:
            for i in range(d):
                c[a, i] = -r[a, i]
                for j in range(d):
                    K[a, i, j] = 0.0
            continue
        if rho[a, 0] * shift[a, 0] == 0.0:
            return a
        K[a, 0, 0], c[a, 0] = 1.0 / shift[a, 0], (y0 - r[a, 0]) / (rho[a, 0] * shift[a, 0])
        last = d - 1
        y1 = r[a, 1] - rho[a, 1] * u[a, 1]
        y2 = r[a, last] - rho[a, last] * u[a, last] if d == 3 else 0.0
        size, radius = np.sqrt(y1 * y1 + y2 * y2), mu[a] * y0
        if d == 3:
            K[a, 0, last], K[a, last, 0], K[a, 1, last], K[a, last, 1] = 0.0, 0.0, 0.0, 0.0
        K[a, 0, 1], K[a, 1, 0] = 0.0, 0.0
        if size <= radius and radius > 0.0:
            for i in range(1, d):
                if rho[a, i] * shift[a, i] == 0.0:
                    return a
                K[a, i, i] = 1.0 / shift[a, i]
            c[a, last] = (y2 - r[a, last]) / (rho[a, last] * shift[a, last])
            c[a, 1] = (y1 - r[a, 1]) / (rho[a, 1] * shift[a, 1])
            continue
        scale = 1.0 / size if size > 0.0 else 1.0
        ratio, n1, n2 = radius * scale, y1 * scale, y2 * scale
        widened, bent = mu[a] * (rho[a, 0] * shift[a, 0] - 1.0), mu[a] * rho[a, 0]
        from_normal, pushed = bent - widened * K[a, 0, 0], widened * c[a, 0]
        p11 = ratio * (1.0 - n1 * n1)
        c11 = p11 * rho[a, 1] * shift[a, 1] + 1.0 - p11
        f1 = radius * n1 - r[a, 1] - n1 * pushed
        if d == 2:
            if c11 == 0.0:
                return a
            K[a, 1, 0], K[a, 1, 1], c[a, 1] = n1 * from_normal / c11, p11 * rho[a, 1] / c11, f1 / c11
            continue
        p12, p22 = -ratio * n1 * n2, ratio * (1.0 - n2 * n2)
        c12, c21 = p12 * (rho[a, 2] * shift[a, 2] - 1.0), p12 * (rho[a, 1] * shift[a, 1] - 1.0)
        c22, f2 = p22 * rho[a, 2] * shift[a, 2] + 1.0 - p22, radius * n2 - r[a, 2] - n2 * pushed
        det = c11 * c22 - c12 * c21
        if det == 0.0:
            return a
        i11, i12, i21, i22 = c22 / det, -c12 / det, -c21 / det, c11 / det
        K[a, 1, 0], K[a, 2, 0] = (i11 * n1 + i12 * n2) * from_normal, (i21 * n1 + i22 * n2) * from_normal
        K[a, 1, 1], K[a, 1, 2] = (i11 * p11 + i12 * p12) * rho[a, 1], (i11 * p12 + i12 * p22) * rho[a, 2]
        K[a, 2, 1], K[a, 2, 2] = (i21 * p11 + i22 * p12) * rho[a, 1], (i21 * p12 + i22 * p22) * rho[a, 2]
        c[a, 1], c[a, 2] = i11 * f1 + i12 * f2, i21 * f1 + i22 * f2
    return -1


@njit(cache=True, fastmath={"contract"})
def at_rest(faces, unknowns, h, c, n):
    """H c (n,) for c (nc, d): h (nc, d, k) on the unknowns (nc, k), -1 where a contact has fewer, the same ones from faces[g] to
    faces[g + 1]."""
    _, d, k = h.shape
    right, pushed = np.zeros(n), np.empty(k)
    for g in range(len(faces) - 1):
        some = False
        for a in range(faces[g], faces[g + 1]):
            for i in range(d):
                f = c[a, i]
                if f == 0.0:
                    continue
                if not some:
                    some = True
                    pushed[:] = 0.0
                for j in range(k):
                    pushed[j] += h[a, i, j] * f
        if some:
            for j in range(k):
                if unknowns[faces[g], j] < 0:
                    break
                right[unknowns[faces[g], j]] += pushed[j]
    return right


@njit(cache=True, fastmath={"contract", "reassoc"})
def speeds(faces, unknowns, h, v, u):
    """Into u (nc, d) H^T v of v (n,); the arguments as of `at_rest`."""
    _, d, k = h.shape
    own = np.empty(k)
    for g in range(len(faces) - 1):
        for j in range(k):
            column = unknowns[faces[g], j]
            own[j] = v[column] if column >= 0 else 0.0
        for a in range(faces[g], faces[g + 1]):
            for i in range(d):
                total, row = 0.0, h[a, i]
                for j in range(k):
                    total += row[j] * own[j]
                u[a, i] = total


@njit(cache=True)
def adapted(rho, least, most, du, dr):
    """rho (nc, d) in place, as `adapted_rho` does normals and tangents of 2D and 3D."""
    nc, d = rho.shape
    for a in range(nc):
        u_size, r_size = du[a, 1] * du[a, 1], dr[a, 1] * dr[a, 1]
        if d == 3:
            u_size, r_size = u_size + du[a, 2] * du[a, 2], r_size + dr[a, 2] * dr[a, 2]
        for i in range(d):
            stretch, size = rho[a, i] * np.sqrt(u_size), np.sqrt(r_size)
            if i == 0:
                stretch, size = rho[a, 0] * abs(du[a, 0]), abs(dr[a, 0])
            factor = rho_factor(stretch, size)
            rho[a, i] = min(max(rho[a, i] * factor, least[a, i]), most[a, i])


@njit(cache=True)
def moved(K, c, shift, du, dr, r, u):
    """dr = c - K du, and du of the shifted W, in place, added to r, u (m,); whether any reaction has changed."""
    nc, d = c.shape
    some = False
    for a in range(nc):
        for i in range(d):
            total = c[a, i]
            for j in range(d):
                total -= K[a, i, j] * du[a, j]
            dr[a, i] = total
        for i in range(d):
            du[a, i] += shift[a, i] * dr[a, i]
            before = r[a * d + i]
            r[a * d + i] += dr[a, i]
            u[a * d + i] += du[a, i]
            some = some or r[a * d + i] != before
    return some


@njit(cache=True)
def newton_in_velocities(
    faces, unknowns, h, n, mass, places, masses, plan, fronts, own, least, most, mu, weights, r, u, rho, target, iterations,
):  # fmt: skip
    """Newton's iterations in place on r, u (m,) and rho (nc, d) until the residual is at most target, `iterations` at the most.

    faces, unknowns, h: as of `at_rest`; mass (n, n): M where the bodies' matrix is eliminated dense, else empty, and `masses` is M in the
    pattern whose `planned` is `plan`, factored into `fronts` (see `Bodies.arrays`); places: where that has the contacts' shares. own (m,)
    > 0: the contacts' shift and own compliances; least, most (nc, d): the range of rho; weights (nc,): s of the
    residual. Return how it ended, the iterations, the best iterate (m,) and its residual. u is carried along: who believes it computes it
    anew. Long because it is one iteration from its residual to the next.
    """
    nc, d, _ = h.shape
    done, best, smallest = 0, r.copy(), np.inf
    shift = own.reshape(nc, d)
    du, dr, K, c = np.empty((nc, d)), np.empty((nc, d)), np.empty((nc, d, d)), np.empty((nc, d))
    order, begins, starts, rows, offsets, values, borders, pivots = fronts
    x, buffer, dv = np.empty(n), np.empty(n), np.empty(n)
    while True:
        residual = np.sqrt(squared_natural_residual(r, u, mu, weights, d))
        if residual < smallest:
            smallest = residual
            for i in range(len(r)):
                best[i] = r[i]
        if residual <= target:
            return ARRIVED, done, best, smallest
        if not np.isfinite(residual):
            return ENDLESS, done, best, smallest
        if done >= iterations:
            return ON_ITS_WAY, done, best, smallest
        if eliminated(u.reshape(nc, d), r.reshape(nc, d), mu, rho, shift, K, c) >= 0:
            return SINGULAR, done, best, smallest
        right = at_rest(faces, unknowns, h, c, n)
        if len(mass):
            S = mass.copy()
            add_shares(S, unknowns, h, K)
            if not solve_dense(S, right):
                return SINGULAR, done, best, smallest
            for i in range(n):
                dv[i] = right[i]
        else:
            shares = masses.copy()
            add_shares_to_rows(shares, places, h, K)
            if not factorise_single(plan, begins, starts, offsets, shares, values, borders, pivots):
                return SINGULAR, done, best, smallest
            solve_single(order, begins, starts, rows, offsets, values, borders, pivots, right, x, buffer, dv)
        speeds(faces, unknowns, h, dv, du)
        some = moved(K, c, shift, du, dr, r, u)
        done += 1
        if not some:
            return STILL, done, best, smallest
        adapted(rho, least, most, du, dr)
