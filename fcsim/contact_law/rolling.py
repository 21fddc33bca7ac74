"""Rolling and spinning resistance beside another law: moments against one body's rolling or spinning on another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from fcsim.arrays import BoolArray, is_number
from fcsim.brief import shown
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_law.coulomb import Gap
from fcsim.contact_law.law import Demand, Implicit, Law, Meeting, Outcome, Remembered, Terms, Variables
from fcsim.contact_law.proportions import Proportions
from fcsim.errors import InputError


@dataclass(frozen=True)
class _Resistance:
    """What rolling and spinning resistance share: a length, and another law for all else."""

    resistance: float
    law: Law = field(default_factory=Gap)

    def __post_init__(self) -> None:
        name, symbol = type(self).__name__, "mu_s" if isinstance(self, Spinning) else "mu_r"
        if not (is_number(self.resistance) and self.resistance >= 0):
            raise InputError(f"{name}, resistance: expected a length {symbol} >= 0 in m, got {shown(self.resistance)}")
        if isinstance(self.law, type) or not callable(getattr(self.law, "terms", None)):
            raise InputError(f"{name}, law: expected a contact law, as Gap(), got {self.law!r:.60}")
        if contains(self.law, type(self)):
            raise InputError(f"{name}, law: expected a law without {name.lower()} resistance, got another {name}")

    def select(self, contacts: Contacts, proportions: Proportions, variables: Variables | None) -> BoolArray:
        """As the other law."""
        return self.law.select(contacts, proportions, variables)

    def remember(self, meeting: Meeting, outcome: Outcome) -> Remembered:
        """As the other law."""
        return self.law.remember(meeting, outcome)

    def demands(self, meeting: Meeting, outcome: Outcome) -> Mapping[str, Demand]:
        """As the other law."""
        return self.law.demands(meeting, outcome) if isinstance(self.law, Implicit) else {}


@dataclass(frozen=True)
class Rolling(_Resistance):
    """||r_R|| <= resistance r_N for the rolling moment r_R [N m] of a contact of rigid bodies, against their relative rolling
    omega_T = (omega_slave - omega_master) in the tangent plane; all else as `law` says, for which mu is the pairs' coefficient as ever.

    resistance mu_r [m], the lever arm of the normal force (the "coefficient of rolling resistance" of tables, mu_r / R, times the radius):
    a body of radius R at rest rests on an incline iff tan(alpha) <= mu_r / R (and <= mu); rolling, it turns against the moment mu_r r_N.
    The cone of a contact is ||r_T|| <= mu r_N, ||r_R|| <= mu_r r_N, with K* ∋ u + g(u) ⊥ r ∈ K, g = (mu ||u_T|| + mu_r ||u_R||, 0, ...):
    Acary, Bourrier, European Journal of Mechanics A/Solids 85, 2021. In 2D there is one rolling moment, about z. Steps are solved by the
    methods for cones of five dimensions (ROLLING-AUTO and its like) and written as FCLIB's rolling problems. With spinning resistance too,
    `law` is a `Spinning`.

    Not covered: deformable bodies, whose surfaces have no rotation of their own: their contacts are refused, give these another law
    (`laws_of_bodies`).
    """

    def terms(self, meeting: Meeting) -> Terms:
        """The other law's, and the resistance."""
        return replace(self.law.terms(meeting), rolling=np.full(len(meeting), self.resistance))


@dataclass(frozen=True)
class Spinning(_Resistance):
    """|r_S| <= resistance r_N for the moment r_S [N m] about the normal of a contact of rigid bodies in 3D, against their relative spinning
    omega_N = (omega_slave - omega_master) . N; all else as `law` says, which may be a `Rolling`.

    resistance mu_s [m]: what a patch of contact would carry of which the model has one point. Under uniform pressure on a circle of radius
    a it is 2/3 mu a, under that of Hertz 3 pi / 16 mu a; a body of inertia I about N slows down by mu_s r_N / I, and rests under moments
    up to mu_s r_N. A face that touches in several points resists by their friction already: this adds to it, mu_s sum r_N.
    The cone of a contact is that of `Rolling` with |r_S| <= mu_s r_N beside it, the same complementarity with mu_s |u_S| more in g: force,
    rolling and spinning moment are each as large as they can be while the contact slides, rolls or spins, and each against its motion,
    independent of each other (a real patch which slides resists spinning less: Contensou 1963; Leine, Glocker, European Journal of
    Mechanics A/Solids 22, 2003). Steps are solved by the ROLLING methods with a sixth unknown. FCLIB's rolling problems have two
    moments a contact: files are written where no contact has both resistances, with the spinning moment as the first of the two.

    Not covered: as in `Rolling`; and 2D, where nothing turns about a normal (refused).
    """

    def terms(self, meeting: Meeting) -> Terms:
        """The other law's, and the resistance."""
        return replace(self.law.terms(meeting), spinning=np.full(len(meeting), self.resistance))


def contains(law: object, kind: type) -> bool:
    """Whether a law, one that it stands beside, or one of a table is of a kind."""
    within = (*getattr(law, "laws", ()), *([law.law] if isinstance(law, _Resistance) else []))
    return isinstance(law, kind) or any(contains(other, kind) for other in within)


def resists_both(law: object) -> bool:
    """Whether a law, or one of a table, gives a contact rolling and spinning resistance."""
    if isinstance(law, _Resistance):
        own, within = law, law.law
        while isinstance(within, _Resistance):
            if own.resistance > 0 and within.resistance > 0:
                return True
            own, within = within, within.law
        return resists_both(within)
    return any(resists_both(other) for other in getattr(law, "laws", ()))
