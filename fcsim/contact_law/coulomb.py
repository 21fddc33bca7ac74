"""Coulomb friction with non-penetration on the gap or on the velocity: the laws "gap" and "velocity"."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, is_number
from fcsim.brief import shown
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_law.friction import SEAT, Elliptic, Friction, as_beside, friction_terms, seats, way_slid
from fcsim.contact_law.law import Meeting, Outcome, Remembered, Terms, Variables
from fcsim.contact_law.proportions import Proportions
from fcsim.errors import InputError

RECOVERY = 0.1
"""Share of the smaller body's size by which a penetration is taken back a second, unless told otherwise."""
TOUCHING = 1e-8
"""A gap below this share of the smaller body's size is contact for the law on velocities: the twins of a flat impact differ by less."""
NO_GAP = 1e-7
"""A gap between rigid bodies of at most this share of the smaller one's size is none for the law on gaps in dynamics, see `counted`."""
IN_FULL = 10.0
"""Times `NO_GAP` from which on a gap counts in full. Where it counts at once, joints of masonry in motion, which open and close by some
1e-7 sizes, bear in one step and not in the next, and each step is solved for other points that carry: 40 steps of a vault of 83 blocks take
3.5 times the iterations."""


@dataclass(frozen=True)
class Gap:
    """0 <= g + h u_N ⊥ r_N >= 0 on all contacts within the alert distance, inelastic (LMGC90's GAP_SGR_CLB for recovery = inf).

    recovery [1/s]: a penetration, g < 0, that is there already is taken back by at most recovery times the smaller body's size a
    second: 0 <= max(g/h, -recovery size) + u_N ⊥ r_N. So much deeper than h recovery size nothing lies in a sound run, and the law is
    that of LMGC90; where bodies begin within each other, or something was not seen in time, they come out slowly. With recovery = inf
    it is gone after one step, thrown out at the velocity |g|/h: energy from nothing. Gaps of up to 1e-7 sizes between rigid bodies are none
    in dynamics, those of up to 1e-6 less than they are (see `counted`), but with recovery = inf. Of rigid bodies alone, gaps that open
    since bodies that bear on each other turn together count in full, see `fcsim.timestep.reactions.drift`. Quasi-statics have no time
    to go by: there it is taken back in one step.
    friction: see `fcsim.contact_law.friction`; None = the coefficients of the pairs. Contacts are points: the friction torque of a
    face about its normal depends on which points carry (0.77 to 1.85 of that of uniform pressure); docs/contact_laws.md has the rule by
    which it is right.
    """

    recovery: float = RECOVERY
    friction: Friction | Elliptic | None = None

    def __post_init__(self) -> None:
        if not (is_number(self.recovery, infinite=True) and self.recovery >= 0):
            raise InputError(f"recovery: expected a share of the size a second >= 0 (inf: at once), got {shown(self.recovery)}")

    def select(self, contacts: Contacts, proportions: Proportions, variables: Variables | None) -> BoolArray:
        """All."""
        return np.ones(len(contacts), dtype=bool)

    def terms(self, meeting: Meeting) -> Terms:
        w = np.zeros((len(meeting), meeting.contacts.dimension))
        if meeting.drift is not None:
            w[:, 1:] = meeting.drift[:, 1:] / meeting.timing.length_per_u
        w[:, 0] = closing(meeting, self.recovery)
        mu, scale, frame = friction_terms(self.friction, meeting)
        return Terms(w, mu, scale=scale, frame=frame)

    def remember(self, meeting: Meeting, outcome: Outcome) -> Remembered:
        return remembered_slip(self.friction, meeting, outcome)


