"""An iterate of Newton's method on a step with nonlinear bodies, and what its last one leaves for the next step."""

from __future__ import annotations

from dataclasses import dataclass, field

from fcsim.arrays import FloatArray
from fcsim.assembly.compliance import SystemFactor
from fcsim.solvers.memory import Kept
from fcsim.timestep.step_equation.inner_term import Term


@dataclass(frozen=True, eq=False)
class KeptFactor(Kept):
    """The last system matrix with the factors of its bodies, for the steps that follow."""

    factor: SystemFactor = field(kw_only=True)


@dataclass(frozen=True, eq=False)
class Iterate:
    """v (n_dofs,), r of the contacts `met`, the term there, the residuals of the bodies relative to what is allowed, l of the links, and
    the push (n_dofs,) of pressures that follow, 0 without any; earlier (n_dofs,): v of the iterate before, in statics."""

    v: FloatArray
    r: FloatArray
    term: Term
    residual: float
    l: FloatArray
    push: FloatArray | float
    earlier: FloatArray | None = None
