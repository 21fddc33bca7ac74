"""Loops over contacts with rolling and spinning friction, compiled by numba: the projection on the cone of five or six dimensions."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import FloatArray


@njit(cache=True)
def project_contact(z: FloatArray, mu: float, mu_r: float, mu_s: float, out: FloatArray) -> None:
    """out = P_K(z) of one contact, vectors (5,), or (6,) with a spinning moment; see `project_rolling_cone`.

    Its normal part is the zero of phi(n) = n - z_N - sum_i mu_i (t_i - mu_i n)_+, which grows and is concave: Newton's method from the
    left, which begins with all disks and drops those that hold their part of z, reaches it from below, a disk or more a round.
    """
    spins = len(z) == 6
    t, m, s = np.sqrt(z[1] ** 2 + z[2] ** 2), np.sqrt(z[3] ** 2 + z[4] ** 2), abs(z[5]) if spins else 0.0
    slides, rolls, turns = mu > 0.0, mu_r > 0.0, spins and mu_s > 0.0
    n = z[0]
    for _ in range(4):
        pull, slope = z[0], 1.0
        if slides:
            pull, slope = pull + mu * t, slope + mu * mu
        if rolls:
            pull, slope = pull + mu_r * m, slope + mu_r * mu_r
        if turns:
            pull, slope = pull + mu_s * s, slope + mu_s * mu_s
        n = pull / slope
        held = (slides and mu * n >= t, rolls and mu_r * n >= m, turns and mu_s * n >= s)
        if not (held[0] or held[1] or held[2]):
            break
        slides, rolls, turns = slides and not held[0], rolls and not held[1], turns and not held[2]
    if n < 0.0:
        n = 0.0
    slide = mu * n / t if t > mu * n else 1.0
    roll = mu_r * n / m if m > mu_r * n else 1.0
    out[0], out[1], out[2], out[3], out[4] = n, slide * z[1], slide * z[2], roll * z[3], roll * z[4]
    if spins:
        out[5] = (mu_s * n / s if s > mu_s * n else 1.0) * z[5]


@njit(cache=True)
def step_rolling_cone(
    r: FloatArray, F: FloatArray, mu: FloatArray, mu_r: FloatArray, mu_s: FloatArray, rho: float, out: FloatArray
) -> float:
    """out = P_K(r - rho F), arrays (nc, 5) or (nc, 6); return ||out - r||^2."""
    change = 0.0
    rows = r.shape[1]
    z = np.empty(rows)
    for a in range(r.shape[0]):
        for i in range(rows):
            z[i] = r[a, i] - rho * F[a, i]
        project_contact(z, mu[a], mu_r[a], mu_s[a], out[a])
        for i in range(rows):
            change += (out[a, i] - r[a, i]) ** 2
    return change
