"""What a time-stepping scheme gives to the simulation, and the contact laws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fcsim.assembly.model import Model
from fcsim.contact_detection.contacts import Contacts
from fcsim.errors import InputError
from fcsim.timestep.state import State

FloatArray = NDArray[np.float64]


class Scheme(Protocol):
    """One step is M v = H r + f with M = mass_factor M + stiffness_factor K; see theta.py and quasi_static.py."""

    @property
    def h(self) -> float:
        """Length of a step [s]."""
        ...

    @property
    def force_per_reaction(self) -> float:
        """Force [N] of a unit reaction: 1/h for impulses, 1 for forces."""
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

    def advance(self, model: Model, state: State, v: FloatArray, rigid_mass: FloatArray) -> State:
        """Return the state at the end of the step from the solution v (n_dofs,) with the step's `rigid_mass`."""
        ...


@dataclass(frozen=True)
class Gap:
    """0 <= g + h u_N ⊥ r_N >= 0 on all contacts within the alert distance (LMGC90's GAP_SGR_CLB, inelastic)."""


@dataclass(frozen=True)
class Velocity:
    """Moreau's impact law on contacts with g <= 0: 0 <= u_N + e u_N^- ⊥ r_N >= 0, restitution 0 <= e <= 1."""

    restitution: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.restitution <= 1:
            raise InputError(f"restitution: expected a number between 0 and 1, got {self.restitution}")


def positive(name: str, value: float, largest: float = np.inf) -> None:
    """Refuse a parameter that is not in ]0, largest]."""
    if not 0 < value <= largest:
        raise InputError(f"{name}: expected a number > 0{'' if np.isinf(largest) else f' and <= {largest:g}'}, got {value}")
