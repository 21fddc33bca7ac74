"""Loops over contacts, compiled by numba: the convex sets of frictional contact (cones, cylinders, disks) and sweeps over them.

Vectors of contacts are arrays (nc, k); a "step" is out = P_C(r - rho F), and returns ||out - r||^2, the square of the natural residual.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import FloatArray, IntArray
from fcsim.problem._cone_kernels import cone_projection, disk_projection


@njit(cache=True)
def add_de_saxce(u: FloatArray, mu: FloatArray, out: FloatArray) -> None:
    """out = u + g(u), g = (mu ||u_T||, 0, 0)."""
    for a in range(u.shape[0]):
        norm2 = 0.0
        for i in range(1, u.shape[1]):
            norm2 += u[a, i] * u[a, i]
            out[a, i] = u[a, i]
        out[a, 0] = u[a, 0] + mu[a] * np.sqrt(norm2)


@njit(cache=True)
def de_saxce_term(u: FloatArray, mu: FloatArray, dimension: int) -> FloatArray:
    """g(u) (m,) of flat u (m,)."""
    g = np.zeros(len(u))
    for a in range(len(mu)):
        norm2 = 0.0
        for i in range(dimension * a + 1, dimension * a + dimension):
            norm2 += u[i] * u[i]
        g[dimension * a] = mu[a] * np.sqrt(norm2)
    return g


@njit(cache=True)
def splitting_residuals(
    x: FloatArray, z: FloatArray, zeta: FloatArray, z_hat: FloatArray, zeta_hat: FloatArray
) -> tuple[float, float, float]:
    """||x - z||^2, ||z - z_hat||^2, ||zeta - zeta_hat||^2 of ADMM's iterates."""
    primal = dual = multiplier = 0.0
    for i in range(len(x)):
        primal += (x[i] - z[i]) ** 2
        dual += (z[i] - z_hat[i]) ** 2
        multiplier += (zeta[i] - zeta_hat[i]) ** 2
    return primal, dual, multiplier


@njit(cache=True)
def step_cone(r: FloatArray, F: FloatArray, mu: FloatArray, rho: float, out: FloatArray) -> float:
    """Step on the cones ||r_T|| <= mu r_N."""
    change, solid = 0.0, r.shape[1] == 3
    for a in range(r.shape[0]):
        r0, r1, r2 = r[a, 0], r[a, 1], r[a, 2] if solid else 0.0
        f2 = F[a, 2] if solid else 0.0
        z0, z1, z2 = cone_projection(r0 - rho * F[a, 0], r1 - rho * F[a, 1], r2 - rho * f2, mu[a])
        out[a, 0], out[a, 1] = z0, z1
        if solid:
            out[a, 2] = z2
        change += (z0 - r0) ** 2 + (z1 - r1) ** 2 + (z2 - r2) ** 2
    return change


@njit(cache=True)
def step_cylinder(r: FloatArray, F: FloatArray, radius: FloatArray, rho: float, out: FloatArray) -> float:
    """Step on the half-cylinders r_N >= 0, ||r_T|| <= radius; half-lines where r (nc, 1) has a normal part alone."""
    change, flat, solid = 0.0, r.shape[1] >= 2, r.shape[1] == 3
    for a in range(r.shape[0]):
        r0, r1, r2 = r[a, 0], r[a, 1] if flat else 0.0, r[a, 2] if solid else 0.0
        f1, f2 = F[a, 1] if flat else 0.0, F[a, 2] if solid else 0.0
        z0 = max(0.0, r0 - rho * F[a, 0])
        z1, z2 = disk_projection(r1 - rho * f1, r2 - rho * f2, radius[a])
        out[a, 0] = z0
        if flat:
            out[a, 1] = z1
        if solid:
            out[a, 2] = z2
        change += (z0 - r0) ** 2 + (z1 - r1) ** 2 + (z2 - r2) ** 2
    return change


@njit(cache=True)
def step_disk(r: FloatArray, F: FloatArray, radius: FloatArray, rho: float, out: FloatArray) -> float:
    """Step on the disks ||r|| <= radius, r (nc, k) the tangential reactions."""
    change, plane = 0.0, r.shape[1] == 2
    for a in range(r.shape[0]):
        r1, r2 = r[a, 0], r[a, 1] if plane else 0.0
        f2 = F[a, 1] if plane else 0.0
        z1, z2 = disk_projection(r1 - rho * F[a, 0], r2 - rho * f2, radius[a])
        out[a, 0] = z1
        if plane:
            out[a, 1] = z2
        change += (z1 - r1) ** 2 + (z2 - r2) ** 2
    return change


@njit(cache=True)
def minimise_on_disk(a11: float, a12: float, a22: float, g1: float, g2: float, radius: float) -> tuple[float, float]:
    """Minimise 0.5 x.A x + g.x over ||x|| <= radius, A (2, 2) symmetric positive semidefinite.

    Inside, x = -A^-1 g; else x = -(A + lam I)^-1 g with ||x|| = radius: Newton's method on 1/radius - 1/||x|| is monotone from a lam
    left of the root (Moré, Sorensen 1983), and radius >= ||g|| / (lambda_max + lam) gives such a lam.
    """
    g = np.sqrt(g1 * g1 + g2 * g2)
    if radius <= 0.0 or g == 0.0:
        return 0.0, 0.0
    largest = 0.5 * (a11 + a22) + np.sqrt(0.25 * (a11 - a22) ** 2 + a12 * a12)
    lam = max(0.0, g / radius - largest)
    x1 = x2 = 0.0
    for _ in range(50):
        b11, b22 = a11 + lam, a22 + lam
        det = b11 * b22 - a12 * a12
        if det <= 1e-14 * b11 * b22:  # singular A: move off lam = 0
            lam = max(2.0 * lam, 1e-14 * largest)
            if lam == 0.0:
                return -g1 / g * radius, -g2 / g * radius
            continue
        x1, x2 = -(b22 * g1 - a12 * g2) / det, -(b11 * g2 - a12 * g1) / det
        norm2 = x1 * x1 + x2 * x2
        norm = np.sqrt(norm2)
        if norm <= radius * (1.0 + 1e-15):
            break
        curvature = (b22 * x1 * x1 - 2.0 * a12 * x1 * x2 + b11 * x2 * x2) / det
        step = (norm - radius) / radius * norm2 / curvature
        if step <= 1e-16 * lam:
            break
        lam += step
    x1, x2 = disk_projection(x1, x2, radius)
    return x1, x2


