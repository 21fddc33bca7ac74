"""What Gauss-Seidel sweeps read of a problem."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.linear._block_rows_kernels import own_blocks, product
from fcsim.linear.block_rows import block_rows, embed_vector
from fcsim.problem import LocalProblem
from fcsim.solvers.scaling import RHO_RULES


@dataclass(frozen=True, eq=False)
class ContactRows:
    """What sweeps read of a problem, (nc, 3) and (.., 3, 3) also in 2D: W by block rows, q, and each contact's own W_aa + shift_a I, rho.

    alpha is the option `regularisation`; a method that sweeps in several turns makes this once.
    """

    indptr: IntArray
    indices: IntArray
    blocks: FloatArray
    diagonal: FloatArray
    shift: FloatArray
    q: FloatArray
    mu: FloatArray
    rho: FloatArray

    @staticmethod
    def of(problem: LocalProblem, rho: str, alpha: float = 0.0) -> ContactRows:
        """By the rule `rho`, a name of `scaling`."""
        d = problem.dimension
        rows = block_rows(problem.W, d)
        own, shift = own_blocks(*rows), np.zeros(problem.nc)
        if alpha:
            shift = alpha * np.linalg.norm(own[:, :d, :d], ord=2, axis=(1, 2))
            own += shift[:, None, None] * np.eye(3)
        rates = np.ascontiguousarray(RHO_RULES[rho](own[:, :d, :d])[:, :2])
        return ContactRows(*rows, own, shift, embed_vector(problem.q, d), problem.mu, rates)

    def velocity(self, reaction: FloatArray) -> FloatArray:
        """u = W r + q (nc, 3)."""
        return product(self.indptr, self.indices, self.blocks, self.q, reaction)
