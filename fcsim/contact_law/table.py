"""Several laws in one model: one for each pair of bodies or each pair of surfaces."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.contact_detection import Detector
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_law.law import Breaking, Demand, Implicit, Law, Meeting, Outcome, Remembered, Terms, Variables
from fcsim.contact_law.proportions import Proportions
from fcsim.errors import MODEL, InputError, expect


@dataclass(frozen=True, eq=False)
class LawTable:
    """The laws and which of them a contact obeys: number_of(contacts) (nc,), the same for a contact at every step.

    Made by `laws_of_bodies` or `laws_of_pairs`. Each law sees its own contacts and its own variables only.
    """

    laws: tuple[Law, ...]
    number_of: Callable[[Contacts], IntArray]
    names: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"LawTable({', '.join(f'{name}: {law!r}' for name, law in zip(self.names, self.laws, strict=False))})"

    def select(self, contacts: Contacts, proportions: Proportions, variables: Variables | None) -> BoolArray:
        number = self.number_of(contacts)
        chosen = np.zeros(len(contacts), dtype=bool)
        for k, law in enumerate(self.laws):
            own = number == k
            chosen[own] = law.select(contacts.take(own), proportions, _own(variables, k))
        return chosen

    def terms(self, meeting: Meeting) -> Terms:
        number = self.number_of(meeting.contacts)
        parts = [(number == k, law.terms(self._part(meeting, number, k))) for k, law in enumerate(self.laws)]
        neutral, joined = Terms.neutral(meeting.contacts), dict[str, FloatArray | None]()
        for field in fields(Terms):
            given = [(own, value) for own, terms in parts if (value := getattr(terms, field.name)) is not None]
            whole = getattr(neutral, field.name)
            for own, value in given:
                whole[own] = value
            joined[field.name] = whole if given else None  # None: a problem without it
        return Terms(**joined)  # type: ignore[arg-type] # by the names of its fields

    def remember(self, meeting: Meeting, outcome: Outcome) -> Remembered:
        number = self.number_of(meeting.contacts)
        values: dict[str, FloatArray] = {}
        stored, breaking = 0.0, Breaking()
        for k, law in enumerate(self.laws):
            own = number == k
            kept = law.remember(self._part(meeting, number, k), _part_of(outcome, own))
            stored += kept.stored
            breaking += kept.breaking or Breaking()
            for name, value in kept.values.items():
                values.setdefault(name, np.full((len(meeting), *value.shape[1:]), np.nan))[own] = value
        return Remembered({**values, "law": number.astype(np.float64)} if values else {}, stored, breaking)

    def demands(self, meeting: Meeting, outcome: Outcome) -> dict[str, Demand]:
        """Those of its implicit laws; 0 at the contacts of others."""
        number, demands = self.number_of(meeting.contacts), dict[str, Demand]()
        for k, law in enumerate(self.laws):
            own = number == k
            if not (isinstance(law, Implicit) and own.any()):
                continue
            for name, demand in law.demands(self._part(meeting, number, k), _part_of(outcome, own)).items():
                whole = demands.setdefault(name, Demand(*np.zeros((4, len(number)))))
                for all_of_it, part in zip(whole, demand, strict=True):
                    all_of_it[own] = part
        return demands

    @staticmethod
    def _part(meeting: Meeting, number: IntArray, k: int) -> Meeting:
        return replace(meeting.taken(number == k), variables=_own(meeting.variables, k))


def laws_of_bodies(model: Model, laws: Mapping[str | tuple[str, str], Law], default: Law) -> LawTable:
    """Return the table of laws for the contacts of two bodies, ("brick", "floor"), or of one body with whatever it touches, "floor".

    A pair of names goes before a single one, of two single ones the first given; `default` holds elsewhere.
    """
    expect(model, Model, "laws_of_bodies, model", MODEL)
    expect(laws, Mapping, "laws_of_bodies, laws", "a table, as {'floor': Gap()}")
    order = list(laws)
    count = len(model.bodies)
    single = np.full(count, len(order) + 1)
    pairs: dict[int, int] = {}
    for k, key in enumerate(order):
        names = (key,) if isinstance(key, str) else tuple(key)
        if len(names) not in (1, 2):
            raise InputError(f"laws: expected a body's name or two names as key, got {key!r}")
        numbers = sorted(model.body_number(name) for name in names)
        if len(numbers) == 1:
            single[numbers[0]] = min(single[numbers[0]], k + 1)
        elif numbers[0] * count + numbers[1] in pairs:
            raise InputError(f"laws: expected one law for {names[0]!r} and {names[1]!r}, in either order, got two")
        else:
            pairs[numbers[0] * count + numbers[1]] = k + 1
    known = np.array(sorted(pairs), dtype=np.int64)
    law_of_known = np.array([pairs[key] for key in sorted(pairs)], dtype=np.int64)

    def number_of(contacts: Contacts) -> IntArray:
        low, high = np.sort(contacts.bodies, axis=1).T
        number = single[contacts.bodies].min(axis=1, initial=len(order) + 1)
        number[number > len(order)] = 0
        if len(known):
            key = low * count + high
            place = np.minimum(np.searchsorted(known, key), len(known) - 1)
            number = np.where(known[place] == key, law_of_known[place], number)
        return number

    names = ("default", *(key if isinstance(key, str) else " on ".join(key) for key in order))
    return LawTable((default, *(laws[key] for key in order)), number_of, names)


def laws_of_pairs(detector: Detector, laws: Mapping[str, Law], default: Law) -> LawTable:
    """Return the table of laws for the named surface pairs of a detector; `default` holds for the others."""
    expect(detector, Detector, "laws_of_pairs, detector", "Detector([SurfacePair(...)], model.n_nodes)")
    named: Sequence[str] = [pair.name for pair in detector.pairs]
    for name in laws:
        if name not in named or not name:
            raise InputError(f"laws: expected names of surface pairs among {', '.join(map(repr, named))}, got {name!r}")
    order = list(laws)
    law_of_pair = np.array([1 + order.index(name) if name in laws else 0 for name in named], dtype=np.int64)
    ascending = np.argsort(detector.first_identity, kind="stable")
    first = detector.first_identity[ascending]

    def number_of(contacts: Contacts) -> IntArray:
        return law_of_pair[ascending[np.searchsorted(first, contacts.identity, side="right") - 1]]

    return LawTable((default, *(laws[name] for name in order)), number_of, ("default", *order))


def _own(variables: Variables | None, k: int) -> Variables | None:
    """The variables of a law's own contacts."""
    if variables is None or "law" not in variables.values:
        return variables
    own = variables.values["law"] == k
    return Variables(variables.identity[own], {name: value[own] for name, value in variables.values.items()})


def _part_of(outcome: Outcome, own: BoolArray) -> Outcome:
    given = {field.name: getattr(outcome.terms, field.name) for field in fields(Terms)}
    terms = Terms(**{name: None if value is None else value[own] for name, value in given.items()})  # type: ignore[arg-type] # likewise
    return Outcome(terms, outcome.u[own], outcome.r[own], outcome.after[own])
