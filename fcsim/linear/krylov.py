"""GMRES for Newton's steps: few iterations with a good preconditioner, given up as soon as it will not pay.

SciPy's gmres cannot say after some iterations that the rest would cost more than a new factorisation, which is what is asked here.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fcsim.arrays import FloatArray

PATIENCE, HOPE = 4, 1.5
"""After PATIENCE iterations GMRES is given up when its mean reduction would need more than HOPE times the iterations that it has."""


def gmres(
    product: Callable[[FloatArray], FloatArray],
    precondition: Callable[[FloatArray], FloatArray],
    rhs: FloatArray,
    target: float,
    limit: int,
) -> tuple[FloatArray, FloatArray] | None:
    """Right-preconditioned GMRES for A x = rhs (n,) from x = 0 (Y. Saad, M. H. Schultz, SIAM J. Sci. Stat. Comput. 7, 1986).

    Return x with ||rhs - A x|| <= target, in the recurrence's norm, and its coefficients in the steps that `product` was called with, one
    after the other; or None where `limit` iterations do not get there.
    """
    beta = float(np.linalg.norm(rhs))
    if beta <= target:
        return np.zeros_like(rhs), np.empty(0)
    basis = [rhs / beta]
    steps: list[FloatArray] = []
    H = np.zeros((limit + 1, limit))
    for j in range(limit):
        steps.append(precondition(basis[j]))
        w = product(steps[j])
        for i, v in enumerate(basis):
            H[i, j] = v @ w
            w = w - H[i, j] * v
        H[j + 1, j] = np.linalg.norm(w)
        if not np.isfinite(H[j + 1, j]):
            return None
        least = np.zeros(j + 2)
        least[0] = beta
        y = np.linalg.lstsq(H[: j + 2, : j + 1], least, rcond=None)[0]
        left = float(np.linalg.norm(least - H[: j + 2, : j + 1] @ y))
        if left <= target:
            return np.tensordot(y, steps, 1), y
        hopeless = j + 1 >= PATIENCE and np.log(left / beta) * HOPE * limit > np.log(target / beta) * (j + 1)
        if hopeless or H[j + 1, j] == 0:
            return None
        basis.append(w / H[j + 1, j])
    return None
