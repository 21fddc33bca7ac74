"""An iterate of Newton's method on a step with nonlinear bodies, its problem, and what the last one leaves for the next step."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from fcsim.arrays import FloatArray
from fcsim.assembly.compliance import SystemFactor
from fcsim.problem import GlobalProblem
from fcsim.problem.reduction import Reduction
from fcsim.solvers import Result
from fcsim.solvers.memory import Kept, Memory
from fcsim.timestep.chain import Attempt
from fcsim.timestep.step_equation.equation import Equation
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


class Posed(NamedTuple):
    """An iterate's problem as it was posed last, where its solver began, its result, None without any, the attempts at it, and what they
    leave; least: the share of the bodies' first stiffness with which the iteration begins anew, where they would fly too far."""

    equation: Equation
    problem: GlobalProblem
    reduction: Reduction
    warm: FloatArray
    result: Result | None
    tried: list[Attempt]
    serving: Memory | None
    least: float | None
