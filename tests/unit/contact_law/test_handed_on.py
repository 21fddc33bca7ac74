"""Which contact takes what another one remembered: the nearest of the same bodies, once, and none that is too far or carried itself."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fcsim.contact_detection.contacts import EXACT, KIND, Contacts
from fcsim.contact_law.handed_on import handed_on, places
from fcsim.contact_law.law import NOTHING, Remembered

FACETS, PLANES = EXACT + (4 << KIND), EXACT + (1 << KIND)
ABOUT: Any = SimpleNamespace(first=np.array([0, 1, 2]), size=np.array([0.2, 0.2, 9.0]))
STILL = np.array([[0.0, 0.0, 0.1], [1.0, 0.0, 0.1], [0.0, 0.0, -5.0]])


def contacts(identity: Any, x: Any, slave: Any) -> Contacts:
    n = len(identity)
    point = np.column_stack([x, np.zeros((n, 2))]).astype(float)
    frame = np.tile(np.eye(3)[[2, 0, 1]], (n, 1, 1))
    bodies = np.column_stack([slave, np.full(n, 2)]).astype(np.int64)
    nothing = np.zeros((n, 1))
    return Contacts(point, frame, np.zeros(n), np.zeros(n), nothing.astype(np.int64), nothing, bodies, np.asarray(identity, dtype=np.int64))


def remembered(met: Contacts, r_N: Any) -> Any:
    """Each contact remembers its place in the list, from 1 on."""
    values = {"slip": np.arange(1.0, 1 + len(met))}
    meeting: Any = SimpleNamespace(contacts=met, positions=STILL, proportions=ABOUT)
    outcome: Any = SimpleNamespace(r=np.column_stack([r_N, np.zeros((len(met), 2))]))
    return NOTHING.merged(met.identity, {**values, **places(meeting, outcome, Remembered(values))}, 2.5)


def slips(variables: Any, met: Contacts) -> Any:
    return variables.of("slip", met.identity, np.zeros(len(met)))


@pytest.mark.parametrize("kind", [FACETS, PLANES])
def test_the_nearest_of_the_same_bodies_takes_it(kind: int) -> None:
    """Two contacts of a body and one of another; of other kinds nothing is handed on."""
    variables = remembered(contacts(kind + np.array([1, 2, 3]), [0.0, 0.015, 0.001], [0, 0, 1]), [1.0, 1.0, 1.0])
    met = contacts(kind + np.array([4, 5, 6, 7]), [0.016, 0.002, 0.001, -0.019], [0, 0, 1, 0])
    after = handed_on(variables, met, STILL, ABOUT)
    assert slips(after, met) == pytest.approx([2, 1, 3, 0] if kind == FACETS else [0, 0, 0, 0])
    assert after is variables or (np.all(np.diff(after.identity) > 0) and after.stored == 2.5)


def test_none_is_taken_twice_nor_from_afar_nor_by_what_carried_itself() -> None:
    variables = remembered(contacts(FACETS + np.array([1, 2, 3]), [0.0, 0.001, 0.5], [0, 0, 1]), [1.0, 1.0, 0.0])
    both = contacts(FACETS + np.array([2, 5]), [0.001, 0.021], [0, 0])
    assert slips(handed_on(variables, both, STILL, ABOUT), both) == pytest.approx([2, 0])  # 21 mm from where it was lost
    moved = STILL + np.array([[0.002, 0, 0], [0, 0, 0], [0, 0, 0]])
    assert slips(handed_on(variables, both, moved, ABOUT), both) == pytest.approx([2, 1])  # of which the body went 2
    idle = contacts(FACETS + np.array([3, 6]), [0.5, 0.5], [1, 1])
    assert slips(handed_on(variables, idle, STILL, ABOUT), idle) == pytest.approx([3, 0])  # what did not carry leaves nothing


def test_one_that_comes_to_where_another_had_been_keeps_its_own() -> None:
    """A contact that had not carried takes the comer's; the comer's former identity is then unknown."""
    variables = remembered(contacts(FACETS + np.array([1, 2]), [0.0, 0.01], [0, 0]), [1.0, 0.0])
    met = contacts([FACETS + 2], [0.01], [0])
    after = handed_on(variables, met, STILL, ABOUT)
    assert after is not None and after.identity.tolist() == [FACETS + 2] and slips(after, met) == pytest.approx([1])
