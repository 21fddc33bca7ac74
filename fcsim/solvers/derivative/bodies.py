"""The derivative of the global problem's solution (r, u, v) with respect to M, f, w and mu.

M v = H r + f differentiated, dv = M^-1 (H dr + df - dM v), makes of changes of M, f and w one of the free velocity,

    dq = dw + H^T M^-1 (df - dM v),

which the contacts' derivative takes on; with equality constraints G^T v + b = 0, M^-1 is that of [[M, -G], [-G^T, 0]].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray, Matrix
from fcsim.errors import InputError
from fcsim.linear.factors import is_symmetric
from fcsim.problem.reduction import Reduction
from fcsim.solvers.derivative.contacts import Change, LocalDerivative, checked_direction
from fcsim.solvers.derivative.outer import OuterProduct, checked_change


@dataclass(frozen=True, eq=False)
class GlobalGradient:
    """The gradient of a scalar with respect to M, f (n,), w (m,) and mu (nc,), as `Gradient`."""

    M: OuterProduct
    f: FloatArray
    w: FloatArray
    mu: FloatArray


@dataclass(frozen=True, eq=False)
class GlobalDerivative:
    """At the solution (r, u, v); contacts: the derivative of the local form."""

    reduction: Reduction
    contacts: LocalDerivative
    v: FloatArray

    def forward(
        self,
        *,
        M: Matrix | None = None,
        f: FloatArray | None = None,
        w: FloatArray | None = None,
        mu: FloatArray | None = None,
    ) -> Change:
        """How (r, u, v) changes with changes of M (n, n), f (n,), w (m,) and mu (nc,), each 0 where not given."""
        p, n = self.reduction.problem, len(self.v)
        load = checked_direction(f, "f", (n,))
        if M is not None:
            load = load - checked_change(M, "M", (n, n)) @ self.v
        free = self._velocity(load)
        local = self.contacts.forward(q=checked_direction(w, "w", (p.m,)) + p.H.T @ free, mu=mu)
        return Change(local.r, local.u, free + self._velocity(p.H @ local.r))

    def backward(self, *, r: FloatArray | None = None, u: FloatArray | None = None, v: FloatArray | None = None) -> GlobalGradient:
        """The gradient of a scalar whose own gradients with respect to r, u (m,) and v (n,) are these, 0 where not given.

        InputError where M is not symmetric, since its transpose is not factored."""
        p, n = self.reduction.problem, len(self.v)
        if not is_symmetric(p.M):
            raise InputError("M: expected a symmetric matrix for gradients backward, got one that is not (forward takes it)")
        own = self._velocity(checked_direction(v, "v", (n,)))
        local = self.contacts.backward(r=checked_direction(r, "r", (p.m,)) + p.H.T @ own, u=u)
        onto_f = own + self._velocity(p.H @ local.q)
        return GlobalGradient(OuterProduct(-onto_f, self.v), onto_f, local.q, local.mu)

    def _velocity(self, load: FloatArray) -> FloatArray:
        """M^-1 load (n,), with the constraints' multipliers where there are any."""
        G = self.reduction.problem.G
        if G is None:
            return self.reduction.factor.solve(load)
        return self.reduction.factor.solve(np.concatenate([load, np.zeros(G.shape[1])]))[: len(load)]
