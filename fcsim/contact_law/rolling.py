"""Rolling resistance beside another law: a moment against the rolling of one body on another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from fcsim.arrays import BoolArray
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_law.coulomb import Gap
from fcsim.contact_law.law import Demand, Implicit, Law, Meeting, Outcome, Remembered, Terms, Variables
from fcsim.contact_law.proportions import Proportions
from fcsim.errors import InputError


@dataclass(frozen=True)
class Rolling:
    """||r_R|| <= resistance r_N for the rolling moment r_R [N m] of a contact of rigid bodies, against their relative rolling
    omega_T = (omega_slave - omega_master) in the tangent plane; all else as `law` says, for which mu is the pairs' coefficient as ever.

    resistance mu_r [m], the lever arm of the normal force (the "coefficient of rolling resistance" of tables, mu_r / R, times the radius):
    a body of radius R at rest rests on an incline iff tan(alpha) <= mu_r / R (and <= mu); rolling, it turns against the moment mu_r r_N.
    The cone of a contact is ||r_T|| <= mu r_N, ||r_R|| <= mu_r r_N, with K* ∋ u + g(u) ⊥ r ∈ K, g = (mu ||u_T|| + mu_r ||u_R||, 0, ...):
    Acary, Bourrier, European Journal of Mechanics A/Solids 85, 2021. In 2D there is one rolling moment, about z. Steps are solved by the
    methods for cones of five dimensions (ROLLING-NSGS, -EG, -FP) and written as FCLIB's rolling problems.

    Not covered: spinning resistance about the normal, for which contacts would need a sixth unknown that neither FCLIB's rolling problems
    nor the methods for their cone have; and deformable bodies, whose surfaces have no rotation of their own: their contacts are refused,
    give these another law (`laws_of_bodies`).
    """

    resistance: float
    law: Law = field(default_factory=Gap)

    def __post_init__(self) -> None:
        if not (np.isfinite(self.resistance) and self.resistance >= 0):
            raise InputError(f"Rolling, resistance: expected a length mu_r >= 0 in m, got {self.resistance}")
        if isinstance(self.law, Rolling):
            raise InputError("Rolling, law: expected a law without rolling resistance, got another Rolling")

    def select(self, contacts: Contacts, proportions: Proportions, variables: Variables | None) -> BoolArray:
        """As the other law."""
        return self.law.select(contacts, proportions, variables)

    def terms(self, meeting: Meeting) -> Terms:
        """The other law's, and the resistance."""
        return replace(self.law.terms(meeting), rolling=np.full(len(meeting), self.resistance))

    def remember(self, meeting: Meeting, outcome: Outcome) -> Remembered:
        """As the other law."""
        return self.law.remember(meeting, outcome)

    def demands(self, meeting: Meeting, outcome: Outcome) -> Mapping[str, Demand]:
        """As the other law."""
        return self.law.demands(meeting, outcome) if isinstance(self.law, Implicit) else {}
