"""What a contact law is: which contacts take part, what it adds to the problem of a step, and what it remembers of the step.

The problem of a step is K* ∋ u + g(u) ⊥ r ∈ K with u = H^T v + w, M v = H r + f. A law enters it in five ways, each an array over the
contacts (see `Terms`), so that solvers and FCLIB files know Coulomb's cone alone:

    u  = S (H^T v) + C r + w      S: elliptic friction, C: compliance of the joint, w: gap, restitution, what is kept of earlier steps
    M v = H (S r - r_c) + f       r_c: adhesion, S r - r_c is what acts on the bodies

and in a sixth, rolling and spinning resistance, by which the problem has moments and the cone of five or six dimensions.

A law of one's own is a frozen dataclass with the members of `Law`; `docs/guides/add_a_contact_law.md` has one that runs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.brief import brief
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_law.proportions import Proportions


@dataclass(frozen=True)
class Timing:
    """What a scheme's unknown u means for a gap over a step.

    h [s]; theta the scheme's weight, 1 in quasi-statics; length_per_u: what a unit of u is in length over the step, h for velocities, 1
    for increments; force_per_reaction: 1/h for impulses, 1 for forces; moving: whether bodies have velocities at all.
    """

    h: float
    theta: float
    length_per_u: float
    force_per_reaction: float
    moving: bool = True


OF_ONE_STEP = ("rate", "stretch", "attitude", "place", "seat")
"""What laws remember of the last step alone: contacts that were not met in it have none."""
UNSHOWN = ("attitude", "place", "corners", "seat")
"""What is remembered of the bodies to carry other variables on (`turning_along`, `handed_on`): no result of a step."""


@dataclass(frozen=True, eq=False)
class Variables:
    """What laws remember by contact: identity (k,) ascending; values by name, each (k,) or (k, c); stored [J], what joints hold; breaking,
    of the step that ended, see `Breaking`."""

    identity: IntArray
    values: Mapping[str, FloatArray]
    stored: float = 0.0
    breaking: Breaking | None = None

    __repr__ = brief

    def of(self, name: str, identity: IntArray, fresh: FloatArray) -> FloatArray:
        """The variable of the contacts (nc,) or (nc, c); that of unknown contacts is taken from `fresh`, of the same shape."""
        if name not in self.values or not len(self.identity) or not len(identity):
            return fresh
        place = np.minimum(np.searchsorted(self.identity, identity), len(self.identity) - 1)
        known = self.identity[place] == identity
        return np.where(known.reshape(-1, *[1] * (fresh.ndim - 1)), self.values[name][place], fresh)

    def merged(self, identity: IntArray, values: Mapping[str, FloatArray], stored: float, breaking: Breaking | None = None) -> Variables:
        """These with the contacts' new values; contacts that are not met keep theirs but for `OF_ONE_STEP`, missing variables are NaN."""
        absent = ~np.isin(self.identity, identity)
        everyone = np.concatenate([self.identity[absent], identity])
        order = np.argsort(everyone, kind="stable")
        joined = {}
        for name in dict.fromkeys([*self.values, *values]):
            old, new = self.values.get(name), values.get(name)
            shape = (new if new is not None else old).shape[1:]  # type: ignore[union-attr] # one of them is there
            old = np.full((len(self.identity), *shape), np.nan) if old is None or name in OF_ONE_STEP else old
            new = np.full((len(identity), *shape), np.nan) if new is None else new
            joined[name] = np.concatenate([old[absent], new])[order]
        return Variables(everyone[order], joined, stored, breaking)


@dataclass(frozen=True)
class Breaking:
    """What joints that break did in a step [J]: fractured, their fracture energies times the area that broke; normal, tangential: by how
    much more their reactions took in each direction, the scheme's error on a strength that falls within the step."""

    fractured: float = 0.0
    normal: float = 0.0
    tangential: float = 0.0

    def __add__(self, other: Breaking) -> Breaking:
        return Breaking(self.fractured + other.fractured, self.normal + other.normal, self.tangential + other.tangential)


NOTHING = Variables(np.empty(0, dtype=np.int64), {})


