"""Gauss-Seidel sweeps over contacts with rolling and spinning friction, compiled by numba."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import FloatArray, IntArray
from fcsim.problem.rolling._cone_kernels import project_contact


@njit(cache=True)
def modify(u: FloatArray, mu: float, mu_r: float, mu_s: float, F: FloatArray) -> None:
    """F = u + g(u) of one contact, vectors (5,), or (6,) with spinning."""
    for i in range(len(u)):
        F[i] = u[i]
    F[0] += mu * np.sqrt(u[1] ** 2 + u[2] ** 2) + mu_r * np.sqrt(u[3] ** 2 + u[4] ** 2)
    if len(u) == 6:
        F[0] += mu_s * abs(u[5])


@njit(cache=True)
def solve_contact(W: FloatArray, u: FloatArray, mu: float, mu_r: float, mu_s: float, r: FloatArray, rho: float, iterations: int) -> float:
    """Move r (d,) of one contact by r <- P_K(r - rho (u + g(u))), u (d,) with it, d = 5 or 6; return the step size that served.

    rho is kept where rho ||F(r) - F(rbar)|| / ||r - rbar|| lies between 0.3 and 0.9 (Khobotov 1987), as in the methods for all contacts.
    """
    d = len(u)
    F, F_next, z, p, u_next, step = np.empty(d), np.empty(d), np.empty(d), np.empty(d), np.empty(d), np.empty(d)
    modify(u, mu, mu_r, mu_s, F)
    for _ in range(iterations):
        for i in range(d):
            z[i] = r[i] - rho * F[i]
        project_contact(z, mu, mu_r, mu_s, p)
        change, size = 0.0, 0.0
        for i in range(d):
            step[i] = p[i] - r[i]
            change += step[i] * step[i]
            size += r[i] * r[i]
        change = np.sqrt(change)
        if change <= 1e-15 * np.sqrt(size):
            break
        moved = W @ step
        for i in range(d):
            u_next[i] = u[i] + moved[i]
        modify(u_next, mu, mu_r, mu_s, F_next)
        difference = 0.0
        for i in range(d):
            difference += (F_next[i] - F[i]) ** 2
        ratio = rho * np.sqrt(difference) / change
        if ratio > 0.9:
            rho *= 2.0 / 3.0
            continue
        for i in range(d):
            r[i], u[i], F[i] = p[i], u_next[i], F_next[i]
        if ratio < 0.3:
            rho *= 1.5
    return rho


@njit(cache=True)
def sweep(
    rows: tuple[IntArray, IntArray, FloatArray],
    own: FloatArray,
    q: FloatArray,
    mu: FloatArray,
    mu_r: FloatArray,
    mu_s: FloatArray,
    r: FloatArray,
    rho: FloatArray,
    iterations: int,
) -> None:
    """Solve contact after contact with the reactions r (nc, d) of the others as they are, d = 5 or 6.

    rows: W by block rows (indptr, column, blocks (nnz, d, d)); own: W_aa (nc, d, d); rho (nc,), 0 for a contact whose bodies are held.
    """
    indptr, column, blocks = rows
    d = r.shape[1]
    u = np.empty(d)
    for a in range(len(mu)):
        if rho[a] == 0.0:
            continue
        for i in range(d):
            u[i] = q[a, i]
        for k in range(indptr[a], indptr[a + 1]):
            for i in range(d):
                for j in range(d):
                    u[i] += blocks[k, i, j] * r[column[k], j]
        rho[a] = solve_contact(own[a], u, mu[a], mu_r[a], mu_s[a], r[a], rho[a], iterations)
