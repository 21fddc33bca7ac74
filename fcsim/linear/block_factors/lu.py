"""LU factorisation of a block-sparse matrix with a symmetric pattern, on the active contacts of an `Analysis` that serves many of them.

The matrices of Newton's steps, A W + B, keep the pattern of W while their values and the active contacts change from iteration to
iteration: a general sparse LU orders and analyses each anew, which takes longer than the elimination of a few hundred contacts. Dense
fronts as in `cholesky`, rows exchanged inside a front's own contacts; who needs more exchanges sees it in the defect.

Sources: I. S. Duff, J. K. Reid, ACM Trans. Math. Softw. 9, 1983 (unsymmetric matrices of symmetric pattern by fronts); G. H. Golub,
C. F. Van Loan, Matrix Computations, 1996, section 3.2 (blocked LU).
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import BoolArray, FloatArray
from fcsim.linear.block_factors import _lu_kernels as kernels
from fcsim.linear.block_factors.analysis import Analysis
from fcsim.linear.factors import SingularMatrix


class BlockLU:
    """A = L U on the active contacts; `SingularMatrix` where a front has no pivot."""

    name = "block LU (multifrontal)"

    def __init__(self, analysis: Analysis, blocks: FloatArray, active: BoolArray | None = None) -> None:
        """blocks (nnz, d, d): the values of A in the analysed pattern; active (nc,): whose rows and columns are A's, None: everyone's."""
        d = self._dimension = analysis.dimension
        order, first, starts, rows, _ = analysis.fronts
        if active is None:
            active = np.ones(len(order), dtype=bool)
        number, own, border, offsets = kernels.taking_part(order, first, starts, rows, active, d)
        values, pivots = np.empty(offsets[-1]), np.empty(d * int(np.count_nonzero(active)), dtype=np.int64)
        self._fronts = order, first, starts, rows, number, own, border, offsets, values, pivots
        if not kernels.factorise(analysis.indptr, analysis.indices, analysis.mirror, blocks, *self._fronts):
            raise SingularMatrix(f"a front of a matrix of {len(pivots)} unknowns is singular")

    @property
    def sign(self) -> int:
        """Of the determinant: 1 or -1."""
        _, _, _, _, _, own, border, offsets, values, pivots = self._fronts
        return int(kernels.sign(own, border, offsets, values, pivots, self._dimension))

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Return A^-1 rhs (m,), zero for contacts that are not active, for rhs (m,), of which their part is not read."""
        return kernels.solve(*self._fronts, self._dimension, np.ascontiguousarray(rhs))
