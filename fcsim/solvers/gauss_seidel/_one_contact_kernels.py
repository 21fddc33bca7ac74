"""One-contact solvers compiled by numba: u = W r + q, K* ∋ u + g(u) ⊥ r ∈ K with W (3, 3), all with one signature.

    solver(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations) -> (r0, r1, r2, solved)

r0, r1, r2 come in as the starting point; tol is absolute, in the unit of r. Vectors are passed by component, W in the sweeps as a tuple of
rows (elsewhere an array does), so that they stay in registers; what a sweep calls at every visit is inlined for the same reason.
Newton's equations are those of `formulations`; where Newton fails, De Saxcé's fixed point takes its place.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.problem._cone_kernels import cone_projection, disk_projection

HYBRID_LOOPS, HYBRID_PROJECTIONS = 1, 100
LINE_SEARCH_TRIALS = 10
"""Siconos' defaults of the hybrid local strategy and of the local line search."""


@njit(cache=True, forceinline=True)
def velocity(W, q0, q1, q2, r0, r1, r2):
    """u = W r + q."""
    return (
        W[0][0] * r0 + W[0][1] * r1 + W[0][2] * r2 + q0,
        W[1][0] * r0 + W[1][1] * r1 + W[1][2] * r2 + q1,
        W[2][0] * r0 + W[2][1] * r1 + W[2][2] * r2 + q2,
    )


@njit(cache=True, forceinline=True)
def natural_step(W, q0, q1, q2, mu, rho, r0, r1, r2):
    """P_K(r - rho (u + g(u)))."""
    u0, u1, u2 = velocity(W, q0, q1, q2, r0, r1, r2)
    return cone_projection(r0 - rho * (u0 + mu * np.sqrt(u1 * u1 + u2 * u2)), r1 - rho * u1, r2 - rho * u2, mu)


@njit(cache=True)
def natural_residual(W, q0, q1, q2, mu, rho, r0, r1, r2):
    """||r - P_K(r - rho (u + g(u)))||^2, infinite where it is not a number."""
    z0, z1, z2 = natural_step(W, q0, q1, q2, mu, rho, r0, r1, r2)
    residual = (z0 - r0) ** 2 + (z1 - r1) ** 2 + (z2 - r2) ** 2
    return residual if np.isfinite(residual) else np.inf


# -- projections ----------------------------------------------------------------------------------------------------------------------


@njit(cache=True)
def project_de_saxce(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations):
    """De Saxcé's fixed point r <- P_K(r - rho (u + g(u))), rho = min(rho_N, rho_T), until its change is at most tol."""
    rho = min(rho_N, rho_T)
    for _ in range(max_iterations):
        z0, z1, z2 = natural_step(W, q0, q1, q2, mu, rho, r0, r1, r2)
        change = (z0 - r0) ** 2 + (z1 - r1) ** 2 + (z2 - r2) ** 2
        r0, r1, r2 = z0, z1, z2
        if change <= tol * tol:
            return r0, r1, r2, True
    return r0, r1, r2, False


@njit(cache=True)
def project_once(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations):
    """One De Saxcé projection."""
    r0, r1, r2 = natural_step(W, q0, q1, q2, mu, min(rho_N, rho_T), r0, r1, r2)
    return r0, r1, r2, True


@njit(cache=True)
def project_in_diagonal_metric(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations):
    """One projection with W replaced by diag(1/rho_N, 1/rho_T, 1/rho_T): P_K in that metric, so that a fixed point is still a solution.

    With r = D^(1/2) r', D = diag(rho_N, rho_T, rho_T), the cone of r' has the coefficient mu (rho_N / rho_T)^(1/2).
    """
    u0, u1, u2 = velocity(W, q0, q1, q2, r0, r1, r2)
    a, b = np.sqrt(rho_N), np.sqrt(rho_T)
    z0 = r0 / a - a * (u0 + mu * np.sqrt(u1 * u1 + u2 * u2))
    z0, z1, z2 = cone_projection(z0, r1 / b - b * u1, r2 / b - b * u2, mu * a / b)
    return a * z0, b * z1, b * z2, True


