"""Laws side by side in one model: each has its own contacts, and every term that it gives arrives there."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.testing import assert_array_equal

from fcsim.assembly.model import build_model
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.general.everything import Everything
from fcsim.contact_law.law import Meeting, Terms, Timing
from fcsim.contact_law.proportions import proportions
from fcsim.contact_law.table import LawTable
from fcsim.mesh.blocks import rigid_box


@dataclass(frozen=True)
class Whole:
    """A law that gives every term there is, drawn at random."""

    seed: int

    def drawn(self, contacts: Contacts) -> Terms:
        random = np.random.default_rng(self.seed)
        neutral = Terms.neutral(contacts)
        return Terms(**{field.name: random.uniform(1.0, 2.0, getattr(neutral, field.name).shape) for field in fields(Terms)})

    def terms(self, meeting: Meeting) -> Terms:
        return self.drawn(meeting.contacts)


@dataclass(frozen=True)
class Bare(Whole):
    """One that gives w and mu alone."""

    def terms(self, meeting: Meeting) -> Terms:
        drawn = self.drawn(meeting.contacts)
        return Terms(drawn.w, drawn.mu)


def test_every_term_of_a_law_arrives_at_its_own_contacts() -> None:
    model = build_model([rigid_box(name, (1, 1, 1), (0, 0, z), 1.0) for name, z in (("a", 0.0), ("b", 1.0))])
    contacts = Everything(model, mu=0.5)(model.reference)
    timing = Timing(h=1e-3, theta=0.5, length_per_u=1e-3, force_per_reaction=1e3)
    meeting = Meeting(contacts, model.reference, np.zeros((len(contacts), 3)), 0.0, timing, None, proportions(model))
    number = np.arange(len(contacts)) % 2
    assert len(contacts) == 4

    def joined(*laws: Whole) -> Terms:
        return LawTable(laws, lambda of: number[np.isin(contacts.identity, of.identity)]).terms(meeting)  # type: ignore[arg-type]

    whole, bare = Whole(1), Bare(2)
    terms, alone = joined(whole, bare), joined(bare, bare)
    own, neutral = whole.drawn(contacts.take(number == 0)), Terms.neutral(contacts.take(number == 1))
    for field in fields(Terms):
        assert_array_equal(getattr(terms, field.name)[number == 0], getattr(own, field.name))
        if field.name not in ("w", "mu"):
            assert_array_equal(getattr(terms, field.name)[number == 1], getattr(neutral, field.name))
            assert getattr(alone, field.name) is None  # a problem without it
