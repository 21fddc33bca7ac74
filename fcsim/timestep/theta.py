"""The theta scheme (Moreau-Jean) with the contact laws "gap" and "velocity".

(M + h theta C + h^2 theta^2 K) v+ = f + H r,
f = M v - h (1-theta) C v - h K x - h^2 theta (1-theta) K v + h (theta F+ + (1-theta) F) with linear bodies, see `linearisation` for turning
ones; x+ = x + h (theta v+ + (1-theta) v), with C = alpha M + beta K; v velocities [m/s], r impulses over the step [N s].

Rigid rotations: R_m = exp(h (1-theta) omega) R is the middle configuration, in which contacts are detected and struck; R+ =
exp(h theta omega+) R_m. The unknown is the velocity in the middle, M on the left side that of R_m, the momentum M v on the right that of
R, so that the gyroscopic term omega x J omega needs no formula: the change of angular momentum is exactly the moment of the impulses.
The state keeps the angular momentum: omega+ = J(R+)^-1 L+, implicitly, since R+ depends on omega+. Velocities before an impact are
those in the middle too, J(R_m)^-1 L: an elastic impact then changes no energy, however much it changes the rotation; with J of another
configuration it would by O(h). Without contacts second order at theta = 1/2, and symmetric in time, so that the energy only oscillates
by O(h^2); an explicit gyroscopic term would be of first order and make energy.
Sources: M. Jean, "The non-smooth contact dynamics method", Comput. Methods Appl. Mech. Eng. 177, 1999; J. J. Moreau, same volume.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, field
from functools import cache, partial

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.kinematics.elastic_forces import energies_of
from fcsim.assembly.loads import Follower
from fcsim.assembly.model import Model
from fcsim.assembly.whole.vectors import advanced, sum_by_ranks
from fcsim.contact_law.coulomb import Gap
from fcsim.contact_law.law import Law, Timing
from fcsim.linear.sparse._vectors_kernels import weighted_sum
from fcsim.timestep.energy import (
    Acting,
    ContactWork,
    Energy,
    InnerWork,
    WithinStep,
    balance,
    contact_work,
    inner_force,
    inner_work,
    momentum,
    of_ranks,
    pushing,
)
from fcsim.timestep.scheme import Dynamic, load_at, positive, refuse_law
from fcsim.timestep.state import State
from fcsim.timestep.step_equation.end_velocity import end_velocity


@dataclass(frozen=True)
class Theta(Dynamic):
    """The scheme of Moreau and Jean for dynamics: x+ = x + h (theta v+ + (1 - theta) v), impulses r over the step [N s].

    h [s] the step; 0 < theta <= 1: 1/2 keeps energy, more damps what swings within a step; law: see `fcsim.contact_law`.
    Equations and sources: this module's head. InputError: h or theta out of range.
    """

    theta: float = 0.5
    law: Law = field(default_factory=Gap)

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("theta", self.theta, 1.0)
        refuse_law(self.law)

    @property
    def timing(self) -> Timing:
        return Timing(self.h, self.theta, self.h, 1 / self.h)

    def factors(self, model: Model) -> tuple[float, float]:
        h, theta = self.h, self.theta
        return 1 + h * theta * model.alpha, h * theta * model.beta + (h * theta) ** 2

    def detection_configuration(self, model: Model, state: State) -> FloatArray:
        """The mid configuration x_m = x + h (1 - theta) v."""
        dt = self.h * (1 - self.theta)
        return state.kept(("advanced", dt), model, lambda: advanced(model, state.x, dt, state.v))

    def working_configuration(self, model: Model, before: State, after: State) -> FloatArray | None:
        """x_m of rigid bodies; of deformable ones x + (1-theta) (x+ - x), at theta = 1/2 the mean, about which their own forces have no
        moment.

        The sums over the nodes of x+ cross M v+ less x cross M v and of x_w cross M (v+ - v) are the same for both. Where inner forces have
        another mean than those of links, what the two make of each other is left, (1-theta) theta h sum_i (M^-1 h F)_i cross (G l)_i.
        """
        if not model.n_elastic:
            return None
        x = self.detection_configuration(model, before).copy()
        x[: model.n_elastic] = ((1 - self.theta) * after.x + self.theta * before.x)[: model.n_elastic]
        return x

    @property
    def elastic_weight(self) -> float:
        return self.h

    @property
    def elastic_share(self) -> float:
        return self.theta

    @property
    def elastic_reach(self) -> float:
        return self.h * self.theta**2

    @property
    def damping_reach(self) -> float:
        return self.theta

    @property
    def elastic_time(self) -> float:
        return self.h * self.theta

    def elastic_path(self, model: Model, state: State, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        return state.x, weighted_sum(1.0, state.x, self.h, self.damping_velocity(model, state, v))

    def damping_velocity(self, model: Model, state: State, v: FloatArray) -> FloatArray:
        mean = weighted_sum(self.theta, v, 1 - self.theta, state.v)
        return mean if not model.held.turns else mean + self._drift(model, state) / self.h

    def _drift(self, model: Model, state: State) -> FloatArray:
        """c (n_dofs,) in x+ = x + h (theta v+ + (1-theta) v) + c: by so much nodes on circles leave what their velocities give."""
        driven = self.theta * model.of_driven(self.driven(model, state)) + (1 - self.theta) * state.v
        end = state.x + self.h * driven
        return model.held.placed(end, state.t + self.h) - end

    def right_hand_side(self, model: Model, state: State) -> FloatArray:
        h, undamped = self.h, 1 - self.h * (1 - self.theta) * model.alpha
        if undamped == 1:
            return sum_by_ranks(1.0, momentum(model, state), h, self._force(model, state))
        return model.apply_mass(undamped * state.v, model.rigid_mass(state.x)) + h * self._force(model, state)

    def _force(self, model: Model, state: State) -> FloatArray:
        """theta F+ + (1-theta) F (n_dofs,) [N]; followers stand as at t + theta h, to first order."""
        h, theta = self.h, self.theta

        def made() -> FloatArray:
            if not any(isinstance(load, Follower) for load in model.loads):
                force = sum_by_ranks(theta, load_at(model, state, h), 1 - theta, model.load(state.t))
                state.let_go(("load", h))
                return force
            x = model.advance(state.x, h * theta * state.v)
            return theta * model.load(state.t + h, x) + (1 - theta) * model.load(state.t, x)

        return state.kept(("force", h, theta), model, made)

    def advance(self, model: Model, state: State, v: FloatArray, impulse: FloatArray, rigid_mass: FloatArray) -> State:
        middle = self.detection_configuration(model, state)
        end = end_velocity(model, middle, v, rigid_mass, self.h * self.theta)
        x = model.held.placed(advanced(model, middle, self.h * self.theta, end), state.t + self.h)
        return State(state.t + self.h, x, model.keep_momentum(v, rigid_mass, x))

    def support_impulse(self, model: Model, residual: FloatArray, impulse: FloatArray, v: FloatArray, rigid_mass: FloatArray) -> FloatArray:
        return residual

    def energy(self, model: Model, before: State, after: State, acting: Acting, support: FloatArray) -> Energy:
        """The step's equation times v_theta = theta v+ + (1-theta) v of the middle, exact with dx = h v_theta for every h and theta:

        d(v.M v / 2 + y.K y / 2) = dx.F_theta + v_theta.s + v_theta.H r - h v_theta.C v_theta - (theta - 1/2) (dv.d(M v) + dy.K dy) - G

        with d the change over the step, y the displacement without the turning bodies' rotation (see `frames`),
        F_theta = theta F+ + (1-theta) F with pressures that follow as at x + theta dx, s the supports' impulses. The last are the scheme's
        dissipation: none at theta = 1/2, never negative above (V. Acary, "Energy conservation and dissipation properties of
        time-integration methods for nonsmooth elastodynamics with contact", ZAMM 96, 2016), but for G, what turning between the middle and
        the ends changes in the energy of a given angular momentum: of second order, and swinging. For the work of impacts see `Velocity`.
        Driven rotations place nodes on circles, dx = h v_theta + c (see `_drift`): c times the forces of strain there is work of supports.
        """
        h, theta, elastic = self.h, self.theta, model.elastic
        first, last = elastic.at(before.x), elastic.at(after.x)

        @cache
        def velocities() -> tuple[FloatArray, FloatArray, FloatArray]:
            middle = self.detection_configuration(model, before)
            v0 = self.velocity_before(model, before)
            v1 = model.keep_momentum(after.v, model.rigid_mass(after.x), middle)
            return v0, v1, weighted_sum(theta, v1, 1 - theta, v0)

        def of_motion() -> FloatArray:
            v0, v1, v = velocities()
            M0, M1 = momentum(model, before), momentum(model, after)
            load = self._force(model, before)
            if model.following:
                load = load + pushing(model, before.x + theta * (after.x - before.x), self.when(before))
            turned = [0.0 if x is y else (x - y) @ M for x, y, M in ((before.v, v0, M0), (after.v, v1, M1))]
            works = v @ load, v @ weighted_sum(theta, M1, 1 - theta, M0), (v1 - v0) @ (M1 - M0), *turned, v @ support, (v1 - v0) @ load
            return np.array([before.v @ M0, after.v @ M1, *works])

        def of_contact() -> FloatArray:
            v0, v1, v = velocities()
            return np.array(astuple(contact_work(acting, v, v1 - v0 if theta != 0.5 else None)))

        terms = (1, partial(elastic.of_first, first)), (2, partial(elastic.of_change, first, last)), (9, of_motion), (4, of_contact)
        start, strain, motion, contact = of_ranks(model, terms)
        (energy0, energy1), loss = energies_of(start, strain)
        kinetic0, kinetic1, loads, damped, change, turned0, turned1, supports, jerked = motion.tolist()
        work_inside = InnerWork()
        if model.nonlinear or model.held.turns:
            dx, mean = after.x - before.x, theta * after.v + (1 - theta) * before.v
            inner = WithinStep(before.x + theta * dx, self.elastic_time, theta)
            if model.held.turns:
                drift = model.driven_share(dx - h * mean)
                mean = mean + drift / h
                supports += float(drift @ (elastic.force(first, last, theta, mean) + inner_force(model, before, inner, mean)))
            work_inside = inner_work(model, before, after, dx, inner, mean)
        return balance(
            kinetic=(0.5 * kinetic0, 0.5 * kinetic1),
            elastic=(energy0, energy1),
            loads=h * loads,
            supports=supports,
            damping=h * model.alpha * damped + model.beta / h * loss,
            numerical=(theta - 0.5) * (change + loss) + 0.5 * (turned0 - turned1),
            contact=ContactWork(*contact.tolist()),
            jumps=(theta - 0.5, h * jerked),
            inner=work_inside,
        )