@njit(cache=True)
def project_self_adaptive(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations):
    """Fixed point of the natural map with a self-adaptive step (UPK: Khobotov 1987, Marcotte 1991; Acary, Brémond, Huber 2018).

    rho is accepted when rho ||F(r) - F(z)|| <= L ||r - z||, F(r) = u + g(u), shortened by tau otherwise; it grows by 1/tau where the
    ratio falls below L_min. L = 0.9, L_min = 0.3, tau = 2/3 as in Siconos.
    """
    rho = min(rho_N, rho_T)
    u0, u1, u2 = velocity(W, q0, q1, q2, r0, r1, r2)
    f0 = u0 + mu * np.sqrt(u1 * u1 + u2 * u2)
    for _ in range(max_iterations):
        z0 = z1 = z2 = v1 = v2 = h0 = 0.0
        change = ratio = 0.0
        for _ in range(100):
            z0, z1, z2 = cone_projection(r0 - rho * f0, r1 - rho * u1, r2 - rho * u2, mu)
            v0, v1, v2 = velocity(W, q0, q1, q2, z0, z1, z2)
            h0 = v0 + mu * np.sqrt(v1 * v1 + v2 * v2)
            change = (z0 - r0) ** 2 + (z1 - r1) ** 2 + (z2 - r2) ** 2
            difference = (h0 - f0) ** 2 + (v1 - u1) ** 2 + (v2 - u2) ** 2
            ratio = rho * np.sqrt(difference / change) if change > 0 else 0.0
            if not ratio > 0.9:
                break
            rho *= 2.0 / 3.0
        r0, r1, r2, f0, u1, u2 = z0, z1, z2, h0, v1, v2
        if change <= tol * tol:
            return r0, r1, r2, True
        if ratio < 0.3:
            rho *= 1.5
    return r0, r1, r2, False


@njit(cache=True)
def project_cylinder(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations):
    """r_N <- [r_N - rho_N u_N]_+, r_T <- the projection of r_T - rho_T u_T on the disk of radius mu r_N, until the change is <= tol."""
    for _ in range(max_iterations):
        u0, u1, u2 = velocity(W, q0, q1, q2, r0, r1, r2)
        z0 = max(r0 - rho_N * u0, 0.0)
        z1, z2 = disk_projection(r1 - rho_T * u1, r2 - rho_T * u2, mu * z0)
        change = (z0 - r0) ** 2 + (z1 - r1) ** 2 + (z2 - r2) ** 2
        r0, r1, r2 = z0, z1, z2
        if change <= tol * tol:
            return r0, r1, r2, True
    return r0, r1, r2, False


@njit(cache=True)
def project_cylinder_once(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations):
    """One projection on the cylinder."""
    r0, r1, r2, _ = project_cylinder(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, 1)
    return r0, r1, r2, True


# -- Newton ---------------------------------------------------------------------------------------------------------------------------


@njit(cache=True)
def _equations(jean_moreau, q0, q1, q2, W, mu, rho_N, rho_T, r0, r1, r2):
    """F of AC (eq. 8) or JM (eq. 9) alone, for the line search."""
    u0, u1, u2 = velocity(W, q0, q1, q2, r0, r1, r2)
    y0, y1, y2 = r0 - rho_N * u0, r1 - rho_T * u1, r2 - rho_T * u2
    radius = mu * max(r0 if jean_moreau else y0, 0.0)
    norm = np.sqrt(y1 * y1 + y2 * y2)
    ratio = radius / norm if norm > radius else 1.0
    return r0 - max(y0, 0.0), r1 - ratio * y1, r2 - ratio * y2


@njit(cache=True)
def _step_length(jean_moreau, W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, d0, d1, d2, value):
    """Goldstein-Price on 0.5 ||F||^2 = value along the Newton direction d, whose slope is -2 value (m1 = 0.1, m2 = 0.9)."""
    low, high, t = 0.0, np.inf, 1.0
    for _ in range(LINE_SEARCH_TRIALS):
        F0, F1, F2 = _equations(jean_moreau, q0, q1, q2, W, mu, rho_N, rho_T, r0 + t * d0, r1 + t * d1, r2 + t * d2)
        rate = (0.5 * (F0 * F0 + F1 * F1 + F2 * F2) - value) / t
        if not rate <= -0.2 * value:
            high = t
        elif rate < -1.8 * value:
            low = t
        else:
            return t
        t = 2 * t if np.isinf(high) else 0.5 * (low + high)
    return t


