"""Joints that hold together, mortar and glue: tension and shear strength that fracture takes away, friction where they are damaged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, is_number
from fcsim.brief import shown
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_law.compliant import Springs
from fcsim.contact_law.coulomb import RECOVERY, closing
from fcsim.contact_law.handed_on import CORNERS, beside_joints, corners_of
from fcsim.contact_law.law import Breaking, Demand, Meeting, Outcome, Remembered, Terms, Variables
from fcsim.contact_law.proportions import Proportions
from fcsim.errors import InputError, Unphysical

BONDED_WITHIN = 1e-4
"""Contacts of the first step are bonded where their gap is below this share of the smaller body's size."""

GONE = 3e-5
"""A joint with less than this share of its strength has none."""


class JointLost(Unphysical):
    """A joint that still holds is no longer among the detected contacts."""


@dataclass(frozen=True, eq=False)
class Course:
    """What becomes of joints in a step, all (nc,): integrity at its beginning and end, and `acting`, with which the joint acted in it;
    is_open: at its end; crack [m] the opening at its beginning and end, widest: so far; left: the share of the shear strength that
    tension left over the way and at the end; slip [m]; shared: how much of what breaks is opening's; mean: the integrity while it fell,
    over_way: over all the way of the opening, for the work of the step."""

    begin: FloatArray
    end: FloatArray
    acting: FloatArray
    is_open: BoolArray
    crack: tuple[FloatArray, FloatArray]
    widest: FloatArray
    left: tuple[FloatArray, FloatArray]
    slip: FloatArray
    shared: FloatArray
    mean: FloatArray
    over_way: FloatArray


