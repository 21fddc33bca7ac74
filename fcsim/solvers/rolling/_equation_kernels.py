"""The equations of Alart and Curnier for contacts with rolling and spinning friction, with their derivatives; compiled by numba."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def contact_equations(u, r, coefficients, rho, F, A, B):
    """F (d,), A = dF/du, B = dF/dr (d, d) of one contact, d = 5 or 6, in place; coefficients (3,): mu, mu_r, mu_s.

    With y = r - rho u: F_N = r_N - [y_N]_+, and for each of the parts i = T, R, S of its own disk F_i = r_i - P_D(y_i), D of radius
    mu_i [y_N]_+. These are the complementarity of r_N and u_N and the most dissipation of each part, that is K* ∋ u + g(u) ⊥ r ∈ K.
    """
    d = len(u)
    for i in range(d):
        F[i] = r[i]
    A[:, :] = 0.0
    B[:, :] = 0.0
    pressure = r[0] - rho[0] * u[0]
    if pressure <= 0.0:
        for i in range(d):
            B[i, i] = 1.0
        return
    F[0] = rho[0] * u[0]
    A[0, 0] = rho[0]
    for part in range((d - 1 + 1) // 2):
        begin = 1 + 2 * part
        end = min(begin + 2, d)
        radius = coefficients[part] * pressure
        norm = 0.0
        for i in range(begin, end):
            norm = np.hypot(norm, r[i] - rho[i] * u[i])
        if norm <= radius and radius > 0.0:  # a disk of radius 0 holds nothing
            for i in range(begin, end):
                F[i] = rho[i] * u[i]
                A[i, i] = rho[i]
            continue
        scale = 1.0 / norm if norm > 0.0 else 0.0
        for i in range(begin, end):
            n = (r[i] - rho[i] * u[i]) * scale
            F[i] = r[i] - radius * n
            A[i, 0] = coefficients[part] * rho[0] * n
            B[i, 0] = -coefficients[part] * n
            for j in range(begin, end):
                one = 1.0 if i == j else 0.0
                P = radius * scale * (one - n * (r[j] - rho[j] * u[j]) * scale) if end - begin > 1 else 0.0
                A[i, j] = P * rho[j]
                B[i, j] = one - P


@njit(cache=True)
def equations(u, r, coefficients, rho):
    """F (nc, d), A and B (nc, d, d) of `contact_equations`; coefficients (nc, 3)."""
    nc, d = u.shape
    F, A, B = np.empty((nc, d)), np.empty((nc, d, d)), np.empty((nc, d, d))
    for a in range(nc):
        contact_equations(u[a], r[a], coefficients[a], rho[a], F[a], A[a], B[a])
    return F, A, B