@dataclass(frozen=True)
class Velocity:
    """Moreau's impact law on contacts with g <= 0: 0 <= u_N + e u_N^- ⊥ r_N >= 0, restitution 0 <= e <= 1, where they approach, u_N^- <= 0.

    g <= 0 up to `TOUCHING` sizes of the smaller body and round-off, so that the twin nodes of a flat impact are struck together.
    A contact that separates, u_N^- > 0, and that the step would close again: 0 <= theta u_N + (1-theta) u_N^- ⊥ r_N >= 0. Its gap does not
    shrink over the step and its reaction does no work; with u_N >= 0 instead, the reaction would add energy. The normal reactions'
    work is then never positive for theta <= 1/(1+e), and zero for e = 1 at theta = 1/2 (generalised alpha: as theta = 1/2).
    A penetration is not taken back: it does not grow. What approaches is struck once it touches where contacts are detected, so bodies
    overlap by up to the way of one step, h |u_N^-|, and keep that: choose h by the overlap that matters, or the law `Gap`, which lets
    nothing in but has no restitution. Taut cables (`Cable`) keep their length beside that, as in `Gap`: turning would make them longer by
    (h u_T)^2 / 2 length in every step. friction: as in `Gap`.
    """

    restitution: float = 0.0
    friction: Friction | Elliptic | None = None

    def __post_init__(self) -> None:
        if not (is_number(self.restitution) and 0 <= self.restitution <= 1):
            raise InputError(f"restitution: expected a number between 0 and 1, got {shown(self.restitution)}")

    def select(self, contacts: Contacts, proportions: Proportions, variables: Variables | None) -> BoolArray:
        """Those that touch."""
        return contacts.gap <= TOUCHING * proportions.size_at(contacts) + proportions.round_off_at(contacts)

    def terms(self, meeting: Meeting) -> Terms:
        theta, u = meeting.timing.theta, meeting.before[:, 0]
        w = np.zeros((len(meeting), meeting.contacts.dimension))
        w[:, 0] = np.where(u > 0, (1 - theta) / theta, self.restitution) * u
        cables = meeting.contacts.cables
        if cables.any():
            w[cables, 0] = np.minimum(w[:, 0], closing(meeting, RECOVERY))[cables]
        mu, scale, frame = friction_terms(self.friction, meeting)
        return Terms(w, mu, scale=scale, frame=frame)

    def remember(self, meeting: Meeting, outcome: Outcome) -> Remembered:
        return remembered_slip(self.friction, meeting, outcome)


def closing(meeting: Meeting, recovery: float) -> FloatArray:
    """w_N (nc,) = max(g / length_per_u, -recovery size) + bend / length_per_u in the unit of u; not bounded in quasi-statics.

    In dynamics gaps between rigid bodies are `counted`, but for recovery = inf: drift and what else there is of them, so that no gap is
    taken for smaller by more than `NO_GAP` sizes.
    """
    timing, gap = meeting.timing, meeting.contacts.gap
    if timing.moving and recovery != inf:
        drift = 0.0 if meeting.drift is None else meeting.drift[:, 0]
        gap = np.where(meeting.between_rigid, drift + counted(gap - drift, meeting.size), gap)
    w = gap / timing.length_per_u
    deep = gap < 0
    if recovery != inf and timing.moving and deep.any():
        w = np.where(deep, np.maximum(w, -recovery * meeting.size), w)
    return w if meeting.bend is None else w + meeting.bend / timing.length_per_u


def counted(gap: FloatArray, size: FloatArray) -> FloatArray:
    """What gaps (nc,) [m] between rigid bodies count in dynamics, size (nc,) [m] of the smaller one: with n = NO_GAP size, k = IN_FULL

        sign(g) min(|g|, max(|g| - n, 0) k / (k - 1)),

    nothing up to n, all from k n on, without a jump, and nowhere less than |g| - n. Small gaps are what solvers leave, and faces that rest
    in more points than they need answer them with other points that carry: of a thousand stacked boxes the first step at rest took 105 s
    with them, and takes 1 s without.
    """
    way = np.abs(gap)
    found: FloatArray = np.sign(gap) * np.minimum(way, np.maximum(way - NO_GAP * size, 0.0) * (IN_FULL / (IN_FULL - 1.0)))
    return found


def remembered_slip(friction: Friction | Elliptic | None, meeting: Meeting, outcome: Outcome) -> Remembered:
    """The distance slid, where a coefficient depends on it; of quasi-statics, whose state has no velocity, also the rate in this step."""
    if friction is None or isinstance(friction, Elliptic):
        return Remembered()
    way = way_slid(meeting, outcome)
    kept = {"slip": as_beside(meeting, "slip") + way, SEAT: seats(meeting, outcome)}
    return Remembered(kept if meeting.timing.moving else {**kept, "rate": way / meeting.timing.h})
