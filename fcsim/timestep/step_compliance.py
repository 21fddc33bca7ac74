"""What stands for M^-1 in a step's problem: the model's factor, and W = H^T A^-1 H summed from the parts' compliances."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.assembly.compliance import SystemFactor
from fcsim.problem.delassus_sum import DelassusSum


@dataclass(frozen=True, eq=False)
class StepCompliance:
    """The `MassFactor` of a step (see `fcsim.problem.reduction`): products with the few entries of H are all that a step adds."""

    factor: SystemFactor

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Return A^-1 rhs for rhs (n,) of the problem's unknowns."""
        return self.factor.solve(rhs)

    def delassus(self, H: Any, dimension: int) -> Any:
        """Return W = H^T A^-1 H (m, m) for H (n, m) on the problem's unknowns."""
        model = self.factor.model
        H = sp.csc_array(H)
        if model.driven == "eliminated":
            H = sp.csc_array((H.data, model.free_dofs[H.indices], H.indptr), shape=(model.n_dofs, H.shape[1]))
        W = DelassusSum(H, *self.factor.places, len(model.bodies), dimension)
        for first, compliances, kind in self.factor.compliances():
            W.add(first, compliances, kind)
        return W.matrix()