@njit(cache=True)
def velocity(
    indptr: IntArray, indices: IntArray, blocks: FloatArray, q: FloatArray, r: FloatArray, a: int
) -> tuple[float, float, float, int]:
    """u_a = q_a + sum_b W_ab r_b, and which block is the contact's own W_aa (-1: none is stored)."""
    u0, u1, u2 = q[a, 0], q[a, 1], q[a, 2]
    own = -1
    for k in range(indptr[a], indptr[a + 1]):
        b = indices[k]
        w = blocks[k]
        s0, s1, s2 = r[b, 0], r[b, 1], r[b, 2]
        u0 += w[0, 0] * s0 + w[0, 1] * s1 + w[0, 2] * s2
        u1 += w[1, 0] * s0 + w[1, 1] * s1 + w[1, 2] * s2
        u2 += w[2, 0] * s0 + w[2, 1] * s1 + w[2, 2] * s2
        if b == a:
            own = k
    return u0, u1, u2, own


@njit(cache=True)
def sweep_cylinder(
    indptr: IntArray,
    indices: IntArray,
    blocks: FloatArray,
    q: FloatArray,
    radius: FloatArray,
    r: FloatArray,
    normal: bool,
    tangential: bool,
) -> tuple[float, float]:
    """One Gauss-Seidel sweep of the convex QP min 0.5 r.W r + q.r on half-cylinders, in place on r (nc, 3); (||change||^2, ||r||^2).

    A contact's normal and tangential parts are minimised in turn, each exactly; `normal` and `tangential` say which are free.
    """
    total = 0.0
    size = 0.0
    for a in range(len(indptr) - 1):
        u0, u1, u2, own = velocity(indptr, indices, blocks, q, r, a)
        if own >= 0:
            w = blocks[own]
            if normal and w[0, 0] > 0.0:
                step = max(0.0, r[a, 0] - u0 / w[0, 0]) - r[a, 0]
                r[a, 0] += step
                u1 += w[1, 0] * step
                u2 += w[2, 0] * step
                total += step * step
            if tangential:
                a12 = 0.5 * (w[1, 2] + w[2, 1])
                old1, old2 = r[a, 1], r[a, 2]
                new1, new2 = minimise_on_disk(
                    w[1, 1], a12, w[2, 2], u1 - w[1, 1] * old1 - a12 * old2, u2 - a12 * old1 - w[2, 2] * old2, radius[a]
                )
                r[a, 1], r[a, 2] = new1, new2
                total += (new1 - old1) ** 2 + (new2 - old2) ** 2
        size += r[a, 0] ** 2 + r[a, 1] ** 2 + r[a, 2] ** 2
    return total, size


@njit(cache=True)
def sweep_cone(
    indptr: IntArray,
    indices: IntArray,
    blocks: FloatArray,
    q: FloatArray,
    mu: FloatArray,
    rho: FloatArray,
    r: FloatArray,
    local_tolerance: float,
    local_iterations: int,
) -> tuple[float, float]:
    """One Gauss-Seidel sweep of the convex QP on the cones ||r_T|| <= mu r_N, in place on r (nc, 3); (||change||^2, ||r||^2).

    A contact's own problem is solved by projections r <- P_K(r - rho_a u), to local_tolerance relative to its reaction.
    """
    total = 0.0
    size = 0.0
    for a in range(len(indptr) - 1):
        u0, u1, u2, own = velocity(indptr, indices, blocks, q, r, a)
        if own >= 0:
            w = blocks[own]
            m, p = mu[a], rho[a]
            old0, old1, old2 = r[a, 0], r[a, 1], r[a, 2]
            for _ in range(local_iterations):
                r0, r1, r2 = r[a, 0], r[a, 1], r[a, 2]
                z0, z1, z2 = cone_projection(r0 - p * u0, r1 - p * u1, r2 - p * u2, m)
                r[a, 0], r[a, 1], r[a, 2] = z0, z1, z2
                d0, d1, d2 = z0 - r0, z1 - r1, z2 - r2
                u0 += w[0, 0] * d0 + w[0, 1] * d1 + w[0, 2] * d2
                u1 += w[1, 0] * d0 + w[1, 1] * d1 + w[1, 2] * d2
                u2 += w[2, 0] * d0 + w[2, 1] * d1 + w[2, 2] * d2
                if d0 * d0 + d1 * d1 + d2 * d2 <= local_tolerance**2 * (z0 * z0 + z1 * z1 + z2 * z2):
                    break
            total += (r[a, 0] - old0) ** 2 + (r[a, 1] - old1) ** 2 + (r[a, 2] - old2) ** 2
        size += r[a, 0] ** 2 + r[a, 1] ** 2 + r[a, 2] ** 2
    return total, size
