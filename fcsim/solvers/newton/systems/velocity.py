"""Newton's linear system of a regularised problem in the bodies' velocities, for W = H^T M^-1 H + diag(own): n unknowns instead of m.

With D = diag(shift + own) > 0 the matrices C = A D + B of single contacts are regular, sticking contacts (B = 0) included. From
A (H^T dv + D dr) + B dr = rhs and M dv = H dr,

    dr = C^-1 (rhs - A H^T dv),        (M + H C^-1 A H^T) dv = H C^-1 rhs,

a matrix with the pattern of the bodies' graph whatever the number of contacts between them: its elimination costs n^3 where that of the
contacts costs m^3, and rank-deficient W, of four and more points a face, does no harm. This is the elimination of the reactions from the
saddle-point matrix of the global form (see `kkt`), which the regularisation allows; Sherman, Morrison and Woodbury's identity for W.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray
from fcsim.linear import storage
from fcsim.linear.block_factors.analysis import Analysis
from fcsim.linear.block_factors.lu import BlockLU
from fcsim.linear.factors import DenseLU, SingularMatrix
from fcsim.problem import Delassus
from fcsim.problem.motion import Motion
from fcsim.solvers.newton.systems._velocity_kernels import add_shares, add_shares_to_rows, contacts_eliminated, places

SPARSE_STEPS = 50
"""Small steps of what the sparse elimination takes beside its operations."""
IRREGULAR = 2.0
"""Times the time of a dense operation that one of the sparse elimination takes."""


class Bodies:
    """H^T by contacts, and M: h (nc, d, k) on `unknowns` (nc, k), filled up with -1 and zeros; what eliminates the bodies' matrix.

    mass: M, dense, where that is eliminated dense, else None; flops: operations of an elimination, those of a sparse one counted
    `IRREGULAR` times.
    """

    def __init__(self, motion: Motion, dimension: int) -> None:
        HT, d = motion.HT, dimension
        m, n = HT.shape
        self.HT, self.H, self.own = HT, sp.csr_array(HT.T), np.zeros(m) if motion.own is None else motion.own
        row = np.repeat(np.arange(m), np.diff(HT.indptr))
        pairs, place = np.unique((row // d) * n + HT.indices, return_inverse=True)
        contact = pairs // n
        count = np.bincount(contact, minlength=m // d)
        position = np.arange(len(pairs)) - (np.cumsum(count) - count)[contact]
        shape = m // d, int(count.max(initial=0))
        self.unknowns: IntArray = np.full(shape, -1)
        self.unknowns[contact, position] = pairs % n
        self.h = np.zeros((shape[0], d, shape[1]))
        np.add.at(self.h, (row // d, row % d, position[place]), HT.data)
        self.flops, self.mass = 2 / 3 * n**3, None
        touching = sp.csr_array((np.ones(len(pairs)), (contact, pairs % n)), shape=(m // d, n))
        M = sp.csr_array(motion.M, copy=True)
        M.sum_duplicates()
        M.eliminate_zeros()  # which the pattern's sum would leave out
        graph = sp.csr_array(touching.T @ touching + abs(M) + sp.eye_array(n))
        if not storage.eliminated_dense(n, graph.nnz, SPARSE_STEPS):
            graph.sort_indices()
            self.analysis = Analysis(sp.bsr_array(graph, blocksize=(1, 1)))
            indptr, indices = self.analysis.indptr, self.analysis.indices
            self.flops = IRREGULAR * self.analysis.flops
            self.places = places(indptr, indices, self.unknowns)
            key = np.repeat(np.arange(n), np.diff(indptr)) * n + indices
            own = np.repeat(np.arange(n), np.diff(M.indptr)) * n + M.indices
            self.values = np.bincount(np.searchsorted(key, own), M.data, minlength=len(indices))  # of M, in the pattern
        else:
            self.mass = motion.M.toarray()

    @property
    def places_count(self) -> int:
        """Entries of all contacts' shares of the bodies' matrix."""
        return self.unknowns.size * self.unknowns.shape[1]

    def solve(self, K: FloatArray, right: FloatArray) -> FloatArray:
        """(M + H diag(K) H^T)^-1 right (n,), K (nc, d, d); raises SingularMatrix."""
        if self.mass is not None:
            S = self.mass.copy()
            add_shares(S, self.unknowns, self.h, K)
            return DenseLU(S.T, overwrite=True).solve_transposed(right)
        values = self.values.copy()
        add_shares_to_rows(values, self.places, self.h, K)
        return BlockLU(self.analysis, values.reshape(-1, 1, 1)).solve(right)


def bodies_of(operator: Delassus) -> Bodies:
    """The bodies behind W, made once for an operator and its shifts, which has a `Motion`."""
    whole = operator if operator.unshifted is None else operator.unshifted
    return whole.derived(_bodies)


def _bodies(operator: Delassus) -> Bodies:
    assert operator.motion is not None
    return Bodies(operator.motion, operator.dimension)


class VelocitySystem:
    """LU of M + H C^-1 A H^T, dense for few bodies, else by fronts; the operator needs a `Motion`, and every contact unknown a positive
    shift or a compliance of its own."""

    def __init__(self, operator: Delassus) -> None:
        self.operator, self._bodies = operator, bodies_of(operator)

    def shifted(self, shift: FloatArray) -> VelocitySystem:
        return VelocitySystem(self.operator.shifted(shift))

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        bodies = self._bodies
        own = bodies.own + self.operator.by_unknown
        if not own.any():
            raise SingularMatrix("without a shift the contacts' own equations are singular where they stick")
        K, c, singular = contacts_eliminated(A, B, own.reshape(rhs.shape), rhs)
        if singular >= 0:
            raise SingularMatrix(f"contact {singular}: its own equations are singular")
        Wdr = bodies.HT @ bodies.solve(K, bodies.H @ c.ravel())
        dr = (c - np.einsum("aij,aj->ai", K, Wdr.reshape(rhs.shape))).ravel()
        return dr, Wdr + own * dr
