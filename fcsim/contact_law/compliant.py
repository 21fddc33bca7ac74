"""Joints with stiffness and damping: u + C r in the cone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, is_number
from fcsim.brief import shown
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_law.coulomb import NO_GAP, remembered_slip
from fcsim.contact_law.friction import Elliptic, Friction, friction_terms
from fcsim.contact_law.law import Meeting, Outcome, Remembered, Terms, Variables
from fcsim.contact_law.proportions import Proportions
from fcsim.contact_law.turning_along import attitudes, carried
from fcsim.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Springs:
    """The springs and dashpots of a joint: normal, tangential stiffness [Pa/m], normal_damping, tangential_damping [Pa s/m], each times the
    contact's area. A spring is as implicit as the bodies' own stiffness: with F the force per reaction, L the length per u,

        normal      F r_N = - k g_theta - c g',  g' = L/h (theta u_N + (1-theta) u_N^-),   g_theta = g + L (theta^2 u_N - (1-theta)^2 u_N^-)
        tangential  F r_T = - k e_theta - c e',   e' = L/h (theta u_T + (1-theta) u_T^- - slip),   e_theta = e + h theta e'

    with g where the contact is detected, e the stretch at the beginning of the step; so the energy of a spring is kept at theta = 1/2.
    The stretch turns with the bodies, see `fcsim.contact_law.turning_along`. The normal dashpot acts on what touches, or is glued, as the
    step begins: not on what comes near.
    each: stiffness [N/m] and damping [N s/m] are those of every contact, whatever its area: for contacts of edges and corners
    (`Everything`), which have none. A joint of four contacts is then four times as stiff as its contact.
    """

    normal: float
    tangential: float
    normal_damping: float = 0.0
    tangential_damping: float = 0.0
    each: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.each, bool | np.bool_):
            raise InputError(f"each: expected True or False, got {shown(self.each)}")
        for name in ("normal", "tangential"):
            if not (is_number(getattr(self, name)) and getattr(self, name) > 0):
                raise InputError(f"{name}: expected a stiffness > 0 in {'N/m' if self.each else 'Pa/m'}, got {shown(getattr(self, name))}")
        for name in ("normal_damping", "tangential_damping"):
            if not (is_number(getattr(self, name)) and getattr(self, name) >= 0):
                raise InputError(
                    f"{name}: expected a damping >= 0 in {'N s/m' if self.each else 'Pa s/m'}, got {shown(getattr(self, name))}"
                )

    def add_to(self, terms: Terms, meeting: Meeting) -> Terms:
        """The terms with C and w of the springs: the formulas above solved for u; the slip in them is theta times the problem's u_T."""
        timing, area = meeting.timing, self.areas(meeting)
        theta, L, F = timing.theta, timing.length_per_u, timing.force_per_reaction
        before, stretch = meeting.before, self.stretch(meeting)
        w, C = np.zeros_like(before), np.empty_like(before)
        damping = np.where(self._touching(terms, meeting), self.normal_damping, 0.0)
        implicit = area * (self.normal * L * theta**2 + damping * L * theta / timing.h)
        start = meeting.contacts.gap - L * (1 - theta) ** 2 * before[:, 0]
        held = self.normal * start + damping * L * (1 - theta) / timing.h * before[:, 0]
        w[:, 0] = area * held / implicit
        C[:, 0] = F / implicit
        implicit = theta * area * (self.tangential * L * theta + self.tangential_damping * L / timing.h)
        w[:, 1:] = (1 - theta) / theta * before[:, 1:] + (area * self.tangential / implicit)[:, None] * stretch
        C[:, 1:] = (F / implicit)[:, None]
        if terms.adhesion is not None:
            w -= C * terms.adhesion
        return replace(terms, w=w, compliance=C)

    def _touching(self, terms: Terms, meeting: Meeting) -> BoolArray:
        """Whether a contact touches, or is glued, as the step begins (nc,): what comes near would else be braked by the dashpot before it
        touches, from the gap c |g'| / k on."""
        touching: BoolArray = meeting.gap_before <= NO_GAP * meeting.size
        return touching if terms.adhesion is None else touching | (terms.adhesion[:, 0] > 0)

    def areas(self, meeting: Meeting) -> FloatArray:
        """What stiffness and damping are multiplied by (nc,): each contact's area [m^2], or 1."""
        return np.ones(len(meeting)) if self.each else meeting.area

    def stretch(self, meeting: Meeting) -> FloatArray:
        """The tangential stretch e (nc, d - 1) [m] at the beginning of the step in the contacts' frames; none where a contact is new."""
        remembered = np.nan_to_num(meeting.recall("stretch", np.zeros_like(meeting.before)))
        unknown = np.full((len(meeting), 6), np.nan)
        return carried(meeting, remembered, meeting.recall("attitude", unknown) if meeting.contacts.dimension == 3 else unknown)

    def after(self, meeting: Meeting, outcome: Outcome, crack: FloatArray | None = None) -> tuple[dict[str, FloatArray], float]:
        """What is remembered, the stretch (nc, d) [m] at the end of the step in the world axes and the bodies' attitudes, and the energy
        [J] of all springs; crack (nc,) [m]: the opening of joints under tension that is none of the springs'."""
        timing = meeting.timing
        theta, L = timing.theta, timing.length_per_u
        mean = theta * outcome.after + (1 - theta) * meeting.before
        stretch = np.zeros_like(mean)
        stretch[:, 1:] = self.stretch(meeting) + L * (mean - theta * outcome.u)[:, 1:]
        touching = outcome.r[:, 0] > 0
        stretch[~touching] = 0.0
        r = outcome.r if outcome.terms.adhesion is None else outcome.r - outcome.terms.adhesion
        # the normal spring at the end of the step, as the state stands: x = x_m + theta L u where contacts are detected at x_m
        deep = np.where(touching | (r[:, 0] != 0), meeting.contacts.gap + theta * L * outcome.after[:, 0], 0.0)
        deep = np.minimum(deep, 0.0) if crack is None else np.where(deep > 0, np.maximum(deep - crack, 0.0), deep)
        energy = 0.5 * self.areas(meeting) * (self.normal * deep**2 + self.tangential * np.einsum("ai,ai->a", stretch, stretch))
        values = {"stretch": meeting.in_space(stretch)}
        if meeting.contacts.dimension == 3:
            values["attitude"] = attitudes(meeting)
        return values, float(energy.sum())


