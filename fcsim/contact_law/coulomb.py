"""Coulomb friction with non-penetration on the gap or on the velocity: the laws "gap" and "velocity"."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.contact_detection.contacts import Contacts
from fcsim.errors import InputError


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


def law_velocity(law: Gap | Velocity, h: float, theta: float, v: FloatArray, contacts: Contacts, H: Any) -> FloatArray:
    """w (m,) [m/s] of a law: w_N = g/h, or e u_N^-, of separating contacts (1-theta)/theta u_N^-; v (n_dofs,) [m/s] at its beginning."""
    w = np.zeros((len(contacts), contacts.dimension))
    if isinstance(law, Gap):
        w[:, 0] = contacts.gap / h
    else:
        u = (H.T @ v).reshape(w.shape)[:, 0]
        w[:, 0] = np.where(u > 0, (1 - theta) / theta, law.restitution) * u
    return w.ravel()
