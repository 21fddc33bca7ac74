"""Coulomb's cone and disk for one contact, compiled by numba: the one place where compiled code projects on them.

Vectors are passed by component (2D: z2 = 0) and the functions inlined, so that they stay in registers of the loops that call them.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, forceinline=True)
def cone_projection(z0, z1, z2, mu):
    """P_K(z) on K = {||z_T|| <= mu z_N}: z inside, 0 in the polar cone, else with s = (z_N + mu ||z_T||) / (1 + mu^2) the point
    (s, mu s z_T / ||z_T||); NaN stays NaN."""
    norm = np.sqrt(z1 * z1 + z2 * z2)
    if mu * norm <= -z0:
        return 0.0, 0.0, 0.0
    if norm > mu * z0:
        s = (z0 + mu * norm) / (1.0 + mu * mu)
        return s, mu * s * z1 / norm, mu * s * z2 / norm
    return z0, z1, z2


@njit(cache=True, forceinline=True)
def natural_map(r0, r1, r2, f0, f1, f2, mu):
    """r - P_K(z) with z = r - f, written as f + (z - P_K(z)): a small f is not lost beside a large r.

    z - P_K(z) is z in the polar cone, 0 inside K, else c (-mu, z_T / ||z_T||) with c = (||z_T|| - mu z_N) / (1 + mu^2).
    """
    z0, z1, z2 = r0 - f0, r1 - f1, r2 - f2
    norm = np.sqrt(z1 * z1 + z2 * z2)
    if mu * norm <= -z0:
        return r0, r1, r2
    excess = norm - mu * z0
    c = 0.0 if excess <= 0.0 else excess / (1.0 + mu * mu)
    t = c / norm if norm > 0.0 else 0.0
    return f0 - mu * c, f1 + t * z1, f2 + t * z2


@njit(cache=True, forceinline=True)
def disk_projection(z1, z2, radius):
    """The point of ||z_T|| <= radius nearest to z_T."""
    norm = np.sqrt(z1 * z1 + z2 * z2)
    if norm > radius:
        return z1 * (radius / norm), z2 * (radius / norm)
    return z1, z2


@njit(cache=True)
def cone_projections(z, mu):
    """P_K(z) (nc, d) of vectors z (nc, d)."""
    out = np.zeros_like(z)
    flat = z.shape[1] == 2
    for a in range(len(mu)):
        p0, p1, p2 = cone_projection(z[a, 0], z[a, 1], 0.0 if flat else z[a, 2], mu[a])
        out[a, 0], out[a, 1] = p0, p1
        if not flat:
            out[a, 2] = p2
    return out
