"""Cholesky factorisation of a block-sparse symmetric positive definite matrix, for the middle between dense and very large.

The elimination works on dense fronts of some contacts at a time, compiled, since most are small (multifrontal
method: I. S. Duff, J. K. Reid, ACM Trans. Math. Softw. 9, 1983; T. A. Davis, Direct Methods for Sparse Linear Systems, SIAM, 2006).
Beside SuperLU it halves the operations, and beside MUMPS it spares the conversions that cost most on a few thousand unknowns.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.linear import _block_cholesky_kernels as kernels
from fcsim.linear.elimination_tree import elimination_tree
from fcsim.linear.factors import SingularMatrix

PADDING = 0.15
"""Share of zeros in a front: they are small, so that their number counts."""


class Analysis:
    """What the pattern of a matrix alone decides: the elimination tree and where the fronts' panels, own columns with all rows, begin.

    flops: operations of an LU (twice those of the Cholesky factor); entries: those of the factor.
    """

    def __init__(self, A: sp.bsr_array) -> None:
        """A (m, m) symmetric, by square blocks (bsr), every diagonal block stored; of two mirror images the values of one are read."""
        self.indptr, self.indices = A.indptr.astype(np.int64), A.indices.astype(np.int64)
        self.size, self.dimension = A.shape[0], A.blocksize[0]
        tree = elimination_tree(self.indptr, self.indices, PADDING)
        own, border = self.dimension * np.diff(tree.first), self.dimension * np.diff(tree.starts)
        self.offsets = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(own * (own + border))])
        self.flops, self.entries = tree.flops(self.dimension), int(self.offsets[-1])  # of an LU; of the factor
        self.fronts = tree.order, tree.first, tree.starts, tree.rows, self.offsets


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
