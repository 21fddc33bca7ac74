"""The inner forces of nonlinear bodies in a step's equation: w F(x(v)), and their share of the system matrix, w dF/dv."""

from __future__ import annotations

from dataclasses import dataclass

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State


@dataclass(frozen=True, eq=False)
class Term:
    """At an iterate: force (n_dofs,) = w F; blocks of each group (nb, nblocks, d, d) = w dF/dv, () where not asked for; inadmissible:
    name of
    a body whose points have no admissible state there, "" = none."""

    force: FloatArray
    blocks: tuple[FloatArray, ...]
    inadmissible: str = ""


@dataclass(frozen=True, eq=False)
class InnerTerm:
    """The term of one step of a scheme from a state."""

    scheme: Scheme
    model: Model
    state: State

    def at(self, v: FloatArray, tangent: bool = False) -> Term:
        """The term at the iterate v (n_dofs,)."""
        scheme, state = self.scheme, self.state
        first, last = scheme.elastic_path(self.model, state, v)
        x = first + scheme.elastic_share * (last - first)
        dt, weight = scheme.elastic_time, scheme.elastic_weight
        damped = scheme.damping_velocity(self.model, state, v) if self.model.beta else None
        rate = scheme.damping_reach / scheme.elastic_reach
        inner = self.model.nonlinear.inner(x, state.internal, state.t + dt, dt, v=damped, rate=rate, tangent=tangent)
        bad = "" if inner.admissible else self.model.deformable[inner.inadmissible].name
        factor = weight * scheme.elastic_reach
        return Term(weight * inner.force, tuple(factor * blocks for blocks in inner.blocks), bad)
