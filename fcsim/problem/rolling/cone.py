"""The cone of sliding, rolling and spinning friction and the natural map on it, arrays (nc, 5) with the components (N, T1, T2, R1, R2),
or (nc, 6) with S, the spinning, after them.

K = {||r_T|| <= mu r_N, ||r_R|| <= mu_r r_N, |r_S| <= mu_s r_N}, its dual K* = {mu ||u_T|| + mu_r ||u_R|| + mu_s |u_S| <= u_N}; the law is
K* ∋ u + g(u) ⊥ r ∈ K with g(u) = (mu ||u_T|| + mu_r ||u_R|| + mu_s |u_S|, 0, ...): Acary, Bourrier, "Coulomb friction with rolling
resistance as a cone complementarity problem", European Journal of Mechanics A/Solids 85, 2021, for sliding and rolling. Spinning is one
disk more of the same kind, of one dimension: by its g, too, u_N = 0 where r_N > 0, and each of r_T, r_R, r_S dissipates most.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.problem._judge_kernels import ROUGH
from fcsim.problem.cone import LEAST_SIZE, enlargement
from fcsim.problem.rolling._cone_kernels import step_rolling_cone


def project_rolling_cone(z: FloatArray, mu: FloatArray, mu_r: FloatArray, mu_s: FloatArray | None = None) -> FloatArray:
    """Return the Euclidean projection P_K(z) (nc, 5), (nc, 6) with mu_s (nc,).

    Its normal part n is the minimum over n >= 0 of (n - z_N)^2 + (||z_T|| - mu n)_+^2 + (||z_R|| - mu_r n)_+^2 + (|z_S| - mu_s n)_+^2, a
    convex function that is quadratic between the n at which a disk begins to hold its part of z; z_T, z_R, z_S are cut back to mu n,
    mu_r n, mu_s n.
    """
    out = np.empty_like(z)
    step_rolling_cone(z, np.zeros_like(z), mu, mu_r, np.zeros_like(mu) if mu_s is None else mu_s, 0.0, out)
    return out


def modified_velocity(u: FloatArray, mu: FloatArray, mu_r: FloatArray, mu_s: FloatArray | None = None) -> FloatArray:
    """Return u + g(u) (nc, 5), (nc, 6) with mu_s (nc,)."""
    modified = u.copy()
    modified[:, 0] += mu * np.hypot(u[:, 1], u[:, 2]) + mu_r * np.hypot(u[:, 3], u[:, 4])
    if mu_s is not None and u.shape[1] == 6:
        modified[:, 0] += mu_s * np.abs(u[:, 5])
    return modified


def natural_residual(
    r: FloatArray,
    u: FloatArray,
    mu: FloatArray,
    mu_r: FloatArray,
    compliance: FloatArray,
    mu_s: FloatArray | None = None,
    scaled: bool = True,
) -> float:
    """Return ||z - P_K(z - (u + g(u)))|| with z_a = s_a r_a, s (nc,), for flat r and u (m,); mu_s (nc,): with spinning.

    With y = z - (u + g(u)) it is u + g(u) + (y - P_K(y)), so that a small u is not lost beside a large r. A contact's part
    of the norm is at least |u_N| / sqrt(1 + min(mu^2 + mu_r^2 + mu_s^2, 10^2)) where u_N < 0; not in the
    published form (`scaled` False): see `fcsim.problem.natural_map_residual`.
    """
    rows = 5 if mu_s is None else 6
    F = modified_velocity(u.reshape(-1, rows), mu, mu_r, mu_s)
    y = compliance[:, None] * r.reshape(-1, rows) - F
    rough = np.minimum(np.hypot(np.hypot(mu, mu_r), 0.0 if mu_s is None else mu_s), ROUGH)
    parts = np.linalg.norm(F + (y - project_rolling_cone(y, mu, mu_r, mu_s)), axis=1)
    least = np.maximum(-u[::rows], 0.0) / np.sqrt(1 + rough**2) if scaled else 0.0
    residual = float(np.linalg.norm(np.maximum(parts, least)))
    largest = max(np.abs(u).max(initial=0.0), np.abs(y).max(initial=0.0)) if residual < LEAST_SIZE else 0.0
    if not 0 < largest < LEAST_SIZE:
        return residual
    factor = enlargement(largest)
    return natural_residual(r * factor, u * factor, mu, mu_r, compliance, mu_s, scaled) / factor
