"""GMRES for Newton's steps: few iterations with a good preconditioner, given up as soon as it will not pay.

SciPy's gmres cannot say after some iterations that the rest would cost more than a new factorisation, nor that it has come to a plateau,
which is what is asked here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray
from fcsim.threads import pieces, side_by_side

PATIENCE, HOPE = 4, 1.5
"""After PATIENCE iterations GMRES is given up when its mean reduction would need more than HOPE times the iterations that it has."""
FLAT, FLAT_FOR = 0.8, 3
"""On a plateau the last FLAT_FOR iterations have reduced the defect by no more than FLAT."""
CLASSICAL_FROM, NUMBERS_A_PIECE, GROWTH = 100_000, 40_000, 8
"""Numbers of a vector from which Gram-Schmidt is the classical one, by pieces, numbers that one thread takes, and by how many vectors the
basis then grows."""
CANCELLED = 0.1
"""What classical Gram-Schmidt leaves of a vector's length where it is taken once more: it loses in orthogonality what that cancels."""


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
    basis, steps, small = _basis(rhs / beta), [], LeastSquares(beta)
    for j in range(limit):
        steps.append(precondition(basis.last))
        column, w, size = basis.orthogonalised(product(steps[j]))
        if not math.isfinite(size) or not small.add(column, size):
            return None
        left = small.defects[-1]
        if left <= target or (left <= plateau and flat(small.defects)) or (j + 1 == limit and left <= enough):
            y = small.coefficients()
            return combined(y, steps), y
        hopeless = j + 1 >= patience and np.log(left / beta) * HOPE * limit > np.log(target / beta) * (j + 1)
        if hopeless or size == 0:
            return None
        basis.append(w, size)
    return None


class _Basis:
    """Orthonormal vectors (n,) by modified Gram-Schmidt."""

    def __init__(self, first: FloatArray) -> None:
        self._vectors = [first]

    @property
    def last(self) -> FloatArray:
        return self._vectors[-1]

    def append(self, w: FloatArray, size: float) -> None:
        """Add w / size."""
        self._vectors.append(w / size)

    def orthogonalised(self, w: FloatArray) -> tuple[list[float], FloatArray, float]:
        """w's components along the vectors, what is left of it, and the length of that."""
        column = []
        for v in self._vectors:
            column.append(float(v @ w))
            w = w - column[-1] * v
        return column, w, float(np.linalg.norm(w))


class _LargeBasis:
    """The same by classical Gram-Schmidt, twice where it cancels (J. W. Daniel, W. B. Gragg, L. Kaufman, G. W. Stewart, Math. Comp. 30,
    1976): each vector is read twice for all, by threads side by side, not four times."""

    def __init__(self, first: FloatArray) -> None:
        self._pieces = pieces(len(first), NUMBERS_A_PIECE)
        self._blocks: list[FloatArray] = []  # of GROWTH vectors each, by rows
        self._count = 0
        self.append(first, 1.0)

    @property
    def last(self) -> FloatArray:
        vector: FloatArray = self._blocks[-1][(self._count - 1) % GROWTH]
        return vector

    def append(self, w: FloatArray, size: float) -> None:
        """Add w / size."""
        if self._count % GROWTH == 0:
            self._blocks.append(np.empty((GROWTH, len(w))))
        np.divide(w, size, out=self._blocks[-1][self._count % GROWTH])
        self._count += 1

    def orthogonalised(self, w: FloatArray) -> tuple[list[float], FloatArray, float]:
        """As `_Basis.orthogonalised`; w is written to."""
        column, left, size = self._once(w)
        if math.isfinite(size) and size < CANCELLED * math.hypot(size, *column):
            more, left, size = self._once(left)
            column = column + more
        return column.tolist(), left, size

    def _once(self, w: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        vectors = [block[: self._count - GROWTH * k] for k, block in enumerate(self._blocks)]

        def along(i: int, j: int) -> FloatArray:
            return np.concatenate([block[:, i:j] @ w[i:j] for block in vectors])

        def take(i: int, j: int) -> float:
            for k, block in enumerate(vectors):
                w[i:j] -= column[GROWTH * k : GROWTH * k + len(block)] @ block[:, i:j]
            return float(w[i:j] @ w[i:j])

        column = np.sum(side_by_side([partial(along, i, j) for i, j in self._pieces]), axis=0)
        squares = side_by_side([partial(take, i, j) for i, j in self._pieces])
        return column, w, math.sqrt(sum(squares))


def _basis(first: FloatArray) -> _Basis | _LargeBasis:
    return _Basis(first) if len(first) < CLASSICAL_FROM else _LargeBasis(first)


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
    """sum of y_i times vector i, (n,) or (n, d), in double precision, without a copy of all of them, by pieces that the cache holds."""
    total = np.empty(vectors[0].shape)

    def add_up(i: int, j: int) -> None:
        part = total[i:j]
        np.multiply(vectors[0][i:j], y[0], out=part)
        for factor, vector in zip(y[1:], vectors[1:], strict=True):
            part += factor * vector[i:j]

    rows = NUMBERS_A_PIECE * len(total) // max(total.size, 1)
    side_by_side([partial(add_up, i, j) for i, j in pieces(len(total), rows)])
    return total
