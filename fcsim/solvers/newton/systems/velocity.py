"""Newton's linear system of a regularised problem in the bodies' velocities, for W = H^T M^-1 H of low rank: n unknowns instead of m.

With D = diag(shift) > 0 the matrices C = A D + B of single contacts are regular, sticking contacts (B = 0) included. From
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
from fcsim.linear.factors import DenseLU, SingularMatrix, SuperLU
from fcsim.problem import Delassus
from fcsim.problem.motion import Motion
from fcsim.solvers.newton.systems._velocity_kernels import add_shares

SPARSE_STEPS = 300
"""Small steps of forming the sparse matrix by products of sparse ones."""


class _Bodies:
    """H^T by contacts, and M: h (nc, d, k) on `unknowns` (nc, k), filled up with -1 and zeros."""

    def __init__(self, motion: Motion, dimension: int) -> None:
        HT, d = motion.HT, dimension
        m, n = HT.shape
        self.HT, self.H, self.M = HT, sp.csr_array(HT.T), motion.M
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
        graph = self.H.astype(bool) @ HT.astype(bool)
        self.mass = motion.M.toarray() if storage.eliminated_dense(n, graph.nnz, SPARSE_STEPS) else None


class VelocitySystem:
    """LU of M + H C^-1 A H^T, dense for few bodies, else sparse; the operator needs a positive shift and a `Motion`."""

    def __init__(self, operator: Delassus, bodies: _Bodies | None = None) -> None:
        """bodies: of another system of this W."""
        assert operator.motion is not None
        self.operator = operator
        self._bodies = _Bodies(operator.motion, operator.dimension) if bodies is None else bodies

    def shifted(self, shift: FloatArray) -> VelocitySystem:
        return VelocitySystem(self.operator.shifted(shift), self._bodies)

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        bodies, shift = self._bodies, self.operator.shift
        if shift is None:
            raise SingularMatrix("without a shift the contacts' own equations are singular where they stick")
        try:
            C = np.linalg.inv(A * shift[:, None, None] + B)
        except np.linalg.LinAlgError as error:
            raise SingularMatrix(f"the equations of a single contact are singular: {error}") from None
        K, c = C @ A, np.einsum("aij,aj->ai", C, rhs)
        right = bodies.H @ c.ravel()
        if bodies.mass is not None:
            S = bodies.mass.copy()
            add_shares(S, bodies.unknowns, bodies.h, K)
            dv = DenseLU(S.T, overwrite=True).solve_transposed(right)
        else:
            nc, d = rhs.shape
            shares = sp.bsr_array((K, np.arange(nc), np.arange(nc + 1)), shape=(nc * d, nc * d), blocksize=(d, d))
            dv = SuperLU(bodies.M + bodies.H @ (sp.csr_array(shares) @ bodies.HT), symmetric_pattern=True).solve(right)
        Wdr = bodies.HT @ dv
        dr = (c - np.einsum("aij,aj->ai", K, Wdr.reshape(rhs.shape))).ravel()
        return dr, Wdr + self.operator.by_unknown * dr
