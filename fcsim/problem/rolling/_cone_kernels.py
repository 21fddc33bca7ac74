"""Loops over contacts with rolling friction, compiled by numba: the projection on the cone of five dimensions."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import FloatArray


@njit(cache=True)
def project_contact(z: FloatArray, mu: float, mu_r: float, out: FloatArray) -> None:
    """out = P_K(z) of one contact, vectors (5,); see `project_rolling_cone`."""
    t, m = np.sqrt(z[1] ** 2 + z[2] ** 2), np.sqrt(z[3] ** 2 + z[4] ** 2)
    # the normal part from which on each disk holds its part of z
    n_t = t / mu if mu > 0.0 else (np.inf if t > 0.0 else 0.0)
    n_r = m / mu_r if mu_r > 0.0 else (np.inf if m > 0.0 else 0.0)
    n = (z[0] + mu * t + mu_r * m) / (1.0 + mu * mu + mu_r * mu_r)
    if n > min(n_t, n_r):
        n = (z[0] + mu * t) / (1.0 + mu * mu) if n_t >= n_r else (z[0] + mu_r * m) / (1.0 + mu_r * mu_r)
        if n > max(n_t, n_r):
            n = z[0]
    if n < 0.0:
        n = 0.0
    slide = mu * n / t if t > mu * n else 1.0
    roll = mu_r * n / m if m > mu_r * n else 1.0
    out[0], out[1], out[2], out[3], out[4] = n, slide * z[1], slide * z[2], roll * z[3], roll * z[4]


@njit(cache=True)
def step_rolling_cone(r: FloatArray, F: FloatArray, mu: FloatArray, mu_r: FloatArray, rho: float, out: FloatArray) -> float:
    """out = P_K(r - rho F), arrays (nc, 5); return ||out - r||^2."""
    change = 0.0
    z = np.empty(5)
    for a in range(r.shape[0]):
        for i in range(5):
            z[i] = r[a, i] - rho * F[a, i]
        project_contact(z, mu[a], mu_r[a], out[a])
        for i in range(5):
            change += (out[a, i] - r[a, i]) ** 2
    return change
