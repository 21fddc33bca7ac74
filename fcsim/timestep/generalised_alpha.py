"""The nonsmooth generalised-alpha scheme: second order with high frequencies damped as far as wished, impacts by velocity jumps.

Smooth motion, the generalised-alpha scheme of first-order form with the rates x', v' (K. E. Jansen, C. H. Whiting, G. M. Hulbert, Comput.
Methods Appl. Mech. Eng. 190, 2000; for structures C. Kadapa, W. G. Dettmer, D. Perić, Comput. Struct. 193, 2017). Its parameters follow
from the spectral radius rho at infinite frequency, as J. Chung and G. M. Hulbert (J. Appl. Mech. 60, 1993) introduced it:

    alpha_m = (3 - rho) / (2 (1 + rho)),  alpha_f = 1 / (1 + rho),  gamma = 1/2 + alpha_m - alpha_f
    M v'_m + C v_f + K x_f = F_f,  x'_m = v_f,  with ( )_m = alpha_m ( )+ + (1 - alpha_m) ( ), ( )_f likewise
    x+ = x + h [(1 - gamma) x' + gamma x'+],  v+ = v + h [(1 - gamma) v' + gamma v'+] + jump,  M jump = H r

Contact as in the nonsmooth generalised-alpha schemes of Q.-Z. Chen, V. Acary, G. Virlez, O. Brüls (Int. J. Numer. Methods Eng. 96, 2013)
and V. Acary (ZAMM 96, 2016): reactions are impulses r, fully implicit, in a velocity jump apart from the smooth acceleration, so that an
impact leaves no trace in v'. Positions follow from velocities alone (x'_m = v_f), so that a contact that lasts does not drift.
Eliminated for v+, with kappa = h gamma / alpha_m and c = h gamma alpha_f / alpha_m, x+ = X + c v+:

    (M + kappa alpha_f C + kappa alpha_f c K) v+ = f + H r
    f = M v + h (alpha_f - 1/2) / alpha_m p - kappa [(1 - alpha_f) C v + K (alpha_f X + (1 - alpha_f) x)] + kappa F_f

p = M v' [N], for rigid rotations the rate (M v)', is kept in the state and not v', so that no mass matrix is inverted and the gyroscopic
term needs no formula (see theta.py). rho = 1 is Newmark's average acceleration (beta = 1/4,
gamma = 1/2), with contact the theta scheme of theta = 1/2. Smooth motion converges with order 2, impacts, as impulses, with order 1.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fcsim.arrays import FloatArray, is_number
from fcsim.assembly.kinematics.following import When
from fcsim.assembly.model import Model
from fcsim.brief import shown
from fcsim.contact_law.coulomb import Gap
from fcsim.contact_law.law import Law, Timing
from fcsim.errors import InputError
from fcsim.timestep.energy import Acting, Energy, WithinStep, balance, contact_work, inner_force, inner_work, momentum, pushing, turning
from fcsim.timestep.scheme import Dynamic, refuse_law
from fcsim.timestep.state import State
from fcsim.timestep.step_equation.end_velocity import end_velocity


@dataclass(frozen=True)
class GeneralisedAlpha(Dynamic):
    """The nonsmooth generalised-alpha scheme for dynamics: second order, high frequencies damped as far as wished.

    h [s] the step; 0 <= rho <= 1 the spectral radius at infinite frequency: 1 damps nothing, 0 most; law: see `fcsim.contact_law`.
    Equations and sources: this module's head. InputError: h or rho out of range.
    """

    rho: float = 0.8
    law: Law = field(default_factory=Gap)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (is_number(self.rho) and 0 <= self.rho <= 1):
            raise InputError(f"rho: expected a spectral radius between 0 and 1, got {shown(self.rho)}")
        refuse_law(self.law)

    @property
    def alpha_m(self) -> float:
        return 0.5 * (3 - self.rho) / (1 + self.rho)

    @property
    def alpha_f(self) -> float:
        return 1 / (1 + self.rho)

    @property
    def gamma(self) -> float:
        return 0.5 + self.alpha_m - self.alpha_f

    @property
    def kappa(self) -> float:
        return self.h * self.gamma / self.alpha_m

    @property
    def timing(self) -> Timing:
        return Timing(self.h, 0.5, self.h, 1 / self.h)

    def factors(self, model: Model) -> tuple[float, float]:
        implicit = self.kappa * self.alpha_f
        return 1 + implicit * model.alpha, implicit * (model.beta + self.kappa * self.alpha_f)

    def detection_configuration(self, model: Model, state: State) -> FloatArray:
        """x_m = x + h (1 - alpha_f) v + h (alpha_f - 1/2) x': the next one is x_m + h v+ exactly, as with the theta scheme."""
        rate, _ = self._memory(model, state)
        return model.advance(state.x, self.h * ((1 - self.alpha_f) * state.v + (self.alpha_f - 0.5) * rate))

    @property
    def elastic_weight(self) -> float:
        return self.kappa

    @property
    def elastic_share(self) -> float:
        return 1.0

    @property
    def elastic_reach(self) -> float:
        return self.kappa * self.alpha_f**2

    @property
    def damping_reach(self) -> float:
        return self.alpha_f

    @property
    def elastic_time(self) -> float:
        return self.h * self.alpha_f

    def elastic_path(self, model: Model, state: State, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Forces act as they are at x_f: both ends are there."""
        change = self._explicit(model, state) + self.kappa * self.alpha_f * v  # x+ = X + c v+
        middle = state.x + self.alpha_f * (change if not model.held.turns else change + self._drift(model, state))
        return middle, middle

    def _drift(self, model: Model, state: State) -> FloatArray:
        """What nodes on circles leave x+ = X + c v+ by (n_dofs,), see `Theta`."""
        driven = self.kappa * self.alpha_f * model.of_driven(self.driven(model, state))
        end = state.x + self._explicit(model, state) + driven
        return model.held.placed(end, state.t + self.h) - end

    def damping_velocity(self, model: Model, state: State, v: FloatArray) -> FloatArray:
        return self.alpha_f * v + (1 - self.alpha_f) * state.v

    def right_hand_side(self, model: Model, state: State) -> FloatArray:
        h, kappa, alpha_f = self.h, self.kappa, self.alpha_f
        _, inertia = self._memory(model, state)
        mass = (1 - kappa * (1 - alpha_f) * model.alpha) * momentum(model, state)
        return mass + h * (alpha_f - 0.5) / self.alpha_m * inertia + kappa * self._force(model, state)

    def _explicit(self, model: Model, state: State) -> FloatArray:
        """X - x (n_dofs,) [m, rad]."""
        rate, _ = self._memory(model, state)
        return self.h * (1 - self.gamma) * rate + self.kappa * ((1 - self.alpha_f) * state.v - (1 - self.alpha_m) * rate)

    def _force(self, model: Model, state: State) -> FloatArray:
        """alpha_f F+ + (1 - alpha_f) F (n_dofs,) [N]; followers stand as at t + alpha_f h, to first order."""
        h, alpha_f = self.h, self.alpha_f
        x = model.advance(state.x, h * alpha_f * state.v)
        return alpha_f * model.load(state.t + h, x) + (1 - alpha_f) * model.load(state.t, x)

    def advance(self, model: Model, state: State, v: FloatArray, impulse: FloatArray, rigid_mass: FloatArray) -> State:
        h, gamma, alpha_f, alpha_m = self.h, self.gamma, self.alpha_f, self.alpha_m
        rate, inertia = self._memory(model, state)
        explicit = model.advance(state.x, self._explicit(model, state))
        end = end_velocity(model, explicit, v, rigid_mass, self.kappa * alpha_f)
        next_rate = (alpha_f * end + (1 - alpha_f) * state.v - (1 - alpha_m) * rate) / alpha_m
        jump = impulse - model.driven_share(impulse)  # M jump; a driven dof does not jump, its support takes the impulse
        change = model.apply_mass(v, rigid_mass) - momentum(model, state)
        next_inertia = (change - jump) / (h * gamma) - (1 - gamma) / gamma * inertia
        x = model.held.placed(model.advance(explicit, self.kappa * alpha_f * end), state.t + h)
        return State(state.t + h, x, model.keep_momentum(v, rigid_mass, x), next_rate, next_inertia)

    def support_impulse(self, model: Model, residual: FloatArray, impulse: FloatArray, v: FloatArray, rigid_mass: FloatArray) -> FloatArray:
        """h R + what contacts give to driven dofs, from the residual kappa R + the same: in the step's equation R counts kappa."""
        struck = -model.driven_share(impulse)
        return struck + self.h / self.kappa * (residual - struck)

    def energy(self, model: Model, before: State, after: State, acting: Acting, support: FloatArray) -> Energy:
        """The equation of smooth motion times dx, and M dv = h p_gamma + H r times the mean velocity V = (v + v+) / 2; exact:

        d(v.M v / 2 + y.K y / 2) = dx.F_f + dx.R + V.(H r - what the supports take of it) - dx.C v_f - D
        D = (alpha_f - 1/2) dx.K dx (turning bodies: dx.F_int(x_f) - dE) + dx.p_m - h V.p_gamma + G, with G of `turning`

        with d the change over the step, R the supports' forces, p = M v'; v in V as where contacts are detected, G also what turning
        between there and the ends changes in the energy of a given angular momentum. D is zero for rho = 1 but for G. In single steps it
        may be negative, since the scheme's own energy, which never grows without loads, differs from this one by terms of order h^2.
        """
        h, alpha_f, alpha_m, gamma = self.h, self.alpha_f, self.alpha_m, self.gamma
        rate0, p0 = self._memory(model, before)
        rate1, p1 = self._memory(model, after)
        dx = h * ((1 - gamma) * rate0 + gamma * rate1)
        v0 = self.velocity_before(model, before)
        v1 = model.keep_momentum(after.v, model.rigid_mass(after.x), self.detection_configuration(model, before))
        mean = 0.5 * (v0 + v1)
        elastic = model.elastic
        first, last = elastic.at(before.x), elastic.at(after.x)
        middle = elastic.at(before.x + alpha_f * (after.x - before.x))
        energies, loss = elastic.energies(first, last)
        inner = WithinStep(middle.x, self.elastic_time, alpha_f)
        velocity, drift, strain_work = alpha_f * after.v + (1 - alpha_f) * before.v, np.zeros_like(dx), 0.0
        if model.held.turns:  # what driven rotations leave dx by, see `Theta.energy`
            drift = model.driven_share(after.x - before.x - dx)
            strain = elastic.force(middle, middle, 1.0) + inner_force(model, before, inner, velocity)
            strain_work = float(drift @ strain)
        if elastic.turning:
            elastic_loss = float((dx + drift) @ elastic.force(middle, middle, 1.0)) - (energies[1] - energies[0])
        else:
            elastic_loss = (alpha_f - 0.5) * loss
        M0, M1 = momentum(model, before), momentum(model, after)
        damping = model.alpha * (alpha_f * M1 + (1 - alpha_f) * M0)
        viscous = 0.0
        if model.beta:
            viscous = float(dx @ (elastic.force(middle, middle, 1.0, velocity) - elastic.force(middle, middle, 1.0)))
        struck = -model.driven_share(acting.H @ acting.r)
        return balance(
            kinetic=(0.5 * float(before.v @ M0), 0.5 * float(after.v @ M1)),
            elastic=energies,
            loads=float(dx @ (self._force(model, before) + pushing(model, middle.x, self.when(before)))),
            supports=float(dx @ (support - struck)) / h + float(mean @ struck) + strain_work,
            damping=float(dx @ damping) + viscous,
            numerical=elastic_loss
            + float(dx @ (alpha_m * p1 + (1 - alpha_m) * p0))
            - h * float(mean @ (gamma * p1 + (1 - gamma) * p0))
            + turning(model, v0, M0, v1, M1)
            + 0.5 * (float((before.v - v0) @ M0) - float((after.v - v1) @ M1)),
            contact=contact_work(acting, mean),
            inner=inner_work(model, before, after, dx + drift, inner, velocity),
        )

    @staticmethod
    def _memory(model: Model, state: State) -> tuple[FloatArray, FloatArray]:
        """x' and p = M v' of a state; of one that another scheme or a user made, x' = v and p by the equation of smooth motion."""
        if state.rate is not None and state.inertia is not None:
            return state.rate, state.inertia
        now = model.elastic.at(state.x)
        inertia = model.load(state.t, state.x) - model.alpha * momentum(model, state) - model.elastic.force(now, now, 1.0, state.v)
        inertia += pushing(model, state.x, When.at(state.t))
        if model.nonlinear:
            inertia -= model.nonlinear.inner(state.x, state.internal, state.t, 0.0, v=state.v).force
        return state.v, inertia - model.driven_share(inertia)
