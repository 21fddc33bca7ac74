"""What a time-stepping scheme gives to the simulation."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np

from fcsim.arrays import FloatArray, is_number
from fcsim.assembly.kinematics.following import When
from fcsim.assembly.model import Model
from fcsim.brief import shown
from fcsim.contact_detection import Detection
from fcsim.contact_law.law import Law, Timing
from fcsim.contact_law.proportions import Proportions
from fcsim.errors import InputError
from fcsim.mesh.part import Kinematics
from fcsim.ranks import elementwise
from fcsim.timestep.energy import Acting, Energy
from fcsim.timestep.pushed import pushed
from fcsim.timestep.state import State


class Scheme(Protocol):
    """One step is M v = H r + f with M = mass_factor M + stiffness_factor K; see the schemes' own files."""

    @property
    def h(self) -> float:
        """Length of a step [s]."""
        ...

    @property
    def force_per_reaction(self) -> float:
        """Force [N] of a unit reaction: 1/h for impulses, 1 for forces."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """What the summary of a run says of the scheme."""
        ...

    @property
    def law(self) -> Law:
        """The contact law."""
        ...

    @property
    def timing(self) -> Timing:
        """What the unknown u means for a gap over a step."""
        ...

    def cut(self, parts: int) -> Scheme:
        """Return the scheme of a `parts`-th of the step."""
        ...

    def refuse(self, model: Model) -> None:
        """Raise InputError for a model that the scheme cannot move."""
        ...

    def factors(self, model: Model) -> tuple[float, float]:
        """Return (mass_factor, stiffness_factor)."""
        ...

    def detection_configuration(self, model: Model, state: State) -> FloatArray:
        """Return the configuration x (n_dofs,) in which contacts are detected."""
        ...

    def working_configuration(self, model: Model, before: State, after: State) -> FloatArray | None:
        """Return the configuration x (n_dofs,) about which a step from `before` to `after` adds up moments: forces that have none there
        leave the moment of momentum as it is. None: that of detection, or there is no such configuration."""
        ...

    def way(self, model: Model, state: State) -> FloatArray | None:
        """Return the increment (n_dofs,) of that configuration over the step if nothing changed the velocities, or loads alone where they
        take bodies far (`pushed`), which detection looks along; None where there is no such thing."""
        ...

    @property
    def kinematics(self) -> Kinematics | None:
        """Of deformable bodies where neither they nor the model name theirs; None: as their supports allow."""
        ...

    @property
    def elastic_weight(self) -> float:
        """Factor of the elastic forces in the step's equation: a time [s], or 1 in statics."""
        ...

    @property
    def elastic_share(self) -> float:
        """Share of the later end of `elastic_path` in the strain whose forces act."""
        ...

    def elastic_path(self, model: Model, state: State, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the configurations between which the elastic forces act if the unknowns are v (n_dofs,); of deformable bodies only."""
        ...

    @property
    def elastic_reach(self) -> float:
        """Change of the configuration whose inner forces act, elastic_share of the way along `elastic_path`, for a unit change of the
        unknowns."""
        ...

    @property
    def damping_reach(self) -> float:
        """Change of `damping_velocity` for a unit change of the unknowns."""
        ...

    @property
    def elastic_time(self) -> float:
        """Time [s] from the beginning of the step to that configuration."""
        ...

    def when(self, state: State) -> When:
        """Return when of the step from `state` the pressures act that follow deformable bodies."""
        ...

    def damping_velocity(self, model: Model, state: State, v: FloatArray) -> FloatArray | None:
        """Return the velocity (n_dofs,) [m/s] that is damped if the unknowns are v; None where nothing is."""
        ...

    def velocity_before(self, model: Model, state: State) -> FloatArray:
        """Return the velocity (n_dofs,) before the step as the contacts meet it: the state's, but for what turns rigid bodies' inertia."""
        ...

    def right_hand_side(self, model: Model, state: State) -> FloatArray:
        """Return f (n_dofs,) without the elastic forces."""
        ...

    def driven(self, model: Model, state: State) -> FloatArray:
        """Return the unknowns' values at the driven dofs."""
        ...

    def rigid_mass(self, model: Model, state: State, load: FloatArray) -> FloatArray:
        """Return the rigid bodies' mass matrices (nr, k, k) in the step's M; load: the step's right-hand side."""
        ...

    def advance(self, model: Model, state: State, v: FloatArray, impulse: FloatArray, rigid_mass: FloatArray) -> State:
        """Return the state at the end of the step from the solution v (n_dofs,), the contacts' impulses H r (n_dofs,) and the step's
        `rigid_mass`."""
        ...

    def support_impulse(self, model: Model, residual: FloatArray, impulse: FloatArray, v: FloatArray, rigid_mass: FloatArray) -> FloatArray:
        """Return the supports' impulses (n_dofs,) from the residual A v - f - H r, H r and the unknowns v."""
        ...

    def energy(self, model: Model, before: State, after: State, acting: Acting, support: FloatArray) -> Energy:
        """Return the balance of energy of the step; support (n_dofs,) as in `Step.support_impulse`."""
        ...


@dataclass(frozen=True, eq=False)
class StepSetup:
    """What a step or part of one is computed with: bodies, what finds their contacts, the scheme of the part's length, and the sizes of
    the bodies, to which lengths of contact are relative."""

    model: Model
    detection: Detection
    scheme: Scheme
    proportions: Proportions


@dataclass(frozen=True)
class Dynamic(ABC):
    """What schemes of dynamics over a step h [s] share: the unknowns are velocities [m/s], reactions impulses [N s], and contacts are
    struck where they are detected: with the mass of rigid bodies there, an elastic impact changes no energy."""

    h: float

    def __post_init__(self) -> None:
        positive("h", self.h)

    @abstractmethod
    def detection_configuration(self, model: Model, state: State) -> FloatArray: ...

    @property
    @abstractmethod
    def elastic_time(self) -> float: ...

    def when(self, state: State) -> When:
        return When(state.t, state.t + self.h, self.elastic_time / self.h)

    @property
    def force_per_reaction(self) -> float:
        return 1 / self.h

    @property
    def notes(self) -> tuple[str, ...]:
        return ()

    @property
    def kinematics(self) -> Kinematics | None:
        return None

    def cut(self, parts: int) -> Self:
        return replace(self, h=self.h / parts)

    def refuse(self, model: Model) -> None:
        return

    def working_configuration(self, model: Model, before: State, after: State) -> FloatArray | None:
        return None

    def way(self, model: Model, state: State) -> FloatArray | None:
        def made() -> FloatArray:
            way = elementwise("ways", len(state.v), lambda some: self.h * state.v[some])
            more = pushed(model, load_at(model, state, self.h), self.h)
            return way if more is None else way + more

        return state.kept(("way", self.h), model, made)

    def velocity_before(self, model: Model, state: State) -> FloatArray:
        """v (n_dofs,) of the state's momentum in the detection configuration."""

        return model.keep_momentum(state.v, model.rigid_mass(state.x), self.detection_configuration(model, state))

    def rigid_mass(self, model: Model, state: State, load: FloatArray) -> FloatArray:
        return model.rigid_mass(self.detection_configuration(model, state))

    def driven(self, model: Model, state: State) -> FloatArray:
        return model.driven_velocity(state.t + self.h, self.h)


def load_at(model: Model, state: State, dt: float) -> FloatArray:
    """The loads (n_dofs,) [N] at dt [s] after a state, followers of rigid bodies as in the reference; kept with the state."""
    return state.kept(("load", dt), model, lambda: model.load(state.t + dt))


def refuse_law(law: object) -> None:
    """Refuse what is no contact law: a class without its brackets, a number."""
    if isinstance(law, type):
        raise InputError(
            f"law: expected a contact law, as Gap() or Velocity(0.5), got the class {law.__name__} itself: {law.__name__}(...)"
        )
    if not all(callable(getattr(law, name, None)) for name in ("select", "terms", "remember")):
        raise InputError(f"law: expected a contact law, as Gap() or Velocity(0.5), got {law!r:.60}")


def positive(name: str, value: object, largest: float = np.inf) -> None:
    """Refuse a parameter that is not in ]0, largest], or not finite."""
    if not (is_number(value) and 0 < value <= largest):
        raise InputError(f"{name}: expected a number > 0{'' if np.isinf(largest) else f' and <= {largest:g}'}, got {shown(value)}")