@dataclass(frozen=True)
class Compliant:
    """Contact through springs (the joint stiffness of 3DEC and UDEC, the penalty of LS-DYNA): g + r/k >= 0, with Coulomb's friction.

    springs: see `Springs`; friction: as in `Gap`. Bodies overlap by the pressure over the normal stiffness; sliding begins when the
    tangential spring's force reaches mu r_N. The compliance is part of the problem, exactly: it is written to FCLIB files as degrees
    of freedom of their own, whose block of M is C^-1.
    """

    springs: Springs
    friction: Friction | Elliptic | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.springs, Springs):
            raise InputError(f"Compliant, springs: expected Springs(normal=..., tangential=...), got {shown(self.springs)}")
        if isinstance(self.friction, Elliptic):
            raise InputError("Compliant: expected isotropic friction, since its springs are; got Elliptic")

    def select(self, contacts: Contacts, proportions: Proportions, variables: Variables | None) -> BoolArray:
        return np.ones(len(contacts), dtype=bool)

    def terms(self, meeting: Meeting) -> Terms:
        mu = friction_terms(self.friction, meeting).mu
        return self.springs.add_to(Terms(np.zeros_like(meeting.before), mu), meeting)

    def remember(self, meeting: Meeting, outcome: Outcome) -> Remembered:
        stretch, energy = self.springs.after(meeting, outcome)
        return Remembered({**remembered_slip(self.friction, meeting, outcome).values, **stretch}, energy)
