"""Isotropic functions of the principal stretches: stress and tangent, exact where stretches are equal.

F = sum_a l_a n_a (x) N_a (singular values, those of the rotation's sign made positive). With w_a = dW/dl_a, w_ab = d2W/dl_a dl_b

    P = sum_a w_a n_a (x) N_a,   dF~ = n^T dF N,
    dP~_aa = sum_b w_ab dF~_bb,  dP~_ab = (x_ab + y_ab)/2 dF~_ab + (x_ab - y_ab)/2 dF~_ba   (a /= b)
    x_ab = (w_a - w_b) / (l_a - l_b),  y_ab = (w_a + w_b) / (l_a + l_b)

and x_ab -> w_aa - w_ab where l_a -> l_b. Source: R. W. Ogden, Non-linear elastic deformations, 1984, section 6.1 (principal components of
the moduli of nominal stress).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fcsim.arrays import FloatArray

NEAR = 1e-5
"""Relative difference of two stretches below which the divided difference takes the derivative in the middle: errors of NEAR^2."""


def energy_of_stretches(
    F: FloatArray, derivatives: Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]], tangent: bool
) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """W (n,), P (n, 3, 3), dP/dF (n, 3, 3, 3, 3) for F (n, 3, 3); derivatives: W (n,), w (n, 3), w_ab (n, 3, 3) of stretches (n, 3)."""
    n, l, Nt = np.linalg.svd(np.where(np.isfinite(F), F, np.eye(3)))
    W, w, second = derivatives(l)
    P = np.einsum("pia,pa,paj->pij", n, w, Nt)
    if not tangent:
        return W, P, None
    difference, total = l[:, :, None] - l[:, None, :], l[:, :, None] + l[:, None, :]
    near = np.abs(difference) < NEAR * total
    diagonal = np.einsum("paa->pa", second)
    limit = 0.5 * (diagonal[:, :, None] + diagonal[:, None, :]) - second
    x = np.where(near, limit, (w[:, :, None] - w[:, None, :]) / np.where(near, 1.0, difference))
    y = (w[:, :, None] + w[:, None, :]) / total
    own = np.zeros((len(F), 3, 3, 3, 3))
    for a in range(3):
        for b in range(3):
            own[:, a, a, b, b] = second[:, a, b]
    for a, b in ((0, 1), (1, 0), (1, 2), (2, 1), (2, 0), (0, 2)):
        own[:, a, b, a, b] = 0.5 * (x + y)[:, a, b]
        own[:, a, b, b, a] = 0.5 * (x - y)[:, a, b]
    basis = np.einsum("pia,pbj->pabij", n, Nt).reshape(-1, 9, 9)  # row: (a, b), column: (i, j)
    A = basis.transpose(0, 2, 1) @ own.reshape(-1, 9, 9) @ basis
    return W, P, A.reshape(-1, 3, 3, 3, 3)
