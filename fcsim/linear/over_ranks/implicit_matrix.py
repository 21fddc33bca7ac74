"""A matrix that is known by its products, and made where its entries are asked for."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator

from fcsim.arrays import FloatArray, Matrix
from fcsim.brief import brief


class ImplicitMatrix(LinearOperator):
    """A symmetric (n, n): product(x) for x (n,) is what most ask for; `whole` is made once, of n rows on this process, for who needs it."""

    __repr__ = brief

    def __init__(self, size: int, product: Callable[[FloatArray], FloatArray], make_whole: Callable[[], sp.csr_array]) -> None:
        super().__init__(np.float64, (size, size))
        self._product, self._make_whole = product, make_whole

    def _matvec(self, x: FloatArray) -> FloatArray:
        return self._product(np.asarray(x).ravel())

    def _rmatvec(self, x: FloatArray) -> FloatArray:
        return self._matvec(x)

    @cached_property
    def whole(self) -> sp.csr_array:
        """The matrix with its entries."""
        return self._make_whole()


class LateMatrix(ImplicitMatrix):
    """One whose entries are not many: a problem takes it for an ordinary matrix, which is made where somebody reads it."""


def with_entries(A: Matrix) -> Matrix:
    """A as a matrix with entries, itself where it is one."""
    return A.whole if isinstance(A, ImplicitMatrix) else A
