"""Cholesky factorisation of a block-sparse symmetric positive definite matrix, for the middle between dense and very large.

Each contact is one node of the graph that is ordered; the elimination works on dense fronts of some contacts at a time (multifrontal
method: I. S. Duff, J. K. Reid, ACM Trans. Math. Softw. 9, 1983; T. A. Davis, Direct Methods for Sparse Linear Systems, SIAM, 2006).
Beside SuperLU it halves the operations, and beside MUMPS it spares the conversions that cost most on a few thousand unknowns.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from fcsim.arrays import FloatArray, IntArray
from fcsim.linear import _block_cholesky_kernels as kernels
from fcsim.linear.factors import SingularMatrix


def minimum_degree(indptr: IntArray, indices: IntArray) -> IntArray:
    """The rows of a symmetric pattern in an order of little fill, by SuperLU's multiple minimum degree."""
    n = len(indptr) - 1
    row = np.repeat(np.arange(n), np.diff(indptr))
    graph = sp.csc_matrix((np.where(row == indices, 2.0 * n, 1.0), indices, indptr), shape=(n, n))
    # an incomplete factorisation that drops everything off the diagonal: SuperLU's ordering without its elimination
    options = {"SymmetricMode": True, "Equil": False}
    factor = spla.spilu(graph, 1.0, 1.0, "basic", "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    return np.argsort(factor.perm_c)


class Analysis:
    """What the pattern of a matrix alone decides: the order of elimination, the fronts and their storage."""

    def __init__(self, A: Any) -> None:
        """A (m, m) symmetric, by square blocks (bsr), every diagonal block stored; of two mirror images the values of one are read."""
        self.indptr, self.indices = A.indptr.astype(np.int64), A.indices.astype(np.int64)
        self.size, self.dimension = A.shape[0], A.blocksize[0]
        order = minimum_degree(self.indptr, self.indices)
        order = order[kernels.postorder(kernels.elimination_tree(self.indptr, self.indices, order))]
        parent = kernels.elimination_tree(self.indptr, self.indices, order)
        starts, rows = kernels.column_structure(self.indptr, self.indices, order, parent)
        first = kernels.supernodes(parent, starts)
        self.offsets = kernels.panel_offsets(first, starts, self.dimension)
        self.fronts = order, first, starts, rows, self.offsets


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
