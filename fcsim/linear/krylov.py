"""GMRES for Newton's steps: few iterations with a good preconditioner, given up as soon as it will not pay.

SciPy's gmres cannot say after some iterations that the rest would cost more than a new factorisation, nor that it has come to a plateau,
which is what is asked here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

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
    basis, steps, small = [rhs / beta], [], LeastSquares(beta)
    for j in range(limit):
        steps.append(precondition(basis[j]))
        w = product(steps[j])
        column = []
        for v in basis:
            column.append(float(v @ w))
            w = w - column[-1] * v
        size = float(np.linalg.norm(w))
        if not math.isfinite(size) or not small.add(column, size):
            return None
        left = small.defects[-1]
        if left <= target or (left <= plateau and flat(small.defects)) or (j + 1 == limit and left <= enough):
            y = small.coefficients()
            return combined(y, steps), y
        hopeless = j + 1 >= patience and np.log(left / beta) * HOPE * limit > np.log(target / beta) * (j + 1)
        if hopeless or size == 0:
            return None
        basis.append(w / size)
    return None


class LeastSquares:
    """min ||beta e_1 - H y|| for the Hessenberg matrix H (j + 1, j) of Arnoldi's process, which grows by a column an iteration: H = Q R by
    Givens' rotations. defects: the minimum without a column, with one, with two, ..."""

    def __init__(self, beta: float) -> None:
        self.defects = [beta]
        self._columns: list[list[float]] = []  # of R
        self._rotations: list[tuple[float, float]] = []  # cosine and sine
        self._rotated: list[float] = []  # Q^T beta e_1 but for its last component
        self._last = beta

    def add(self, along: Iterable[float], size: float) -> bool:
        """Add the column (along, size) of j + 1 and one numbers; False where H is singular with it."""
        column = list(along)
        for i, (c, s) in enumerate(self._rotations):
            column[i], column[i + 1] = c * column[i] + s * column[i + 1], c * column[i + 1] - s * column[i]
        diagonal = math.hypot(column[-1], size)
        if diagonal == 0:
            return False
        c, s = column[-1] / diagonal, size / diagonal
        column[-1] = diagonal
        self._columns.append(column)
        self._rotations.append((c, s))
        self._rotated.append(c * self._last)
        self._last *= -s
        self.defects.append(abs(self._last))
        return True

    def coefficients(self) -> FloatArray:
        """y (j,)."""
        y = np.array(self._rotated)
        for j in reversed(range(len(y))):
            y[j] /= self._columns[j][j]
            y[:j] -= y[j] * np.array(self._columns[j][:j])
        return y


def flat(defects: Sequence[float]) -> bool:
    """Whether the defects, from the first one on, have come to a plateau."""
    return len(defects) > FLAT_FOR + 2 and defects[-1] > FLAT * defects[-1 - FLAT_FOR]


def combined(y: FloatArray, vectors: Sequence[NDArray[np.floating]]) -> FloatArray:
    """sum of y_i times vector i (n,), in double precision, without a copy of all of them."""
    total: FloatArray = y[0] * vectors[0]
    for factor, vector in zip(y[1:], vectors[1:], strict=True):
        total += factor * vector
    return total
