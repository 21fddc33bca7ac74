"""What a time-stepping scheme gives to the simulation, and the contact laws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model
from fcsim.contact_detection.contacts import Contacts
from fcsim.errors import InputError
from fcsim.solvers import Result
from fcsim.timestep.energy import Energy
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

    def select(self, contacts: Contacts) -> Contacts:
        """Return the contacts that the law takes."""
        ...

    def right_hand_side(self, model: Model, state: State) -> FloatArray:
        """Return f (n_dofs,)."""
        ...

    def contact_velocity(self, state: State, contacts: Contacts, H: Any) -> FloatArray:
        """Return w (m,), without what driven dofs add."""
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

    def support_impulse(self, model: Model, residual: FloatArray, impulse: FloatArray) -> FloatArray:
        """Return the supports' impulses (n_dofs,) from the residual A v - f - H r and H r."""
        ...

    def energy(self, model: Model, before: State, after: State, H: Any, result: Result, support: FloatArray) -> Energy:
        """Return the balance of energy of the step; support (n_dofs,) as in `Step.support_impulse`."""
        ...


@dataclass(frozen=True)
class Gap:
    """0 <= g + h u_N ⊥ r_N >= 0 on all contacts within the alert distance (LMGC90's GAP_SGR_CLB, inelastic).

    A penetration, g < 0, is gone after one step; the reaction that pushes it out works like a spring and adds energy.
    """


@dataclass(frozen=True)
class Velocity:
    """Moreau's impact law on contacts with g <= 0: 0 <= u_N + e u_N^- ⊥ r_N >= 0, restitution 0 <= e <= 1, where they approach, u_N^- <= 0.

    A contact that separates, u_N^- > 0, and that the step would close again: 0 <= theta u_N + (1-theta) u_N^- ⊥ r_N >= 0. Its gap does not
    shrink over the step and its reaction does no work; with u_N >= 0 instead, the reaction would add energy. The normal reactions'
    work is then never positive for theta <= 1/(1+e), and zero for e = 1 at theta = 1/2 (generalised alpha: as theta = 1/2).
    """

    restitution: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.restitution <= 1:
            raise InputError(f"restitution: expected a number between 0 and 1, got {self.restitution}")


def law_contacts(law: Gap | Velocity, contacts: Contacts) -> Contacts:
    """The contacts that a law takes: all, or those with g <= 0."""
    return contacts if isinstance(law, Gap) else contacts.take(contacts.gap <= 0)


def law_velocity(law: Gap | Velocity, h: float, theta: float, state: State, contacts: Contacts, H: Any) -> FloatArray:
    """w (m,) [m/s] of a law: w_N = g/h, or e u_N^-, of separating contacts (1-theta)/theta u_N^-."""
    w = np.zeros((len(contacts), contacts.dimension))
    if isinstance(law, Gap):
        w[:, 0] = contacts.gap / h
    else:
        u = (H.T @ state.v).reshape(w.shape)[:, 0]
        w[:, 0] = np.where(u > 0, (1 - theta) / theta, law.restitution) * u
    return w.ravel()


def positive(name: str, value: float, largest: float = np.inf) -> None:
    """Refuse a parameter that is not in ]0, largest]."""
    if not 0 < value <= largest:
        raise InputError(f"{name}: expected a number > 0{'' if np.isinf(largest) else f' and <= {largest:g}'}, got {value}")
