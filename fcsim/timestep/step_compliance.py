"""What stands for M^-1 in a step's problem: the model's factor, and W = H^T A^-1 H summed from the parts' compliances."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.assembly.compliance import SystemFactor
from fcsim.problem.delassus_sum import DelassusSum
from fcsim.timestep._turned_rows_kernels import turned_rows


@dataclass(frozen=True, eq=False)
class StepCompliance:
    """The `MassFactor` of a step (see `fcsim.problem.reduction`): products with the few entries of H are all that a step adds.

    summed: W of this H where it is known already, from another right side of the step.
    """

    factor: SystemFactor
    summed: Any = None

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Return A^-1 rhs for rhs (n,) of the problem's unknowns."""
        return self.factor.solve(rhs)

    def delassus(self, H: Any, dimension: int) -> Any:
        """Return W = H^T A^-1 H (m, m) for H (n, m) on the problem's unknowns."""
        if self.summed is not None:
            return self.summed
        model = self.factor.model
        H = sp.csc_array(H)
        if model.driven == "eliminated":
            H = sp.csc_array((H.data, model.free_dofs[H.indices], H.indptr), shape=(model.n_dofs, H.shape[1]))
        if self.factor.rotation is not None:
            H = self._in_frames(H)
        W = DelassusSum(H, *self.factor.places, len(model.bodies), dimension)
        for first, compliances, kind in self.factor.compliances():
            W.add(first, compliances, kind)
        return W.matrix()

    def _in_frames(self, H: Any) -> Any:
        """T^T H in the axes of the bodies' compliances."""
        model = self.factor.model
        sizes = np.diff(model.node_offset[: len(model.deformable) + 1])
        if not H.has_sorted_indices:
            H = H.sorted_indices()
        body = np.repeat(np.arange(len(sizes)), sizes)
        indptr, indices, data = turned_rows(H.indptr, H.indices, H.data, body, self.factor.rotation)
        return sp.csc_array((data, indices, indptr), shape=H.shape)
