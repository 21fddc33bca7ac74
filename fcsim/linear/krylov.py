"""GMRES for Newton's steps: few iterations with a good preconditioner, given up as soon as it will not pay.

SciPy's gmres cannot say after some iterations that the rest would cost more than a new factorisation, nor that it has come to a plateau,
which is what is asked here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from fcsim.arrays import FloatArray

PATIENCE, HOPE = 4, 1.5
"""After PATIENCE iterations GMRES is given up when its mean reduction would need more than HOPE times the iterations that it has."""
FLAT, FLAT_FOR = 0.8, 3
"""On a plateau the last FLAT_FOR iterations have reduced the defect by no more than FLAT."""


def gmres(
    product: Callable[[FloatArray], FloatArray],
    precondition: Callable[[FloatArray], FloatArray],
    rhs: FloatArray,
    target: float,
    limit: int,
    patience: int = PATIENCE,
    enough: float = 0.0,
    plateau: float = 0.0,
) -> tuple[FloatArray, FloatArray] | None:
    """Right-preconditioned GMRES for A x = rhs (n,) from x = 0 (Y. Saad, M. H. Schultz, SIAM J. Sci. Stat. Comput. 7, 1986).

    Return x with ||rhs - A x|| <= target, in the recurrence's norm, and its coefficients in the steps that `product` was called with, one
    after the other; where `limit` iterations do not get there what they have where ||rhs - A x|| <= enough, else
    None. patience: iterations after which it may be given up before; plateau: defect from which on x is returned where it hardly falls any
    more.
    """
    beta = float(np.linalg.norm(rhs))
    if beta <= target:
        return np.zeros_like(rhs), np.empty(0)
    basis = [rhs / beta]
    steps: list[FloatArray] = []
    R = np.zeros((limit, limit))  # of H = Q R, Q by Givens' rotations; c, s: theirs; g = Q^T beta e_1
    c, s, g = np.zeros(limit), np.zeros(limit), np.zeros(limit + 1)
    g[0] = beta
    defects = [beta]
    for j in range(limit):
        steps.append(precondition(basis[j]))
        w = product(steps[j])
        column = R[:, j]
        for i, v in enumerate(basis):
            column[i] = v @ w
            w = w - column[i] * v
        size = float(np.linalg.norm(w))
        if not math.isfinite(size):
            return None
        for i in range(j):
            column[i], column[i + 1] = c[i] * column[i] + s[i] * column[i + 1], c[i] * column[i + 1] - s[i] * column[i]
        diagonal = math.hypot(column[j], size)
        if diagonal == 0:
            return None
        c[j], s[j], column[j] = column[j] / diagonal, size / diagonal, diagonal
        g[j], g[j + 1] = c[j] * g[j], -s[j] * g[j]
        left = abs(float(g[j + 1]))
        defects.append(left)
        if left <= target or (left <= plateau and flat(defects)) or (j + 1 == limit and left <= enough):
            y = np.linalg.solve(R[: j + 1, : j + 1], g[: j + 1])
            return combined(y, steps), y
        hopeless = j + 1 >= patience and np.log(left / beta) * HOPE * limit > np.log(target / beta) * (j + 1)
        if hopeless or size == 0:
            return None
        basis.append(w / size)
    return None


def flat(defects: Sequence[float]) -> bool:
    """Whether the defects, from the first one on, have come to a plateau."""
    return len(defects) > FLAT_FOR + 2 and defects[-1] > FLAT * defects[-1 - FLAT_FOR]


def combined(y: FloatArray, vectors: Sequence[FloatArray]) -> FloatArray:
    """sum of y_i times vector i (n,), without a copy of all of them."""
    total = y[0] * vectors[0]
    for factor, vector in zip(y[1:], vectors[1:], strict=True):
        total += factor * vector
    return total
