"""Loops over contacts, compiled by numba: one-contact solvers and Gauss-Seidel sweeps on block-sparse W (d = 3)."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def newton_alart_curnier(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations):
    """Solve one contact's AC equations, u = W r + q, W (3, 3); return (r0, r1, r2, solved).

    `solved` when ||F|| <= tol. The derivatives are those of formulations.alart_curnier.
    """
    for _ in range(max_iterations + 1):
        u0 = W[0, 0] * r0 + W[0, 1] * r1 + W[0, 2] * r2 + q0
        u1 = W[1, 0] * r0 + W[1, 1] * r1 + W[1, 2] * r2 + q1
        u2 = W[2, 0] * r0 + W[2, 1] * r1 + W[2, 2] * r2 + q2
        y0 = r0 - rho_N * u0
        if y0 <= 0.0:  # open: F = r
            if r0 * r0 + r1 * r1 + r2 * r2 <= tol * tol:
                return 0.0, 0.0, 0.0, True
            r0 = r1 = r2 = 0.0
            if q0 >= 0.0:
                return 0.0, 0.0, 0.0, True
            continue
        radius = mu * y0
        y1 = r1 - rho_T * u1
        y2 = r2 - rho_T * u2
        norm = np.sqrt(y1 * y1 + y2 * y2)
        F0 = rho_N * u0
        # rows of J = A W + B, row by row
        J00, J01, J02 = rho_N * W[0, 0], rho_N * W[0, 1], rho_N * W[0, 2]
        if norm <= radius:
            F1, F2 = rho_T * u1, rho_T * u2
            J10, J11, J12 = rho_T * W[1, 0], rho_T * W[1, 1], rho_T * W[1, 2]
            J20, J21, J22 = rho_T * W[2, 0], rho_T * W[2, 1], rho_T * W[2, 2]
        else:
            n1, n2 = y1 / norm, y2 / norm
            F1, F2 = r1 - radius * n1, r2 - radius * n2
            ratio = radius / norm
            P11, P12, P22 = ratio * (1 - n1 * n1), -ratio * n1 * n2, ratio * (1 - n2 * n2)
            a10, a20 = mu * rho_N * n1, mu * rho_N * n2
            J10 = a10 * W[0, 0] + rho_T * (P11 * W[1, 0] + P12 * W[2, 0]) - mu * n1
            J11 = a10 * W[0, 1] + rho_T * (P11 * W[1, 1] + P12 * W[2, 1]) + 1 - P11
            J12 = a10 * W[0, 2] + rho_T * (P11 * W[1, 2] + P12 * W[2, 2]) - P12
            J20 = a20 * W[0, 0] + rho_T * (P12 * W[1, 0] + P22 * W[2, 0]) - mu * n2
            J21 = a20 * W[0, 1] + rho_T * (P12 * W[1, 1] + P22 * W[2, 1]) - P12
            J22 = a20 * W[0, 2] + rho_T * (P12 * W[1, 2] + P22 * W[2, 2]) + 1 - P22
        size = F0 * F0 + F1 * F1 + F2 * F2
        if size <= tol * tol:
            return r0, r1, r2, True
        # Cramer's rule
        c0, c1, c2 = J11 * J22 - J12 * J21, J12 * J20 - J10 * J22, J10 * J21 - J11 * J20
        det = J00 * c0 + J01 * c1 + J02 * c2
        if det == 0.0 or not np.isfinite(det):
            return r0, r1, r2, False
        d0 = -(F0 * c0 + F1 * (J02 * J21 - J01 * J22) + F2 * (J01 * J12 - J02 * J11)) / det
        d1 = -(F0 * c1 + F1 * (J00 * J22 - J02 * J20) + F2 * (J02 * J10 - J00 * J12)) / det
        d2 = -(F0 * c2 + F1 * (J01 * J20 - J00 * J21) + F2 * (J00 * J11 - J01 * J10)) / det
        r0, r1, r2 = r0 + d0, r1 + d1, r2 + d2
    return r0, r1, r2, False


@njit(cache=True)
def project_de_saxce(W, q0, q1, q2, mu, rho, r0, r1, r2, tol, max_iterations):
    """De Saxcé fixed point r <- P_K(r - rho (u + g(u))) on one contact; return (r0, r1, r2, solved)."""
    for _ in range(max_iterations):
        u0 = W[0, 0] * r0 + W[0, 1] * r1 + W[0, 2] * r2 + q0
        u1 = W[1, 0] * r0 + W[1, 1] * r1 + W[1, 2] * r2 + q1
        u2 = W[2, 0] * r0 + W[2, 1] * r1 + W[2, 2] * r2 + q2
        z0 = r0 - rho * (u0 + mu * np.sqrt(u1 * u1 + u2 * u2))
        z1, z2 = r1 - rho * u1, r2 - rho * u2
        norm = np.sqrt(z1 * z1 + z2 * z2)
        if mu * norm <= -z0:
            z0 = z1 = z2 = 0.0
        elif norm > mu * z0:
            s = (z0 + mu * norm) / (1 + mu * mu)
            z0, z1, z2 = s, mu * s * z1 / norm, mu * s * z2 / norm
        change = (z0 - r0) ** 2 + (z1 - r1) ** 2 + (z2 - r2) ** 2
        r0, r1, r2 = z0, z1, z2
        if change <= tol * tol:
            return r0, r1, r2, True
    return r0, r1, r2, False


@njit(cache=True)
def sweep_alart_curnier(indptr, indices, blocks, diagonal, q, mu, rho, order, r, local_tolerance, local_iterations):
    """One Gauss-Seidel sweep over the contacts in `order`, in place on r (nc, 3); return (||change||^2, ||r||^2, local failures).

    indptr, indices, blocks (nnz, 3, 3): W by block rows; diagonal (nc, 3, 3) its own blocks; rho (nc, 2): rho_N, rho_T.
    Where the local Newton method fails, De Saxcé's fixed point takes its place.
    """
    change = 0.0
    size = 0.0
    failures = 0
    for a in order:
        q0, q1, q2 = q[a, 0], q[a, 1], q[a, 2]
        for k in range(indptr[a], indptr[a + 1]):
            b = indices[k]
            if b != a:
                w = blocks[k]
                s0, s1, s2 = r[b, 0], r[b, 1], r[b, 2]
                q0 += w[0, 0] * s0 + w[0, 1] * s1 + w[0, 2] * s2
                q1 += w[1, 0] * s0 + w[1, 1] * s1 + w[1, 2] * s2
                q2 += w[2, 0] * s0 + w[2, 1] * s1 + w[2, 2] * s2
        old0, old1, old2 = r[a, 0], r[a, 1], r[a, 2]
        tol = local_tolerance * (np.sqrt(old0 * old0 + old1 * old1 + old2 * old2) + rho[a, 0] * np.sqrt(q0 * q0 + q1 * q1 + q2 * q2))
        r0, r1, r2, solved = newton_alart_curnier(
            diagonal[a], q0, q1, q2, mu[a], rho[a, 0], rho[a, 1], old0, old1, old2, tol, local_iterations
        )
        if not solved:
            failures += 1
            r0, r1, r2, solved = project_de_saxce(
                diagonal[a], q0, q1, q2, mu[a], min(rho[a, 0], rho[a, 1]), old0, old1, old2, tol, 10 * local_iterations
            )
        r[a, 0], r[a, 1], r[a, 2] = r0, r1, r2
        change += (r0 - old0) ** 2 + (r1 - old1) ** 2 + (r2 - old2) ** 2
        size += r0 * r0 + r1 * r1 + r2 * r2
    return change, size, failures
