"""The linear systems (A W + B) dr = rhs of an interior point: one factor for a predictor and its corrector.

B (nc, d, d) is regular for every contact, sticking ones included, as long as the point is inside: so W of bodies with few degrees of
freedom is eliminated in their velocities, dr = C^-1 (rhs - A H^T dv), (M + H C^-1 A H^T) dv = H C^-1 rhs with C = A D + B, see
`newton.systems.velocity`. Other W are eliminated dense or by fronts of single contacts, as they are stored best.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.linear.block_factors.lu import BlockLU
from fcsim.linear.factors import DenseLU, SingularMatrix
from fcsim.problem import Delassus
from fcsim.solvers.interior_point import _step_kernels as kernels
from fcsim.solvers.newton.systems._direct_kernels import active_matrix, newton_blocks
from fcsim.solvers.newton.systems.velocity import bodies_of

Solve = Callable[[FloatArray], FloatArray]
FEWER = 0.9
"""Velocities of bodies over contact unknowns up to which these are eliminated."""
SHIFT = 1e-10
"""Share of the compliance that is added to contacts before they are eliminated: B of a sticking one goes to zero with tau, and its inverse
would take the digits of the others. Without it and the refinement 30 of 36 problems of blocks and masses are solved to 1e-12, with them
all."""


def by_bodies(operator: Delassus) -> bool:
    """Whether the system is eliminated in the bodies' velocities."""
    return operator.motion is not None and operator.motion.M.shape[0] <= FEWER * operator.size


class InteriorSystem:
    """Factors A W + B of one operator W and changing A and B (nc, d, d), each contact's B regular."""

    def __init__(self, operator: Delassus) -> None:
        self.in_velocities = by_bodies(operator)
        self._operator = operator if self.in_velocities else operator.stored

    def factored(self, A: FloatArray, B: FloatArray) -> Solve:
        """What multiplies (nc, d) by (A W + B)^-1; raises SingularMatrix."""
        if not np.all(np.isfinite(B)):
            raise SingularMatrix("an interior point's system is beyond the largest number")
        if self.in_velocities:
            return self._by_bodies(A, B)
        if isinstance(self._operator.W, np.ndarray):
            nc, d = A.shape[:2]
            J = np.empty((nc * d, nc * d))
            active_matrix(self._operator.W, np.zeros(nc), A, B, np.arange(nc), J)
            dense = DenseLU(J.T, overwrite=True)
            return lambda rhs: dense.solve_transposed(rhs.ravel()).reshape(rhs.shape)
        rows, analysis = self._operator.analysis
        sparse = BlockLU(analysis, newton_blocks(analysis.indptr, analysis.indices, rows.data, A, B))
        return lambda rhs: sparse.solve(rhs.ravel()).reshape(rhs.shape)

    def _by_bodies(self, A: FloatArray, B: FloatArray) -> Solve:
        """With A (W + D) + B for A W + B, D of SHIFT, and one step of iterative refinement."""
        operator, bodies, shape = self._operator, bodies_of(self._operator), A.shape[:2]
        own = bodies.own.reshape(shape) + SHIFT * operator.compliance[:, None]
        inverse, K, singular = kernels.inverted(A, B, own)
        if singular >= 0:
            raise SingularMatrix(f"contact {singular}: its own equations are singular")
        solve, _ = bodies.factored(K)

        def shifted(rhs: FloatArray) -> FloatArray:
            c, right = kernels.to_bodies(inverse, rhs, bodies.unknowns, bodies.h, bodies.HT.shape[1])
            dr: FloatArray = kernels.from_bodies(c, K, solve(right), bodies.unknowns, bodies.h)
            return dr

        def refined(rhs: FloatArray) -> FloatArray:
            dr = shifted(rhs)
            return dr + shifted(kernels.defect(A, B, (operator @ dr.ravel()).reshape(shape), dr, rhs))

        return refined
