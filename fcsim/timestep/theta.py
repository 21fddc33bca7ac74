"""The theta scheme (Moreau-Jean) with the contact laws "gap" and "velocity".

(M + h theta C + h^2 theta^2 K) v+ = f + H r,
f = M v - h (1-theta) C v - h K x - h^2 theta (1-theta) K v + h (theta F+ + (1-theta) F),
x+ = x + h (theta v+ + (1-theta) v), with C = alpha M + beta K; v velocities [m/s], r impulses over the step [N s].
Sources: M. Jean, "The non-smooth contact dynamics method", Comput. Methods Appl. Mech. Eng. 177, 1999; J. J. Moreau, same volume.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fcsim.assembly.model import Model
from fcsim.contact_detection.contacts import Contacts
from fcsim.solvers import Result
from fcsim.timestep.energy import Energy, balance, contact_work
from fcsim.timestep.scheme import Gap, Velocity, law_contacts, law_velocity, positive
from fcsim.timestep.state import State

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Theta:
    """h [s] the step, 0 < theta <= 1, law: Gap() or Velocity(restitution)."""

    h: float
    theta: float = 0.5
    law: Gap | Velocity = field(default_factory=Gap)

    def __post_init__(self) -> None:
        positive("h", self.h)
        positive("theta", self.theta, 1.0)

    @property
    def force_per_reaction(self) -> float:
        return 1 / self.h

    @property
    def notes(self) -> tuple[str, ...]:
        return ()

    def cut(self, parts: int) -> Theta:
        return replace(self, h=self.h / parts)

    def refuse(self, model: Model) -> None:
        return

    def factors(self, model: Model) -> tuple[float, float]:
        h, theta = self.h, self.theta
        return 1 + h * theta * model.alpha, h * theta * model.beta + (h * theta) ** 2

    def detection_configuration(self, model: Model, state: State) -> FloatArray:
        """The mid configuration x_m = x + h (1 - theta) v."""
        return model.advance(state.x, self.h * (1 - self.theta) * state.v)

    def select(self, contacts: Contacts) -> Contacts:
        return law_contacts(self.law, contacts)

    def right_hand_side(self, model: Model, state: State) -> FloatArray:
        h, theta, v = self.h, self.theta, state.v
        inertia = model.apply_mass((1 - h * (1 - theta) * model.alpha) * v)
        elastic = model.apply_stiffness(h * state.x + (h * (1 - theta) * model.beta + h**2 * theta * (1 - theta)) * v)
        return inertia - elastic + h * self._force(model, state)

    def _force(self, model: Model, state: State) -> FloatArray:
        """theta F+ + (1-theta) F (n_dofs,) [N]; followers stand as at t + theta h, to first order."""
        h, theta = self.h, self.theta
        x = model.advance(state.x, h * theta * state.v)
        return theta * model.load(state.t + h, x) + (1 - theta) * model.load(state.t, x)

    def contact_velocity(self, state: State, contacts: Contacts, H: Any) -> FloatArray:
        return law_velocity(self.law, self.h, self.theta, state, contacts, H)

    def driven(self, model: Model, state: State) -> FloatArray:
        return model.driven_velocity(state.t + self.h)

    def advance(self, model: Model, state: State, v: FloatArray, impulse: FloatArray) -> State:
        h, theta = self.h, self.theta
        return State(state.t + h, model.advance(state.x, h * (theta * v + (1 - theta) * state.v)), v)

    def support_impulse(self, model: Model, residual: FloatArray, impulse: FloatArray) -> FloatArray:
        return residual

    def energy(self, model: Model, before: State, after: State, H: Any, result: Result, support: FloatArray) -> Energy:
        """The step's equation times v_theta = theta v+ + (1-theta) v, exact with dx = h v_theta for every h and theta:

        d(v.M v / 2 + x.K x / 2) = dx.F_theta + v_theta.s + v_theta.H r - h v_theta.C v_theta - (theta - 1/2) (dv.M dv + dx.K dx)

        with d the change over the step, F_theta = theta F+ + (1-theta) F and s the supports' impulses. The last term is the scheme's
        dissipation: none at theta = 1/2, never negative above (V. Acary, "Energy conservation and dissipation properties of
        time-integration methods for nonsmooth elastodynamics with contact", ZAMM 96, 2016). For the work of impacts see `Velocity`.
        """
        h, theta = self.h, self.theta
        v, dv = theta * after.v + (1 - theta) * before.v, after.v - before.v
        M0, M1 = model.apply_mass(before.v), model.apply_mass(after.v)
        K0, K1 = model.apply_stiffness(before.x), model.apply_stiffness(after.x)
        return balance(
            kinetic=(0.5 * float(before.v @ M0), 0.5 * float(after.v @ M1)),
            elastic=(0.5 * float(before.x @ K0), 0.5 * float(after.x @ K1)),
            loads=h * float(v @ self._force(model, before)),
            supports=float(v @ support),
            damping=h * model.alpha * float(v @ (theta * M1 + (1 - theta) * M0)) + model.beta * float(v @ (K1 - K0)),
            numerical=(theta - 0.5) * (float(dv @ (M1 - M0)) + h * float(v @ (K1 - K0))),
            contact=contact_work(H, result.r, result.u, v, model.dimension),
        )
