"""A tangent with the stresses that the tangent of the iterate before foresaw, for Newton's method in statics.

From (F_0, P_0, A_0) to F: the stresses that go with the iteration's linear equations are

    S_f = S_0 + F_0^-1 (A_0 : dF - dF S_0),  S = F^-1 P (Piola and Kirchhoff's second),  dF = F'(u_0) (u - u_0)
    p_f = p_0 + dp(A_0 : dF, dF),            p = P : F / (3 J) (the mean of Cauchy's)

while those of the law at F hold what dF had of second order: a rotation by t in one iteration widens a body by t^2 / 2, and K t^2 of a
nearly incompressible one, or E t^2 of a slender one, is more than all that it carries. Forces are the law's, the tangent is

    A_f = A + (p_f - p) d(cof F)/dF + 1 x (S_f - S - (p_f - p) J C^-1)

which differs from A by second order, so that convergence is quadratic, and is what Newton's method on displacements and stresses as
unknowns of their own leaves where the stresses are eliminated.

Source: D. Magisano, L. Leonetti, G. Garcea, "How to improve efficiency and robustness of the Newton method in geometrically non-linear
structural problem discretized via displacement-based finite elements", CMAME 313 (2017) 986-1005, in which all stresses are such
unknowns; the mean stress apart is our own.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray


def foreseen(
    before: tuple[FloatArray, FloatArray, FloatArray], change: FloatArray, F: FloatArray, P: FloatArray, A: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """P_f = F S_f (n, 3, 3) and A_f (n, 3, 3, 3, 3) at F, P, A of points.

    before = (F_0, P_0, A_0); change: dF
    """
    F0, P0, A0 = before
    dP = np.einsum("nijkl,nkl->nij", A0, change, optimize=True)
    inverse, J = np.linalg.inv(F), np.linalg.det(F)
    turned = inverse.swapaxes(1, 2)
    p0 = _dot(P0, F0) / (3 * np.linalg.det(F0))
    inverse0 = np.linalg.inv(F0)
    S0 = inverse0 @ P0
    p = _dot(P, F) / (3 * J)
    spread = np.einsum("nij,nji->n", inverse0, change)
    more = p0 + (_dot(dP, F0) + _dot(P0, change)) / (3 * np.linalg.det(F0)) - p0 * spread - p
    S = S0 + inverse0 @ (dP - change @ S0)
    left = S - inverse @ P
    left = 0.5 * (left + left.swapaxes(1, 2)) - (more * J)[:, None, None] * (inverse @ turned)
    curved = np.einsum("nij,nkl->nijkl", turned, turned, optimize=True) - np.einsum("nkj,nil->nijkl", turned, turned, optimize=True)
    A = A + (more * J)[:, None, None, None, None] * curved
    for i in range(3):
        A[:, i, :, i, :] += left
    return P + F @ left + (more * J)[:, None, None] * turned, A


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """(n,) of a, b (n, 3, 3)."""
    product: FloatArray = np.einsum("nij,nij->n", a, b)
    return product
