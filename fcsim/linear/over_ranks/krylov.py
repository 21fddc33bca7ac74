"""GMRES where each rank has a part of every vector: products of vectors are summed over the ranks, all else is their own."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray
from fcsim.linear.krylov import LeastSquares, combined, flat

GROWTH = 32
"""Vectors by which the basis grows."""
CANCELLED = 0.1
"""What Gram-Schmidt leaves of a vector's length where it is taken once more: classical Gram-Schmidt loses in orthogonality what that
cancels."""


def gmres_over_ranks(
    product: Callable[[FloatArray], FloatArray],
    precondition: Callable[[FloatArray], NDArray[np.floating]],
    rhs: FloatArray,
    summed: Callable[[FloatArray], FloatArray],
    accuracy: float,
    plateau: float,
    limit: int,
    enough: float,
) -> FloatArray | None:
    """Right-preconditioned GMRES for A x = rhs (k,) from x = 0, of which k are this rank's (Y. Saad, M. H. Schultz, SIAM J. Sci. Stat.
    Comput. 7, 1986), by classical Gram-Schmidt, twice where it cancels (J. W. Daniel, W. B. Gragg, L. Kaufman, G. W. Stewart, Math. Comp.
    30, 1976): one sum over the ranks for a vector, whatever their number, three where it cancels. With one the length of what is left
    follows from Pythagoras' theorem, to a part of 1e-5 in single precision; each vector's own is summed with the next one's products, so
    that this does not add up.

    precondition: its answers are kept as they come, in single precision where they are. summed: numbers (j,) -> their sum over the ranks,
    the same bits on all. Return this rank's part of x with ||rhs - A x|| <= accuracy ||rhs||, in the recurrence's norm, on a plateau (see
    `fcsim.linear.krylov`) with <= plateau ||rhs||, or after `limit` iterations with <= enough ||rhs||; None where they do not get there.
    """
    beta = math.sqrt(float(summed(np.array([rhs @ rhs]))[0]))
    if beta == 0:
        return np.zeros_like(rhs)
    basis = _Basis(len(rhs))
    basis.append(rhs / beta)
    steps: list[NDArray[np.floating]] = []
    small = LeastSquares(beta)
    for j in range(limit):
        last = basis.last
        steps.append(precondition(last))
        w = product(steps[-1].astype(np.float64, copy=False))
        along = summed(np.concatenate([basis.along(w), [w @ w, last @ last]]))
        basis.squares.append(float(along[-1]))
        column, whole = along[:-2] / basis.squares, float(along[-2])
        w -= basis.times(column)
        left_of_it = whole - float(column @ along[:-2])  # its square, by Pythagoras
        if not math.isfinite(left_of_it):
            return None
        if left_of_it > CANCELLED**2 * whole:
            size = math.sqrt(left_of_it)
        else:
            again = summed(basis.along(w)) / basis.squares
            w -= basis.times(again)
            column = column + again
            size = math.sqrt(float(summed(np.array([w @ w]))[0]))
        if not small.add(column.tolist(), size):
            return None
        left = small.defects[-1]
        if left <= accuracy * beta or (left <= plateau * beta and flat(small.defects)) or (j + 1 == limit and left <= enough * beta):
            # from the very steps that A was applied to: what single precision rounds of them is large in what A makes of it
            return combined(small.coefficients(), steps)
        if size == 0:
            return None
        basis.append(w / size)
    return None


class _Basis:
    """V (j, k): vectors of which each rank has a part, in single precision, in which the preconditioner takes them: half of what an
    iteration reads. In blocks, so that nothing is moved where it grows."""

    def __init__(self, size: int) -> None:
        self._size, self._count = size, 0
        self.squares: list[float] = []  # of the vectors' lengths, which are 1 to round-off
        self._blocks: list[NDArray[np.float32]] = []

    def append(self, v: FloatArray) -> None:
        if self._count == GROWTH * len(self._blocks):
            self._blocks.append(np.empty((GROWTH, self._size), dtype=np.float32))
        self._blocks[-1][self._count % GROWTH] = v
        self._count += 1

    @property
    def last(self) -> FloatArray:
        return self._blocks[-1][(self._count - 1) % GROWTH].astype(np.float64)

    def _parts(self) -> Iterator[NDArray[np.float32]]:
        for k, block in enumerate(self._blocks):
            yield block[: self._count - k * GROWTH]

    def along(self, w: FloatArray) -> FloatArray:
        """V w (j,)."""
        given = w.astype(np.float32)
        return np.concatenate([part @ given for part in self._parts()]).astype(np.float64)

    def times(self, y: FloatArray) -> FloatArray:
        """V^T y (k,)."""
        total, given = np.zeros(self._size), y.astype(np.float32)
        for k, part in enumerate(self._parts()):
            total += given[k * GROWTH : k * GROWTH + len(part)] @ part
        return total
