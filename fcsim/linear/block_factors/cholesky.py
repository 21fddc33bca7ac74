"""Cholesky factorisation of a block-sparse symmetric positive definite matrix, for the middle between dense and very large.

The elimination works on dense fronts of some contacts at a time, compiled, since most are small (multifrontal
method: I. S. Duff, J. K. Reid, ACM Trans. Math. Softw. 9, 1983; T. A. Davis, Direct Methods for Sparse Linear Systems, SIAM, 2006).
Beside SuperLU it halves the operations, and beside MUMPS it spares the conversions that cost most on a few thousand unknowns.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.linear.block_factors import _cholesky_kernels as kernels
from fcsim.linear.block_factors.analysis import Analysis
from fcsim.linear.factors import SingularMatrix


class BlockCholesky:
    """A + shift I = L L^T for A of an `Analysis`; `SingularMatrix` where that is not positive definite."""

    name = "block Cholesky (multifrontal)"

    def __init__(self, analysis: Analysis, blocks: FloatArray, shift: float = 0.0) -> None:
        """blocks (nnz, d, d): the values of A."""
        self._fronts, self._dimension = analysis.fronts, analysis.dimension
        self._values = np.empty(analysis.offsets[-1])
        if not kernels.factorise(analysis.indptr, analysis.indices, blocks, shift, *analysis.fronts, self._values):
            raise SingularMatrix(f"matrix of size {analysis.size} is not symmetric positive definite")

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Return A^-1 rhs for rhs (m,)."""
        return kernels.solve(*self._fronts, self._values, self._dimension, np.ascontiguousarray(rhs))