@dataclass(frozen=True, eq=False)
class Meeting:
    """The contacts of a step as a law meets them.

    contacts    those that the law has selected
    positions   (n_nodes, d) [m] where they were detected
    before      (nc, d) relative velocity at the beginning of the step in the contacts' frames [m/s]; zero in quasi-statics
    t           [s] the beginning of the step
    timing      see `Timing`
    variables   of earlier steps; None in the first step, when nothing has been met yet
    proportions of the bodies: sizes, areas, which are rigid
    bend        (nc,) [m] by how much gaps change over the step beside length_per_u u_N, since bodies turn and feet move on; None = not at
                all, see `fcsim.timestep.step_equation.look_ahead.ahead`
    trial       what an implicit law takes for the end of the step, see `Implicit`; None = it is asked for the first time
    drift       (nc, d) [m] in the contacts' frames: how far bodies that bore on each other have gone apart since, as motions of the bodies
                take it back, see `fcsim.timestep.reactions.drift`; None = not at all, or the law has no use for it
    """

    contacts: Contacts
    positions: FloatArray
    before: FloatArray
    t: float
    timing: Timing
    variables: Variables | None
    proportions: Proportions
    bend: FloatArray | None = None
    trial: Variables | None = None
    drift: FloatArray | None = None

    __repr__ = brief

    def __len__(self) -> int:
        return len(self.contacts)

    @cached_property
    def size(self) -> FloatArray:
        """Size (nc,) [m] of the smaller of the two bodies."""
        return self.proportions.size_at(self.contacts)

    @cached_property
    def between_rigid(self) -> BoolArray:
        """Whether both bodies are rigid (nc,)."""
        return self.proportions.between_rigid(self.contacts)

    @cached_property
    def area(self) -> FloatArray:
        """Area (nc,) [m^2] that each contact stands for."""
        return self.proportions.area_at(self.contacts, self.positions)

    @property
    def gap_before(self) -> FloatArray:
        """The gap (nc,) [m] at the beginning of the step; contacts are detected where bodies will have moved on by their velocities."""
        return self.contacts.gap - self.timing.length_per_u * (1 - self.timing.theta) * self.before[:, 0]

    def recall(self, name: str, fresh: FloatArray) -> FloatArray:
        """A variable of the contacts (nc,) or (nc, c); of contacts that are new, `fresh`."""
        return fresh if self.variables is None else self.variables.of(name, self.contacts.identity, fresh)

    def tried(self, name: str, fresh: FloatArray) -> FloatArray:
        """A trial value of the contacts (nc,); where there is none yet, `fresh`."""
        return fresh if self.trial is None else self.trial.of(name, self.contacts.identity, fresh)

    def in_space(self, local: FloatArray) -> FloatArray:
        """Vectors (nc, d) of the contacts' frames in the world axes: how vectors are remembered, since frames turn."""
        return np.einsum("aij,ai->aj", self.contacts.frame, local)

    def in_frame(self, vectors: FloatArray) -> FloatArray:
        """Vectors (nc, d) of the world axes in the contacts' frames."""
        return np.einsum("aij,aj->ai", self.contacts.frame, vectors)

    def taken(self, chosen: BoolArray) -> Meeting:
        """The meeting of some of its contacts, a mask (nc,)."""
        return Meeting(
            self.contacts.take(chosen),
            self.positions,
            self.before[chosen],
            self.t,
            self.timing,
            self.variables,
            self.proportions,
            None if self.bend is None else self.bend[chosen],
            self.trial,
            None if self.drift is None else self.drift[chosen],
        )


@dataclass(frozen=True, eq=False)
class Terms:
    """What a law adds to the problem, see the top of this file.

    w          (nc, d) in the unit of u
    mu         (nc,)
    adhesion   (nc, d) r_c in the unit of r, None = none
    compliance (nc, d) the diagonal of C in units of u per unit of r, 0 = rigid; None = rigid
    scale      (nc, d) the diagonal of S, 1 = as it is; None = all
    frame      (nc, d, d) other directions T1, T2 for the contacts, None = as detected
    rolling    (nc,) [m] mu_r >= 0 of the cone of rolling friction, see `Rolling`; None = problems without rolling moments
    spinning   (nc,) [m] mu_s >= 0 of the moment about the normal, see `Spinning`; None = problems without
    """

    w: FloatArray
    mu: FloatArray
    adhesion: FloatArray | None = None
    compliance: FloatArray | None = None
    scale: FloatArray | None = None
    frame: FloatArray | None = None
    rolling: FloatArray | None = None
    spinning: FloatArray | None = None

    __repr__ = brief

    @classmethod
    def neutral(cls, contacts: Contacts) -> Terms:
        """Every term as an array that changes nothing: where several laws share the contacts, each writes its own into these."""
        nc, d = len(contacts), contacts.dimension
        return cls(
            w=np.zeros((nc, d)),
            mu=np.zeros(nc),
            adhesion=np.zeros((nc, d)),
            compliance=np.zeros((nc, d)),
            scale=np.ones((nc, d)),
            frame=contacts.frame.copy(),
            rolling=np.zeros(nc),
            spinning=np.zeros(nc),
        )


@dataclass(frozen=True, eq=False)
class Outcome:
    """What came of a step's contacts.

    terms  what the law gave
    u, r   (nc, d) of the problem: the law's own variables, r in the cone
    after  (nc, d) relative velocity H^T v at the end of the step; quasi-statics: increment [m]
    """

    terms: Terms
    u: FloatArray
    r: FloatArray
    after: FloatArray

    __repr__ = brief


@dataclass(frozen=True, eq=False)
class Remembered:
    """What a law keeps of a step: values by name, each (nc,) or (nc, c); stored [J] what its joints hold at the end of the step; breaking:
    what breaking them took."""

    values: Mapping[str, FloatArray] = field(default_factory=dict)
    stored: float = 0.0
    breaking: Breaking | None = None


class Law(Protocol):
    """A contact law; see the top of this file."""

    def select(self, contacts: Contacts, proportions: Proportions, variables: Variables | None) -> BoolArray:
        """Return which of the detected contacts take part (nc,)."""
        ...

    def terms(self, meeting: Meeting) -> Terms:
        """Return what the law adds to the step's problem."""
        ...

    def remember(self, meeting: Meeting, outcome: Outcome) -> Remembered:
        """Return what the law keeps of the step; variables of contacts that are not met again stay as they are."""
        ...


class Demand(NamedTuple):
    """A value that the terms of a step were made of, each (nc,) and of the order of 1: what was taken, what should have been, and between
    what it may lie; most, where finite, is its value at the beginning of the step."""

    tried: FloatArray
    wanted: FloatArray
    least: FloatArray
    most: FloatArray


@runtime_checkable
class Implicit(Protocol):
    """A law whose terms depend on the end of the step: it is solved again until what the law took for that, `Meeting.trial`, is what it
    finds."""

    def demands(self, meeting: Meeting, outcome: Outcome) -> Mapping[str, Demand]:
        """Return by name what the terms were made of; nothing where they cannot change."""
        ...
