"""GMRES where each rank has a part of every vector, and copies of what is around it: what exchanges there are, an iteration has one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray
from fcsim.linear.krylov import LeastSquares, combined, flat
from fcsim.linear.over_ranks._krylov_kernels import less_combination, take_divided

GROWTH = 32
"""Vectors by which the basis grows."""
CANCELLED = 0.1
"""What Gram-Schmidt leaves of a vector's length where it is taken once more: classical Gram-Schmidt loses in orthogonality what that
cancels."""


class Ranks(Protocol):
    """How vectors lie on the ranks, see `fcsim.problem.distributed.Halo`: each has `own` numbers of them and, after these, copies of
    others'; to the first `shared` of these it contributes."""

    own: int
    shared: int

    def joined(self, share: FloatArray, numbers: FloatArray) -> tuple[FloatArray, float, FloatArray]: ...

    def summed(self, numbers: FloatArray) -> FloatArray: ...


def gmres_over_ranks(
    product: Callable[[NDArray[np.floating]], FloatArray],
    precondition: Callable[[NDArray[np.float32]], NDArray[np.floating]],
    rhs: FloatArray,
    ranks: Ranks,
    accuracy: float,
    plateau: float,
    limit: int,
    enough: float,
) -> tuple[FloatArray, FloatArray] | None:
    """Right-preconditioned GMRES for A x = rhs (k,) from x = 0, of which this rank has its own and copies of others' (Y. Saad,
    M. H. Schultz, SIAM J. Sci. Stat. Comput. 7, 1986), by classical Gram-Schmidt, twice where it cancels (J. W. Daniel, W. B. Gragg,
    L. Kaufman, G. W. Stewart, Math. Comp. 30, 1976): one exchange for a vector, of its entries beside other ranks and of its products with
    those before, and two sums more where it cancels. With one the length of what is left follows from Pythagoras' theorem, to a part of
    1e-5 in single precision; each vector's own is summed with the next one's products, so that this does not add up.

    precondition: v (k,) with the copies -> this rank's own part of x, and after it what else `product` takes, kept as it comes, in single
    precision where it is. product: that -> what this rank's share of A makes of x, (ranks.shared,). Return this rank's part of x with
    ||rhs - A x|| <= accuracy ||rhs||, in the recurrence's norm, on a plateau (see `fcsim.linear.krylov`) with <= plateau ||rhs||, or after
    `limit` iterations with <= enough ||rhs||, and by what factors the preconditioner's answers are summed to it; None where they do not get
    there.
    """
    own, shared = ranks.own, ranks.shared
    beta = math.sqrt(float(ranks.summed(np.array([rhs[:own] @ rhs[:own]]))[0]))
    if beta == 0:
        return np.zeros(own), np.empty(0)
    basis = _Basis(len(rhs), limit)
    square = basis.append(rhs, beta, own)
    steps: list[NDArray[np.floating]] = []
    small = LeastSquares(beta)
    for j in range(limit):
        steps.append(precondition(basis.last))
        share = product(steps[-1])
        w, whole, along = ranks.joined(share, basis.along(share[:shared], square))
        basis.squares[j], along = along[-1], along[:-1]
        column = along / basis.squares[: j + 1]
        basis.take_from(w, column)
        left_of_it = whole - float(column @ along)  # its square, by Pythagoras
        if not math.isfinite(left_of_it):
            return None
        if left_of_it > CANCELLED**2 * whole:
            size = math.sqrt(left_of_it)
        else:
            again = ranks.summed(basis.along(w[:own])) / basis.squares[: j + 1]
            basis.take_from(w, again)
            column = column + again
            size = math.sqrt(float(ranks.summed(np.array([w[:own] @ w[:own]]))[0]))
        if not small.add(column.tolist(), size):
            return None
        left = small.defects[-1]
        if left <= accuracy * beta or (left <= plateau * beta and flat(small.defects)) or (j + 1 == limit and left <= enough * beta):
            # from the very steps that A was applied to: what single precision rounds of them is large in what A makes of it
            y = small.coefficients()
            return combined(y, [step[:own] for step in steps]), y
        if size == 0:
            return None
        square = basis.append(w, size, own)
    return None


class _Basis:
    """V (j, k): vectors of which each rank has a part, in single precision, in which the preconditioner takes them: half of what an
    iteration reads. In blocks, so that nothing is moved where it grows."""

    def __init__(self, size: int, most: int) -> None:
        self._size, self._count = size, 0
        self.squares = np.empty(most)  # of the vectors' lengths, which are 1 to round-off, as they are known
        self._blocks: list[NDArray[np.float32]] = []

    def append(self, w: FloatArray, size: float, own: int) -> float:
        """Take w / size for the next vector; the sum of the squares of its first `own` entries, as they are kept."""
        if self._count == GROWTH * len(self._blocks):
            self._blocks.append(np.empty((GROWTH, self._size), dtype=np.float32))
        self._count += 1
        square: float = take_divided(w, size, own, self.last)
        return square

    @property
    def last(self) -> NDArray[np.float32]:
        return self._blocks[-1][(self._count - 1) % GROWTH]

    def _parts(self) -> Iterator[NDArray[np.float32]]:
        for k, block in enumerate(self._blocks):
            yield block[: self._count - k * GROWTH]

    def along(self, w: FloatArray, *more: float) -> FloatArray:
        """V w (j,) by the first entries of the vectors, as many as w has, and after it `more`."""
        found, given = np.empty(self._count + len(more)), w.astype(np.float32)
        for k, part in enumerate(self._parts()):
            found[k * GROWTH : k * GROWTH + len(part)] = part[:, : len(w)] @ given
        found[self._count :] = more
        return found

    def take_from(self, w: FloatArray, y: FloatArray) -> None:
        """Replace w (k,) by w - V^T y."""
        for k, part in enumerate(self._parts()):
            less_combination(part, y[k * GROWTH : k * GROWTH + len(part)], w)
