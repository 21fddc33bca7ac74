"""Gauss-Seidel sweeps over contacts with rolling friction, compiled by numba."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import FloatArray, IntArray
from fcsim.problem.rolling._cone_kernels import project_contact


@njit(cache=True)
def modify(u: FloatArray, mu: float, mu_r: float, F: FloatArray) -> None:
    """F = u + g(u) of one contact, vectors (5,)."""
    F[:] = u
    F[0] += mu * np.sqrt(u[1] ** 2 + u[2] ** 2) + mu_r * np.sqrt(u[3] ** 2 + u[4] ** 2)


@njit(cache=True)
def solve_contact(W: FloatArray, u: FloatArray, mu: float, mu_r: float, r: FloatArray, rho: float, iterations: int) -> float:
    """Move r (5,) of one contact by r <- P_K(r - rho (u + g(u))), u (5,) with it; return the step size that served.

    rho is kept where rho ||F(r) - F(rbar)|| / ||r - rbar|| lies between 0.3 and 0.9 (Khobotov 1987), as in the methods for all contacts.
    """
    F, F_next, z, p, u_next = np.empty(5), np.empty(5), np.empty(5), np.empty(5), np.empty(5)
    modify(u, mu, mu_r, F)
    for _ in range(iterations):
        z[:] = r - rho * F
        project_contact(z, mu, mu_r, p)
        change = np.sqrt(np.sum((p - r) ** 2))
        if change <= 1e-15 * np.sqrt(np.sum(r**2)):
            break
        u_next[:] = u + W @ (p - r)
        modify(u_next, mu, mu_r, F_next)
        ratio = rho * np.sqrt(np.sum((F_next - F) ** 2)) / change
        if ratio > 0.9:
            rho *= 2.0 / 3.0
            continue
        r[:], u[:], F[:] = p, u_next, F_next
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
    r: FloatArray,
    rho: FloatArray,
    iterations: int,
) -> None:
    """Solve contact after contact with the reactions r (nc, 5) of the others as they are.

    rows: W by block rows (indptr, column, blocks (nnz, 5, 5)); own: W_aa (nc, 5, 5); rho (nc,), 0 for a contact whose bodies are held.
    """
    indptr, column, blocks = rows
    u = np.empty(5)
    for a in range(len(mu)):
        if rho[a] == 0.0:
            continue
        u[:] = q[a]
        for k in range(indptr[a], indptr[a + 1]):
            for i in range(5):
                for j in range(5):
                    u[i] += blocks[k, i, j] * r[column[k], j]
        rho[a] = solve_contact(own[a], u, mu[a], mu_r[a], r[a], rho[a], iterations)
