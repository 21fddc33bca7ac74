"""The elastic forces of a step with turning bodies, linearised where its iterations stand.

The step's equation is R(v) = b - w F(x(v)) + H r - (what is linear in v) = 0 with the elastic force F of the scheme's configuration x(v) and
weight w. With the constant matrix S = s T K T^T, s = dF's factor in the scheme's matrix, T from the rotations in the middle of the step,
the problem at the iterate v_i is

    A v = H r + b - e_i,  e_i = w F(x(v_i)) - S v_i

and A, W and all factors are the same for all iterations: only the right side changes. S differs from the derivative of w F by the strain and by
what the body's rotation differs from T's, which is the rate of convergence. Linear bodies have e_i = w K x(0) at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.elastic_forces import Configuration
from fcsim.assembly.model import Model
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State

TOLERANCE = 1e-10
"""Of a body's elastic term from one iteration to the next, relative to what moves the body in the step."""

ROUND_OFF = 64 * np.finfo(float).eps
"""Of stiffness times the size of a body: changes of forces below are none."""

MAX_ITERATIONS = 25


@dataclass(frozen=True, eq=False)
class Linearisation:
    """The elastic term of one step of a scheme from a state."""

    scheme: Scheme
    model: Model
    state: State

    @cached_property
    def _begin(self) -> Configuration:
        return self.model.elastic.at(self.state.x)

    @cached_property
    def rotation(self) -> FloatArray | None:
        """The rotations (n_deformable, d, d) of T; None where no body turns."""
        if not self.model.elastic.turning:
            return None
        first, last = self.scheme.elastic_path(self.model, self.state, self.first)
        elastic = self.model.elastic
        return elastic.system_rotation(elastic.rotation(elastic.at(0.5 * (first + last))))

    @cached_property
    def first(self) -> FloatArray:
        """The first iterate (n_dofs,)."""
        v = np.zeros(self.model.n_dofs)
        return self.scheme.force_per_reaction * self.scheme.h * self.state.v if self.model.elastic.turning else v

    def term(self, v: FloatArray) -> FloatArray:
        """e (n_dofs,) at the iterate v (n_dofs,)."""
        elastic, scheme = self.model.elastic, self.scheme
        first, last = scheme.elastic_path(self.model, self.state, v)
        end = elastic.at(last)
        begin = self._begin if first is self.state.x else end
        force = elastic.force(begin, end, scheme.elastic_share, scheme.damping_velocity(self.state, v))
        e = scheme.elastic_weight * force
        return e if self.rotation is None else e - scheme.factors(self.model)[1] * elastic.turned_stiffness(self.rotation, v)

    def change(self, old: FloatArray, new: FloatArray, load: FloatArray) -> FloatArray:
        """Change of the term of each body (n_deformable,), relative to what is tolerated: converged where none is above 1.

        old, new (n_dofs,): the terms; load (n_dofs,): the rest of the right side.
        """
        ends = self.model.dof_offset[: len(self.model.deformable)]

        def norms(x: FloatArray) -> FloatArray:
            return np.sqrt(np.add.reduceat(np.square(x[: self.model.n_elastic]), ends)) if len(ends) else np.empty(0)

        allowed = TOLERANCE * (norms(load) + norms(old)) + self.scheme.elastic_weight * self._round_off
        return norms(new - old) / np.where(allowed > 0, allowed, 1.0)

    @cached_property
    def _round_off(self) -> FloatArray:
        return ROUND_OFF * self.model.elastic.largest_force
