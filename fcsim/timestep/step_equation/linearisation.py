"""The elastic forces of a step with turning bodies, linearised where its iterations stand.

With the elastic force F of the scheme's configuration x(v), its weight w and b for all that is linear in v, the step's equation is
R(v) = M v - b + w F(x(v)) - H r = 0. With the constant matrix S = s T K T^T, where s is the factor of K in the scheme's matrix and T turns
by the bodies' rotations in the middle of the step, the problem at the iterate v_i is

    A v = H r + b - e_i,  A = M + S,  e_i = w F(x(v_i)) - S v_i

so that A, W and all factors are the same for all iterations: only the right side changes. S differs from the derivative of w F by the
strain and by the rest of the rotation, which is the rate of convergence. Linear bodies have e_i = w K x(0) at once. Pressures and forces P
that follow the bodies are of that configuration too: w P(x(v_i)) joins b.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.forms.rotations import polar_rotation
from fcsim.assembly.kinematics.elastic_forces import Configuration
from fcsim.assembly.kinematics.following import When
from fcsim.assembly.kinematics.frames import Turned
from fcsim.assembly.model import Model
from fcsim.solvers import Memory
from fcsim.timestep.reactions.expected_motion import expected_motion
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State

TOLERANCE = 2e-11
"""Of a body's elastic term from one iteration to the next, relative to what moves the body in the step: 1e-10 let a block in free spin
gain 1.6e-8 of its energy in ten turns of 500 steps."""

ROUND_OFF = 64 * np.finfo(float).eps
"""Of stiffness times the size of a body: changes of forces below are none."""

MAX_ITERATIONS, MAX_WITH_PROXIMAL_MASS = 25, 100


@dataclass(frozen=True, eq=False)
class Linearisation:
    """The elastic term of one step of a scheme from a state.

    serving: what steps before have left, among it their motion; proximal_mass [1/s^2]: by how many deformable bodies' masses the matrix is
    larger, see `loops.proximal_mass`
    """

    scheme: Scheme
    model: Model
    state: State
    serving: Memory | None = None
    proximal_mass: float = 0.0

    @property
    def iterations(self) -> int:
        """How many there may be."""
        return MAX_WITH_PROXIMAL_MASS if self.proximal_mass else MAX_ITERATIONS

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
        R = elastic.rotation(elastic.at(last))
        if first is self.state.x:  # half way between the ends, whose frames the first term takes too
            R = polar_rotation(elastic.rotation(self._begin) + R)
        return elastic.system_rotation(R)

    @property
    def first(self) -> FloatArray:
        """The first iterate (n_dofs,): of turning bodies what brings about the motion that is expected, else none."""
        return self._first if self.model.elastic.turning else np.zeros(self.model.n_dofs)  # which is not worth keeping

    @cached_property
    def _first(self) -> FloatArray:
        scheme, v = self.scheme, self.scheme.force_per_reaction * self.scheme.h * self.state.v
        motion = expected_motion(self.serving, self.state, scheme.h)
        if motion is None or not scheme.timing.moving:
            return v
        return v + (motion - self.moved(v)) * scheme.elastic_share / scheme.elastic_reach

    def moved(self, v: FloatArray) -> FloatArray:
        """Displacements (n_dofs,) [m] over the step at the iterate v (n_dofs,)."""
        first, last = self.scheme.elastic_path(self.model, self.state, v)
        return last - first

    def term(self, v: FloatArray) -> FloatArray:
        """e (n_dofs,) at the iterate v (n_dofs,)."""
        elastic, scheme = self.model.elastic, self.scheme
        first, last = scheme.elastic_path(self.model, self.state, v)
        end = elastic.at(last)
        begin = self._begin if first is self.state.x else end
        share, velocity = scheme.elastic_share, scheme.damping_velocity(self.model, self.state, v) if elastic.beta else None
        if self.rotation is None:
            return scheme.elastic_weight * elastic.force(begin, end, share, velocity)
        less = Turned(scheme.elastic_weight, scheme.factors(self.model)[1], self.rotation, v)
        term = elastic.force(begin, end, share, velocity, less)
        return term - self.proximal_mass * self.model.apply_mass(v, 0.0 * self.model.rigid_mass()) if self.proximal_mass else term

    def pressed(self, v: FloatArray) -> tuple[FloatArray, When]:
        """The configuration (n_dofs,) in which loads that follow act at the iterate v (n_dofs,), and when of the step."""
        first, last = self.scheme.elastic_path(self.model, self.state, v)
        return first + self.scheme.elastic_share * (last - first), self.scheme.when(self.state)

    def push(self, v: FloatArray) -> FloatArray | float:
        """w P (n_dofs,) of the loads that follow deformable bodies, at the iterate v (n_dofs,); 0 where there are none."""
        following = self.model.following
        return self.scheme.elastic_weight * following.force(*self.pressed(v)) if following else 0.0

    def less_pressures(self, v: FloatArray, blocks: tuple[FloatArray, ...]) -> tuple[FloatArray, ...]:
        """The blocks (nb, nblocks, d, d) of each group of nonlinear bodies less the symmetric part of w dP/dv, see `beside`."""
        model, scheme = self.model, self.scheme
        if not model.following or self.held_by_mass:
            return blocks
        weight = scheme.elastic_weight * scheme.elastic_reach
        return tuple(model.following.with_blocks(*self.pressed(v), model.nonlinear.groups, blocks, weight))

    def beside(self, v: FloatArray) -> sp.csr_array | None:
        """Less what of dP/dv (n_dofs, n_dofs) is not in the blocks, in statics.

        Where mass may be all that holds a body that is the whole of it: dP/dv maps translations to zero, but its transpose does not, so
        that the blocks with its symmetric part would lose the definiteness of so little."""
        if self.scheme.timing.moving or not self.model.following:
            return None
        rest = -self.model.following.apart(*self.pressed(v), whole=self.held_by_mass)
        return rest if rest.nnz else None

    @property
    def held_by_mass(self) -> bool:
        """Whether statics hold bodies by their mass."""
        return not self.scheme.timing.moving and self.scheme.factors(self.model)[0] > 0

    def allowed(self, *forces: FloatArray | float) -> FloatArray:
        """What each body's term (n_deformable,) may change once it is settled; forces: what moves the body, each (n_dofs,) or 0."""
        round_off = self.scheme.elastic_weight * ROUND_OFF * self.model.elastic.largest_force
        size = sum(self.norms(force) for force in forces if isinstance(force, np.ndarray))
        allowed: FloatArray = TOLERANCE * size + round_off
        return np.where(allowed > 0, allowed, 1.0)

    def norms(self, x: FloatArray) -> FloatArray:
        """Euclidean norms (n_deformable,) of the bodies' shares of x (n_dofs,)."""
        ends = self.model.dof_offset[: len(self.model.deformable)]
        return np.sqrt(np.add.reduceat(np.square(x[: self.model.n_elastic]), ends)) if len(ends) else np.empty(0)

    def of_dofs(self, of_bodies: FloatArray) -> FloatArray:
        """Values (n_dofs,) from the deformable bodies' (n_deformable,); 1 for rigid ones."""
        sizes = np.diff(self.model.dof_offset[: len(of_bodies) + 1])
        return np.concatenate([np.repeat(of_bodies, sizes), np.ones(self.model.n_dofs - self.model.n_elastic)])


def joined_nodes(nodes: IntArray, scheme: Scheme, model: Model) -> IntArray:
    """Numbers of the `nodes`, and of those that `Linearisation.beside` joins."""
    if scheme.timing.moving or not model.following:
        return nodes
    return np.union1d(nodes, model.following.nodes(whole=scheme.factors(model)[0] > 0))
