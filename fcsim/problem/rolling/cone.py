"""The cone of sliding and rolling friction and the natural map on it, arrays (nc, 5) with the components (N, T1, T2, R1, R2).

K = {||r_T|| <= mu r_N, ||r_R|| <= mu_r r_N}, its dual K* = {mu ||u_T|| + mu_r ||u_R|| <= u_N}; the law is K* ∋ u + g(u) ⊥ r ∈ K with
g(u) = (mu ||u_T|| + mu_r ||u_R||, 0, 0, 0, 0): Acary, Bourrier, "Coulomb friction with rolling resistance as a cone complementarity
problem", European Journal of Mechanics A/Solids 85, 2021.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.problem.rolling._cone_kernels import step_rolling_cone


def project_rolling_cone(z: FloatArray, mu: FloatArray, mu_r: FloatArray) -> FloatArray:
    """Return the Euclidean projection P_K(z) (nc, 5).

    Its normal part n is the minimum over n >= 0 of (n - z_N)^2 + (||z_T|| - mu n)_+^2 + (||z_R|| - mu_r n)_+^2, a convex function that is
    quadratic between n = ||z_T|| / mu and n = ||z_R|| / mu_r; z_T and z_R are cut back to mu n and mu_r n.
    """
    out = np.empty_like(z)
    step_rolling_cone(z, np.zeros_like(z), mu, mu_r, 0.0, out)
    return out


def modified_velocity(u: FloatArray, mu: FloatArray, mu_r: FloatArray) -> FloatArray:
    """Return u + g(u) (nc, 5)."""
    modified = u.copy()
    modified[:, 0] += mu * np.hypot(u[:, 1], u[:, 2]) + mu_r * np.hypot(u[:, 3], u[:, 4])
    return modified


def natural_residual(r: FloatArray, u: FloatArray, mu: FloatArray, mu_r: FloatArray, compliance: FloatArray) -> float:
    """Return ||z - P_K(z - (u + g(u)))|| with z_a = s_a r_a, s (nc,), for flat r and u (m,).

    With y = z - (u + g(u)) it is u + g(u) + (y - P_K(y)), so that a small u is not lost beside a large r.
    """
    F = modified_velocity(u.reshape(-1, 5), mu, mu_r)
    y = compliance[:, None] * r.reshape(-1, 5) - F
    return float(np.linalg.norm(F + (y - project_rolling_cone(y, mu, mu_r))))