@dataclass(frozen=True, kw_only=True)
class Cohesive:
    """A joint of tensile strength f_t = tension [Pa] and shear strength c = shear [Pa], fractured by G_I = mode_1, G_II = mode_2 [J/m^2].

    What is bonded in the first step (gaps below `BONDED_WITHIN` sizes) holds until it is fractured; what meets later does not stick.
    With the area A of a contact, the opening d beyond its widest so far and the slip s, its integrity i falls by

        di = - f_t dd / (2 G_I) - c ds / (2 G_II),   r_c = f_t i A on the normal,   r~ = r + r_c in Coulomb's cone,
            ||r_T|| <= k c i A + mu max(r_N, 0),   k = min(r~_N / r_c, 1) <= 1, the share of the shear strength that tension leaves

    so each strength falls linearly with the opening or the slip, to zero at 2 G_I / f_t and 2 G_II / c, and never rises. The fractured
    share is W = 1 - i^2, W_I by opening and W_II by slip, W_I + W_II = 1 at the end, and A (G_I dW_I + k G_II dW_II) is the work done
    against the joint's strength: opened, or slid without tension, it takes its fracture energies; what slides under tension, less. What
    is open transmits f_t i A whichever way it moves, no shear (k = 0); what the joint would give back so is no dissipation: it is
    counted as stored. The envelope is a cone whose apex is at -f_t: its slope is the pair's mu with shear = None (then c = mu f_t), else
    it goes through ||r_T|| = c i A + mu r_N at the normal force of the step.

    The strength of a step is implicit (see `Implicit`): i_act = (1 - theta) i + theta i+ with that of its end, in statics i+, so that load
    steps of any size lie on the curve; in the step that breaks the joint, theta = 1/2 takes the mean over the way. The work of the
    reactions at theta = 1/2 is then the fracture energy of what broke; else the scheme's error, theta - 1/2 times the fall of strength
    times the way, counts as numerical dissipation, as that of elastic forces does. springs: elasticity of the joint, None = rigid until
    it breaks; recovery as in `Gap`.

    The alert distance of the pair must exceed the opening 2 G_I / f_t (plus f_t / normal stiffness): a joint that holds and is not
    detected any more raises JointLost.
    Sources: Monerie, Acary, Rev. Europ. Elem. Finis 10, 2001 (r~ = r + r_c); Alfano, Sacco, Int. J. Numer. Methods Eng. 68, 2006
    (friction where the joint is damaged); Lourenco, Rots, J. Eng. Mech. 123, 1997 (strengths and energies of masonry); Gonzalez, J.
    Nonlinear Sci. 6, 1996 (the mean over the way conserves energy).
    """

    tension: float
    mode_1: float
    mode_2: float
    shear: float | None = None
    springs: Springs | None = None
    recovery: float = RECOVERY

    def __post_init__(self) -> None:
        for name, unit in (("tension", "Pa"), ("mode_1", "J/m^2"), ("mode_2", "J/m^2")):
            if not (is_number(getattr(self, name)) and getattr(self, name) > 0):
                raise InputError(f"{name}: expected a number > 0 in {unit}, got {shown(getattr(self, name))}")
        if self.shear is not None and not (is_number(self.shear) and self.shear > 0):
            raise InputError(f"shear: expected a strength > 0 in Pa, or None for mu times the tensile strength, got {shown(self.shear)}")
        if not (self.springs is None or isinstance(self.springs, Springs)):
            raise InputError(f"springs: expected Springs(normal=..., tangential=...) or None, got {shown(self.springs)}")
        if not (is_number(self.recovery, infinite=True) and self.recovery >= 0):
            raise InputError(f"recovery: expected a share of the size a second >= 0 (inf: at once), got {shown(self.recovery)}")

    @property
    def opening(self) -> float:
        """The opening [m] at which a joint in pure tension is fractured, with its springs' stretch."""
        return 2 * self.mode_1 / self.tension + (self.tension / self.springs.normal if self.springs else 0.0)

    def select(self, contacts: Contacts, proportions: Proportions, variables: Variables | None) -> BoolArray:
        """All but those of corners that a joint holds on each other already; JointLost where one that holds is missing."""
        if variables is None or "fracture" not in variables.values:
            return ~beside_joints(contacts, np.zeros(len(contacts), dtype=bool))
        holding = variables.identity[variables.values["fracture"] < 1]
        missing = holding[~np.isin(holding, contacts.identity)]
        if len(missing):
            raise JointLost(
                f"Cohesive: {len(missing)} joints that still hold were not detected any more; expected an alert distance above the "
                f"opening at fracture, {self.opening:.3g} m, steps in which no joint moves past it, and joints within faces: nodes may "
                "leave their rims by round-off"
            )
        return ~beside_joints(contacts, np.isin(contacts.identity, holding))

    def integrity(self, meeting: Meeting) -> FloatArray:
        """i (nc,) at the beginning of the step: 0 where nothing was ever bonded."""
        fresh = np.ones(len(meeting))
        if meeting.variables is None:
            fresh = np.where(meeting.gap_before <= BONDED_WITHIN * meeting.size, 0.0, 1.0)
        W = meeting.recall("fracture", fresh)
        return np.sqrt(1 - np.where(np.isnan(W), 1.0, W))

    def terms(self, meeting: Meeting) -> Terms:
        w = np.zeros_like(meeting.before)
        w[:, 0] = closing(meeting, self.recovery)
        acting = meeting.tried("integrity", self.integrity(meeting))
        adhesion = np.zeros_like(w)
        adhesion[:, 0] = self.tension * acting * _area(meeting) / meeting.timing.force_per_reaction
        mu = meeting.contacts.mu
        if self.shear is not None:
            pressing = self._tried_pressing(meeting)
            apex = acting + pressing
            envelope = self.shear / self.tension * acting + mu * pressing
            mu = np.where(acting > 0, envelope / np.where(apex > 0, apex, 1.0), mu)
        terms = Terms(w, mu, adhesion=adhesion)
        return terms if self.springs is None else self.springs.add_to(terms, meeting)

    def demands(self, meeting: Meeting, outcome: Outcome) -> dict[str, Demand]:
        """The integrity i_act with which the joint acted, and with a shear strength of its own the pressure over f_t."""
        course, nothing = self._course(meeting, outcome), np.zeros(len(meeting))
        late = max(2 * meeting.timing.theta - 1, 0.0)
        demands = {"integrity": Demand(course.acting, late * course.end + (1 - late) * course.over_way, nothing, course.begin)}
        if self.shear is not None:
            pressing = self._pressing(meeting, outcome)
            demands["pressing"] = Demand(self._tried_pressing(meeting), pressing, nothing, np.full(len(meeting), np.inf))
        return demands

    def remember(self, meeting: Meeting, outcome: Outcome) -> Remembered:
        area, course = _area(meeting), self._course(meeting, outcome)
        broken = area * (course.begin**2 - course.end**2)
        work_1, work_2 = self.mode_1 * course.shared * broken, self.mode_2 * (1 - course.shared) * course.left[0] * broken
        opened, slid = course.crack[1] - course.crack[0], self._shear(meeting) * course.slip
        breaking = Breaking(
            float(np.sum(work_1 + work_2)),
            # by the strength that acted beyond the mean one
            float(np.sum(self.tension * area * (course.acting - course.over_way) * opened, where=course.is_open)),
            float(np.sum(area * slid * (course.acting * course.left[1] - course.mean * course.left[0]))),
        )
        values = {
            "fracture": 1 - course.end**2,
            "opening": np.maximum(course.crack[1], course.widest),
            "area": area,
            "left": course.left[1],
            "pressing": self._pressing(meeting, outcome),
            CORNERS: corners_of(meeting.contacts),
            "work_1": meeting.recall("work_1", np.zeros(len(meeting))) + work_1,
            "work_2": meeting.recall("work_2", np.zeros(len(meeting))) + work_2,
        }
        given_back = float(np.sum(self.tension * course.end * area * course.crack[1]))
        if self.springs is None:
            return Remembered(values, given_back, breaking)
        stretch, energy = self.springs.after(meeting, outcome, course.crack[1])
        return Remembered({**values, "crack": course.crack[1], **stretch}, energy + given_back, breaking)

    def _shear(self, meeting: Meeting) -> FloatArray:
        """c (nc,) [Pa]."""
        return self.tension * meeting.contacts.mu if self.shear is None else np.full(len(meeting), self.shear)

    def _tried_pressing(self, meeting: Meeting) -> FloatArray:
        return meeting.tried("pressing", np.nan_to_num(meeting.recall("pressing", np.zeros(len(meeting)))))

    def _pressing(self, meeting: Meeting, outcome: Outcome) -> FloatArray:
        """The pressure (nc,) over the tensile strength, 0 under tension."""
        assert outcome.terms.adhesion is not None
        force = meeting.timing.force_per_reaction * (outcome.r - outcome.terms.adhesion)[:, 0]
        return np.maximum(force, 0.0) / (self.tension * _area(meeting))

    def _course(self, meeting: Meeting, outcome: Outcome) -> Course:
        timing, begin = meeting.timing, self.integrity(meeting)
        assert outcome.terms.adhesion is not None
        held = outcome.terms.adhesion[:, 0]
        acting = timing.force_per_reaction * held / (self.tension * _area(meeting))
        first, last = self._cracks(meeting, outcome, begin, acting)
        touches = (outcome.r[:, 0] > 0) | (last * self.tension <= GONE * 2 * self.mode_1)
        left = np.clip(np.divide(outcome.r[:, 0], held, out=touches.astype(float), where=acting > GONE), 0.0, 1.0)
        left_before = np.nan_to_num(meeting.recall("left", np.ones(len(meeting))))
        widest = np.nan_to_num(meeting.recall("opening", first))
        is_open = last * self.tension >= left * 2 * self.mode_1  # one of the two is zero but for the solver's tolerance
        last = np.where(is_open, last, np.minimum(last, widest))
        further = np.maximum(last - widest, 0.0)
        slip_per_u = timing.length_per_u * (timing.theta if self.springs else 1.0)
        slip = slip_per_u * np.sqrt(np.einsum("ai,ai->a", outcome.u[:, 1:], outcome.u[:, 1:]))
        by_opening = 0.5 * self.tension / self.mode_1 * further
        by_slip = 0.5 * self._shear(meeting) / self.mode_2 * slip
        fall = by_opening + by_slip
        end = begin - fall
        end[end < GONE] = 0.0
        over_slip = np.where(end > 0, 0.5 * (left_before + left), left_before)
        falls = (fall > 0) & (begin > 0)
        over = np.where(falls, fall, 1.0)
        # (begin^2 - end^2) / (2 fall), without its cancellation where joints open by no more than round-off
        mean = np.where(falls, np.where(end > 0, 0.5 * (begin + end), 0.5 * begin**2 / over), begin)
        way = last - first
        opens = is_open & (way > 0)
        over_way = np.where(opens, (begin * (way - further) + mean * further) / np.where(opens, way, 1.0), mean)
        return Course(begin, end, acting, is_open, (first, last), widest, (over_slip, left), slip, by_opening / over, mean, over_way)

    def _cracks(self, meeting: Meeting, outcome: Outcome, begin: FloatArray, acting: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The opening (nc,) [m] at the beginning and the end of the step, beyond what the springs give at the joint's strength."""
        theta, L, gap = meeting.timing.theta, meeting.timing.length_per_u, meeting.contacts.gap
        last = np.maximum(gap + L * theta * outcome.after[:, 0], 0.0)
        if self.springs is None:
            return np.maximum(meeting.gap_before, 0.0), last
        strength = np.clip((acting - (1 - theta) * begin) / theta, 0.0, begin)
        crack = np.nan_to_num(meeting.recall("crack", np.zeros(len(meeting))))
        return crack, np.maximum(last - self.tension * strength / self.springs.normal, 0.0)


def _area(meeting: Meeting) -> FloatArray:
    """The area (nc,) [m^2] of each joint as it was when it was met first: joints neither grow nor shrink as bodies deform and slide."""
    return meeting.recall("area", meeting.area)