@njit(cache=True, forceinline=True)
def _newton(jean_moreau, damped, W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations):
    """Newton on AC or JM from r until ||F|| <= tol; return (r0, r1, r2, solved)."""
    for _ in range(max_iterations + 1):
        u0, u1, u2 = velocity(W, q0, q1, q2, r0, r1, r2)
        y0 = r0 - rho_N * u0
        if y0 <= 0.0 and not jean_moreau:  # open: F = r
            if r0 * r0 + r1 * r1 + r2 * r2 <= tol * tol:
                return 0.0, 0.0, 0.0, True
            r0 = r1 = r2 = 0.0
            if q0 >= 0.0:
                return 0.0, 0.0, 0.0, True
            continue
        radius = mu * max(r0, 0.0) if jean_moreau else mu * y0
        y1 = r1 - rho_T * u1
        y2 = r2 - rho_T * u2
        norm2 = y1 * y1 + y2 * y2
        # rows of J = A W + B, row by row
        if y0 > 0.0:
            F0 = rho_N * u0
            J00, J01, J02 = rho_N * W[0][0], rho_N * W[0][1], rho_N * W[0][2]
        else:
            F0 = r0
            J00, J01, J02 = 1.0, 0.0, 0.0
        if norm2 <= radius * radius and radius > 0.0:
            F1, F2 = rho_T * u1, rho_T * u2
            J10, J11, J12 = rho_T * W[1][0], rho_T * W[1][1], rho_T * W[1][2]
            J20, J21, J22 = rho_T * W[2][0], rho_T * W[2][1], rho_T * W[2][2]
        else:
            norm = np.sqrt(norm2)
            inverse = 1.0 / norm if norm > 0.0 else 0.0
            n1, n2, ratio = y1 * inverse, y2 * inverse, radius * inverse
            F1, F2 = r1 - radius * n1, r2 - radius * n2
            P11, P12, P22 = ratio * (1 - n1 * n1), -ratio * n1 * n2, ratio * (1 - n2 * n2)
            # the disk's radius depends on y0 (AC) or on r0 (JM)
            a = 0.0 if jean_moreau else mu * rho_N
            b = 0.0 if jean_moreau and r0 <= 0.0 else mu
            J10 = a * n1 * W[0][0] + rho_T * (P11 * W[1][0] + P12 * W[2][0]) - b * n1
            J11 = a * n1 * W[0][1] + rho_T * (P11 * W[1][1] + P12 * W[2][1]) + 1 - P11
            J12 = a * n1 * W[0][2] + rho_T * (P11 * W[1][2] + P12 * W[2][2]) - P12
            J20 = a * n2 * W[0][0] + rho_T * (P12 * W[1][0] + P22 * W[2][0]) - b * n2
            J21 = a * n2 * W[0][1] + rho_T * (P12 * W[1][1] + P22 * W[2][1]) - P12
            J22 = a * n2 * W[0][2] + rho_T * (P12 * W[1][2] + P22 * W[2][2]) + 1 - P22
        size = F0 * F0 + F1 * F1 + F2 * F2
        if size <= tol * tol:
            return r0, r1, r2, True
        # Cramer's rule
        c0, c1, c2 = J11 * J22 - J12 * J21, J12 * J20 - J10 * J22, J10 * J21 - J11 * J20
        det = J00 * c0 + J01 * c1 + J02 * c2
        if det == 0.0 or not np.isfinite(det):
            return r0, r1, r2, False
        scale = -1.0 / det
        d0 = scale * (F0 * c0 + F1 * (J02 * J21 - J01 * J22) + F2 * (J01 * J12 - J02 * J11))
        d1 = scale * (F0 * c1 + F1 * (J00 * J22 - J02 * J20) + F2 * (J02 * J10 - J00 * J12))
        d2 = scale * (F0 * c2 + F1 * (J01 * J20 - J00 * J21) + F2 * (J00 * J11 - J01 * J10))
        if damped:
            t = _step_length(jean_moreau, W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, d0, d1, d2, 0.5 * size)
            d0, d1, d2 = t * d0, t * d1, t * d2
        r0, r1, r2 = r0 + d0, r1 + d1, r2 + d2
    return r0, r1, r2, False


@njit(cache=True, forceinline=True)
def _newton_or_projections(jean_moreau, damped, W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations):
    """Newton; where it fails, De Saxcé's fixed point from the same starting point."""
    s0, s1, s2, solved = _newton(jean_moreau, damped, W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations)
    if solved:
        return s0, s1, s2, True
    return project_de_saxce(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, 10 * max_iterations)


@njit(cache=True)
def _newton_hybrid(jean_moreau, W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations):
    """Damped Newton, then a loop of projections and damped Newton from where they lead; the best of what was found."""
    s0, s1, s2, solved = _newton(jean_moreau, True, W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations)
    for _ in range(HYBRID_LOOPS):
        if solved:
            return s0, s1, s2, True
        r0, r1, r2, solved = project_de_saxce(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, HYBRID_PROJECTIONS)
        if solved:
            return r0, r1, r2, True
        s0, s1, s2, solved = _newton(jean_moreau, True, W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations)
    rho = min(rho_N, rho_T)
    if natural_residual(W, q0, q1, q2, mu, rho, s0, s1, s2) <= natural_residual(W, q0, q1, q2, mu, rho, r0, r1, r2):
        return s0, s1, s2, solved
    return r0, r1, r2, False


@njit(cache=True, forceinline=True)
def newton_alart_curnier(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations):
    """AC, full steps."""
    return _newton_or_projections(False, False, W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations)


@njit(cache=True, forceinline=True)
def newton_jean_moreau(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations):
    """JM, full steps."""
    return _newton_or_projections(True, False, W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations)


@njit(cache=True)
def newton_alart_curnier_damped(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations):
    """AC with the Goldstein-Price line search."""
    return _newton_or_projections(False, True, W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations)


@njit(cache=True)
def newton_jean_moreau_damped(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations):
    """JM with the Goldstein-Price line search."""
    return _newton_or_projections(True, True, W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations)


@njit(cache=True)
def newton_alart_curnier_hybrid(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations):
    """AC by the hybrid local strategy."""
    return _newton_hybrid(False, W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations)


@njit(cache=True)
def newton_jean_moreau_hybrid(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations):
    """JM by the hybrid local strategy."""
    return _newton_hybrid(True, W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations)
