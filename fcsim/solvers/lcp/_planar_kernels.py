"""One contact in the plane, solved exactly: compiled, with the signature of `_one_contact_kernels` (second tangent left at zero)."""

from __future__ import annotations

from numba import njit


@njit(cache=True)
def planar(W, q0, q1, q2, mu, rho_N, rho_T, r0, r1, r2, tol, max_iterations):
    """Solve u = W r + q with Coulomb's law in 2D by its four cases; return (r_N, r_T, 0, solved).

    Open: r = 0 where q_N >= 0. Stick: u = 0. Slip towards s = +1, -1: r_T = -s mu r_N, u_N = 0, s u_T >= 0. Where several cases hold
    (W_NT and mu large), the first in this order is taken; where none does (W_aa not positive definite), r stays and `solved` is False.
    """
    if q0 >= 0.0:
        return 0.0, 0.0, 0.0, True
    determinant = W[0][0] * W[1][1] - W[0][1] * W[1][0]
    if determinant > 1e-14 * abs(W[0][0] * W[1][1]):
        n = (W[0][1] * q1 - W[1][1] * q0) / determinant
        t = (W[1][0] * q0 - W[0][0] * q1) / determinant
        if n >= 0.0 and abs(t) <= mu * n:
            return n, t, 0.0, True
    for s in (1.0, -1.0):
        compliance = W[0][0] - s * mu * W[0][1]
        if compliance > 0.0:
            n = -q0 / compliance
            if s * (q1 + (W[1][0] - s * mu * W[1][1]) * n) >= 0.0:
                return n, -s * mu * n, 0.0, True
    return r0, r1, 0.0, False
