"""Quasi-statics by load steps: (K + eta/h^2 M) dx = H r + F(t + h) - K x, with 0 <= g + dx_N ⊥ r_N >= 0.

The unknowns "v" of the problem are displacement increments [m], r are forces [N]. With eta = 0 every deformable body needs supports
that exclude rigid motion; eta > 0 regularises floating bodies with their own mass, and its influence on results is the user's to check.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from fcsim.arrays import FloatArray, is_number
from fcsim.assembly.floating import floating, proposed_eta
from fcsim.assembly.kinematics.following import When
from fcsim.assembly.model import Model
from fcsim.brief import shown
from fcsim.contact_law.coulomb import Gap, Velocity
from fcsim.contact_law.law import Law, Timing
from fcsim.contact_law.rolling import contains
from fcsim.errors import InputError
from fcsim.mesh.part import Kinematics
from fcsim.timestep.energy import Acting, Energy, WithinStep, balance, contact_work, inner_work, pushing
from fcsim.timestep.scheme import positive, refuse_law
from fcsim.timestep.state import State


@dataclass(frozen=True)
class QuasiStatic:
    """Quasi-statics by load steps: (K + eta/h^2 M) dx = H r + F(t + h) - K x; r are forces [N], dx increments [m].

    h [s] the step of the load's time; eta >= 0 the mass regularisation (dimensionless), which a run says where it carries a body;
    law: see `fcsim.contact_law`. InputError: h or eta out of range, the law Velocity.
    """

    h: float
    eta: float = 0.0
    law: Law = field(default_factory=Gap)

    def __post_init__(self) -> None:
        positive("h", self.h)
        if not (is_number(self.eta) and self.eta >= 0):
            raise InputError(f"eta: expected a number >= 0, got {shown(self.eta)}")
        refuse_law(self.law)
        if contains(self.law, Velocity):
            raise InputError(
                "QuasiStatic, law: expected a law that closes gaps, as Gap(), got Velocity, the law of impacts: statics have no velocity, "
                "and what comes to touch within a load step would stay as deep in the other body as the step takes it"
            )

    @property
    def force_per_reaction(self) -> float:
        return 1.0

    @property
    def notes(self) -> tuple[str, ...]:
        if not self.eta:
            return ("statics without regularisation (eta = 0)",)
        return (f"statics regularised by the mass: eta = {self.eta:g}, K + {self.eta / self.h**2:.6g} M",)

    @property
    def timing(self) -> Timing:
        return Timing(self.h, 1.0, 1.0, 1.0, moving=False)

    def cut(self, parts: int) -> QuasiStatic:
        """A shorter load step with the same regularisation eta/h^2."""
        return replace(self, h=self.h / parts, eta=self.eta / parts**2)

    def factors(self, model: Model) -> tuple[float, float]:
        return self.eta / self.h**2, 1.0

    def refuse(self, model: Model) -> None:
        """With eta = 0, a body with a rigid motion left: its stiffness is singular."""
        if self.eta:
            return
        for number in floating(model):
            eta = proposed_eta(model, number, self.h)
            raise InputError(
                f"body {model.bodies[number].name!r}: statics with eta = 0 expect supports that exclude rigid motion; it is free to move. "
                f"Add supports, or choose eta > 0 (mass regularisation){'' if eta is None else f', of about {eta:.0e}'}"
            )

    def detection_configuration(self, model: Model, state: State) -> FloatArray:
        return state.x

    def working_configuration(self, model: Model, before: State, after: State) -> FloatArray | None:
        return after.x

    def way(self, model: Model, state: State) -> FloatArray | None:
        return None

    @property
    def kinematics(self) -> Kinematics | None:
        return "linear"

    @property
    def elastic_weight(self) -> float:
        return 1.0

    @property
    def elastic_share(self) -> float:
        return 1.0

    @property
    def elastic_reach(self) -> float:
        return 1.0

    @property
    def damping_reach(self) -> float:
        return 0.0

    @property
    def elastic_time(self) -> float:
        return self.h

    def elastic_path(self, model: Model, state: State, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Equilibrium is at the end of the step: both ends are there."""
        end = state.x + v
        return end, end

    def when(self, state: State) -> When:
        return When.at(state.t + self.h)

    def damping_velocity(self, model: Model, state: State, v: FloatArray) -> None:
        return None

    def velocity_before(self, model: Model, state: State) -> FloatArray:
        return state.v

    def right_hand_side(self, model: Model, state: State) -> FloatArray:
        return model.load(state.t + self.h, state.x)

    def rigid_mass(self, model: Model, state: State, load: FloatArray) -> FloatArray:
        return model.rigid_mass(state.x)

    def driven(self, model: Model, state: State) -> FloatArray:
        """Displacement increments of the driven dofs: the velocity at the middle of the step times h (exact for linear ramps); of driven
        rotations the difference of places, exact."""
        return model.held.increment(state.t, self.h)

    def advance(self, model: Model, state: State, v: FloatArray, impulse: FloatArray, rigid_mass: FloatArray) -> State:
        return State(state.t + self.h, model.held.placed(model.advance(state.x, v), state.t + self.h), v / self.h)

    def support_impulse(self, model: Model, residual: FloatArray, impulse: FloatArray, v: FloatArray, rigid_mass: FloatArray) -> FloatArray:
        """The residual less eta/h^2 M dx at driven dofs: the mass that regularises is no body's weight that supports would have to move."""
        return residual - model.driven_share(self._regularising(model, v, rigid_mass)) if self.eta else residual

    def _regularising(self, model: Model, dx: FloatArray, rigid_mass: FloatArray) -> FloatArray:
        """(n_dofs,) eta/h^2 M dx [N], of all dofs."""
        return self.eta / self.h**2 * model.apply_mass(dx, rigid_mass)

    def energy(self, model: Model, before: State, after: State, acting: Acting, support: FloatArray) -> Energy:
        """The step's equation times dx, exact for every load step:

        d(x.K x / 2) = dx.F+ + dx.s + dx.H r - dx.K dx / 2 - eta/h^2 dx_f.M dx (turning bodies: dx.F_int+ - dE in place of dx.K dx / 2)

        with s the supports' forces and dx_f the free part of dx. The last two terms are the scheme's dissipation: that of the implicit
        Euler rule, which vanishes with the size of the load steps, and that of the regularisation.
        """
        dx = self.h * after.v
        first, last = model.elastic.at(before.x), model.elastic.at(after.x)
        energies, loss = model.elastic.energies(first, last)
        gain = energies[1] - energies[0]
        euler = float(dx @ model.elastic.force(last, last, 1.0)) - gain if model.elastic.turning else 0.5 * loss
        regularisation = 0.0
        if self.eta:
            mass = self._regularising(model, dx, model.rigid_mass(before.x))
            regularisation = float(dx @ (mass - model.driven_share(mass)))
        return balance(
            kinetic=(0.0, 0.0),
            elastic=energies,
            loads=float(dx @ (model.load(before.t + self.h, before.x) + pushing(model, after.x, self.when(before)))),
            supports=float(dx @ support),
            damping=0.0,
            numerical=euler + regularisation,
            contact=contact_work(acting, dx),
            inner=inner_work(model, before, after, dx, WithinStep(after.x, self.h, 1.0), None),
        )
