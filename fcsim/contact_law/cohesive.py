"""Joints that hold together, mortar and glue: tension and shear strength that fracture takes away, friction where they are damaged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.arrays import BoolArray, FloatArray
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_law.compliant import Springs
from fcsim.contact_law.coulomb import RECOVERY, closing
from fcsim.contact_law.law import Meeting, Outcome, Remembered, Terms, Variables
from fcsim.contact_law.proportions import Proportions
from fcsim.errors import InputError, Unphysical

BONDED_WITHIN = 1e-4
"""Contacts of the first step are bonded where their gap is below this share of the smaller body's size."""


class JointLost(Unphysical):
    """A joint that still holds is no longer among the detected contacts."""


@dataclass(frozen=True, kw_only=True)
class Cohesive:
    """A joint of tensile strength f_t = tension [Pa] and shear strength c = shear [Pa], fractured by G_I = mode_1, G_II = mode_2 [J/m^2].

    What is bonded in the first step (gaps below `BONDED_WITHIN` sizes) holds until it is fractured; what meets later does not stick.
    With the area A of a contact and its fractured share W = W_I / G_I + W_II / G_II, W_I and W_II the work that opening and sliding
    have done against the joint's strength per area, and the integrity i = sqrt(1 - W):

        r_c = f_t i A on the normal,   r~ = r + r_c in Coulomb's cone,   ||r_T|| <= c i A + mu r_N under pressure

    so each strength falls linearly with the opening or the slip (to zero at 2 G_I / f_t and 2 G_II / c), the work done by the time
    it is zero is the fracture energy by construction, and in mixed mode the shares add up to one. What is open transmits f_t i A
    whichever way it moves, no shear; what the joint would give back so is no dissipation: it is counted as stored.
    The envelope is a cone whose apex is at -f_t: its slope is the pair's mu with shear = None (then c = mu f_t), else it goes through
    ||r_T|| = c i A + mu r_N at the normal force of the previous step, explicitly. The strength of a step is that of its beginning.
    springs: elasticity of the joint, None = rigid until it breaks; recovery as in `Gap`.

    The alert distance of the pair must exceed the opening 2 G_I / f_t (plus f_t / normal stiffness): a joint that holds and is not
    detected any more raises JointLost.
    Sources: Monerie, Acary, Rev. Europ. Elem. Finis 10, 2001 (r~ = r + r_c); Alfano, Sacco, Int. J. Numer. Methods Eng. 68, 2006
    (friction where the joint is damaged); Lourenco, Rots, J. Eng. Mech. 123, 1997 (strengths and energies of masonry).
    """

    tension: float
    mode_1: float
    mode_2: float
    shear: float | None = None
    springs: Springs | None = None
    recovery: float = RECOVERY

    def __post_init__(self) -> None:
        for name, unit in (("tension", "Pa"), ("mode_1", "J/m^2"), ("mode_2", "J/m^2")):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise InputError(f"{name}: expected a number > 0 in {unit}, got {getattr(self, name)}")
        if self.shear is not None and not (np.isfinite(self.shear) and self.shear > 0):
            raise InputError(f"shear: expected a strength > 0 in Pa, or None for mu times the tensile strength, got {self.shear}")
        if not self.recovery >= 0:
            raise InputError(f"recovery: expected a share of the size a second >= 0 (inf: at once), got {self.recovery}")

    @property
    def opening(self) -> float:
        """The opening [m] at which a joint in pure tension is fractured, with its springs' stretch."""
        return 2 * self.mode_1 / self.tension + (self.tension / self.springs.normal if self.springs else 0.0)

    def select(self, contacts: Contacts, proportions: Proportions, variables: Variables | None) -> BoolArray:
        """All; JointLost where one that holds is missing."""
        if variables is not None and "fracture" in variables.values:
            holding = variables.identity[variables.values["fracture"] < 1]
            missing = holding[~np.isin(holding, contacts.identity)]
            if len(missing):
                raise JointLost(
                    f"Cohesive: {len(missing)} joints that still hold were not detected any more; expected an alert distance above the "
                    f"opening at fracture, {self.opening:.3g} m (and steps in which no joint moves past it)"
                )
        return np.ones(len(contacts), dtype=bool)

    def fracture(self, meeting: Meeting) -> FloatArray:
        """The fractured share W (nc,) at the beginning of the step: 1 where nothing was ever bonded."""
        fresh = np.ones(len(meeting))
        if meeting.variables is None:
            fresh = np.where(meeting.contacts.gap <= BONDED_WITHIN * meeting.size, 0.0, 1.0)
        W = meeting.recall("fracture", fresh)
        return np.where(np.isnan(W), 1.0, W)

    def terms(self, meeting: Meeting) -> Terms:
        w = np.zeros_like(meeting.before)
        w[:, 0] = closing(meeting, self.recovery)
        holds = np.sqrt(1 - self.fracture(meeting)) * meeting.area / meeting.timing.force_per_reaction
        adhesion = np.zeros_like(w)
        adhesion[:, 0] = self.tension * holds
        mu = meeting.contacts.mu
        if self.shear is not None:
            pressing = np.maximum(meeting.recall("pressing", np.zeros(len(meeting))), 0.0) / meeting.timing.force_per_reaction
            apex = adhesion[:, 0] + pressing
            mu = np.where(holds > 0, (self.shear * holds + mu * pressing) / np.where(apex > 0, apex, 1.0), mu)
        terms = Terms(w, mu, adhesion=adhesion)
        return terms if self.springs is None else self.springs.add_to(terms, meeting)

    def remember(self, meeting: Meeting, outcome: Outcome) -> Remembered:
        timing, area = meeting.timing, meeting.area
        W = self.fracture(meeting)
        integrity = np.sqrt(1 - W)
        assert outcome.terms.adhesion is not None
        # how far it is open beyond what the springs give, at its widest so far, and how far it slides while it is closed
        elastic = self.tension * integrity / self.springs.normal if self.springs else 0.0
        opening = np.maximum(meeting.contacts.gap + timing.length_per_u * outcome.after[:, 0] - elastic, 0.0)
        widest = np.maximum(meeting.recall("opening", np.zeros(len(meeting))), 0.0)
        slip_per_u = timing.length_per_u * (timing.theta if self.springs else 1.0)
        slip = slip_per_u * np.sqrt(np.einsum("ai,ai->a", outcome.u[:, 1:], outcome.u[:, 1:])) * (outcome.r[:, 0] > 0)
        shear = self.tension * outcome.terms.mu if self.shear is None else self.shear
        work_1 = self.tension * integrity * np.maximum(opening - widest, 0.0)
        work_2 = shear * integrity * slip
        fractured = np.minimum(W + work_1 / self.mode_1 + work_2 / self.mode_2, 1.0)
        fractured[fractured > 1 - 1e-9] = 1.0  # a joint that is all but gone is gone: sqrt would leave 3e-5 of its strength
        given_back = float(np.sum(self.tension * np.sqrt(1 - fractured) * area * opening))
        values = {
            "fracture": fractured,
            "opening": np.maximum(opening, widest),
            "pressing": timing.force_per_reaction * (outcome.r - outcome.terms.adhesion)[:, 0],
            "work_1": meeting.recall("work_1", np.zeros(len(meeting))) + work_1 * area,
            "work_2": meeting.recall("work_2", np.zeros(len(meeting))) + work_2 * area,
        }
        if self.springs is None:
            return Remembered(values, given_back)
        stretch, energy = self.springs.after(meeting, outcome)
        return Remembered({**values, "stretch": stretch}, energy + given_back)
