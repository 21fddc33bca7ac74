"""Cholesky factorisation of the matrix of a body of some hundred unknowns, by blocks that are coupled to their neighbours alone.

An ordering in which no unknown is coupled to one that is far from it, layer by layer through the body, makes its matrix block
tridiagonal. Of a brick of 8 x 4 x 4 cells the factor has a third of the entries of the dense one; what solves with it are products of small
matrices, as quick an operation as those of LAPACK, for the blocks of the diagonal are inverted: L_bb y = x is y = L_bb^-1 x. That loses
digits where L_bb is ill-conditioned (a body that mass alone holds in statics, say): such a matrix is left to the dense factor.

Sources: E. Cuthill, J. McKee, "Reducing the bandwidth of sparse symmetric matrices", Proc. 24th Nat. Conf. ACM, 1969; N. J. Higham,
Accuracy and Stability of Numerical Algorithms, SIAM, 2002, chapters 13 (block factors) and 14 (inverses of triangular matrices).
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
from scipy.sparse.csgraph import reverse_cuthill_mckee

from fcsim import runtime
from fcsim.arrays import FloatArray, IntArray
from fcsim.linear import storage
from fcsim.linear.block_factors import _tridiagonal_kernels as kernels
from fcsim.linear.factors import Factor, SingularMatrix, factorise, mirror

WORTH = 0.6
"""Of the dense factor's entries: with more the dense one is as quick."""
CONDITIONING = 1e-6
"""Least pivot over the largest of what is inverted by blocks. Residuals are those of the dense factor where soft modes rule the solution,
as under the loads of bodies; of a random solution 1e-11 of the right side at this limit."""
BACKWARD = 1e-14
"""Largest |A x - b| / (|A| |x|), in their largest entries, of the x found: the dense factor leaves 1e-15. Pivots do not tell of blocks
whose inverse loses digits: with nu = 0.499999 they are 2e-5 of the largest, and residuals 1e4 times those of the dense factor.
Source: J. L. Rigal, J. Gaches, "On the compatibility of a given solution with the data of a linear system", J. ACM 14, 1967."""
FEW = 96
"""Unknowns up to which the dense factor, one call, is as quick."""


class Layers(NamedTuple):
    """order (n,): the unknowns in the order of their elimination; ends (p,): where each layer ends."""

    order: IntArray
    ends: IntArray


class BlockTridiagonal:
    """A = L D L^T of a symmetric positive definite A by blocks, D_b = S_b = A_bb - G_b-1 A_b-1,b and L_b+1,b = G_b = A_b+1,b S_b^-1;
    `SingularMatrix` where it is not positive definite.

    conditioning: the least pivot over the largest, as of `DenseCholesky`
    """

    name = "block tridiagonal Cholesky"

    def __init__(self, A: FloatArray, order: IntArray, ends: IntArray) -> None:
        """A (n, n) dense; order (n,), ends (p,): see `Layers`."""
        self._order = order
        self._starts = np.concatenate([[0], ends])
        blocks: list[FloatArray] = []
        largest, least = 0.0, np.inf
        S = A[np.ix_(order[: ends[0]], order[: ends[0]])]
        for b, (i, j) in enumerate(itertools.pairwise(self._starts.tolist())):
            L, info = sla.lapack.dpotrf(S, lower=True)
            if info:
                raise SingularMatrix(f"matrix of size {len(A)} is not positive definite: pivot {i + info}")
            pivots = L.diagonal()
            largest, least = max(largest, float(pivots.max())), min(least, float(pivots.min()))
            inverse = sla.lapack.dpotri(L, lower=True)[0].T  # by rows, of which the upper triangle is there
            mirror(inverse)
            blocks.append(inverse)
            if j < len(order):
                beside, after = order[i:j], order[j : self._starts[b + 2]]
                below = A[np.ix_(after, beside)]
                G = below @ inverse
                S = A[np.ix_(after, after)] - G @ below.T
                blocks.append(G)
        self.conditioning = (least / largest) ** 2
        self._at = np.concatenate([[0], np.cumsum([block.size for block in blocks])])
        self._values = np.concatenate([block.ravel() for block in blocks])

    @runtime.limited_threads()  # products whose order of summation would depend on the threads of BLAS
    def solve(self, rhs: FloatArray) -> FloatArray:
        """Return A^-1 rhs for rhs (n,) or (n, k)."""
        X = rhs.reshape(len(rhs), -1)[self._order].astype(np.float64, copy=False)
        kernels.solve(self._starts, self._at, self._values, X)
        solution = np.empty_like(X)
        solution[self._order] = X
        return solution.reshape(rhs.shape)


def factorise_body(A: sp.csr_array, layers: Layers | None) -> Factor:
    """The factor of the positive definite matrix of a body, by the layers that `layers` finds, where that keeps the digits, else what
    `factorise` takes; `SingularMatrix` where it fails."""
    if layers is not None:
        factor = BlockTridiagonal(A.toarray(), *layers)
        if factor.conditioning >= CONDITIONING and _keeps_digits(A, factor):
            return factor
    return factorise(A, positive_definite=True)


def _keeps_digits(A: sp.csr_array, factor: BlockTridiagonal) -> bool:
    """Whether solutions are those of matrices as near to A as `BACKWARD`, seen at two right sides that hold all modes."""
    rhs = np.random.default_rng(0).standard_normal((A.shape[0], 2))
    X = factor.solve(rhs)
    left, norms = np.abs(A @ X - rhs).max(axis=0), np.abs(A.data).max() * np.abs(X).max(axis=0)
    return bool(np.all(left <= BACKWARD * norms))


def find_layers(A: sp.csr_array, points: FloatArray) -> Layers | None:
    """Layers of the unknowns of a matrix of symmetric pattern, of which each is coupled to its neighbours alone: of the orders along the
    axes of the points (n, d) where the unknowns stand, along the longest extent and that of Cuthill and McKee the one whose factor has
    the fewest entries. None where the dense factor is as quick."""
    n = A.shape[0]
    if not FEW < n <= storage.BLOCK_UP_TO:
        return None
    along = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][:1]
    orders: list[IntArray] = [np.argsort(points @ axis, kind="stable") for axis in (*np.eye(points.shape[1]), *along)]
    orders.append(reverse_cuthill_mckee(sp.csr_matrix(A), symmetric_mode=True).astype(np.int64))
    found = [Layers(order, _thinnest(_reach(A, order))) for order in orders]
    best = min(found, key=lambda one: _entries(one.ends))
    return best if _entries(best.ends) <= WORTH * 0.5 * n * n else None


def _entries(ends: IntArray) -> float:
    """Entries of the factor's blocks, triangles counted as such."""
    sizes = np.diff(ends, prepend=0).astype(float)
    return float(0.5 * (sizes @ sizes) + sizes[:-1] @ sizes[1:])


def _reach(A: sp.csr_array, order: IntArray) -> IntArray:
    """In an ordering the last unknown (n,) that one of the first i + 1 is coupled to."""
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    row = place[np.repeat(np.arange(len(order)), np.diff(A.indptr))]
    last = np.arange(len(order))
    np.maximum.at(last, row, place[A.indices])
    return np.maximum.accumulate(last)


def _thinnest(reach: IntArray) -> IntArray:
    """The ends of layers with the fewest entries, whatever the size of the first one up to what its first unknown reaches."""
    found = [kernels.partition(reach, first) for first in range(1, int(reach[0]) + 2)]
    return min(found, key=_entries)
