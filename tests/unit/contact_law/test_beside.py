"""What new contacts of sliding bodies go on with: the nearest of the same two bodies, in any unit of length."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fcsim.contact_law.friction import BESIDE, SEAT, as_beside


class _Two(SimpleNamespace):
    """Attributes of two contacts."""

    def __len__(self) -> int:
        return 2


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e3, 1e6])
@pytest.mark.parametrize(
    ("others", "away", "expected"),
    [([2, 0], 1e-3, [1.0, 0.0]), ([0, 1], 0.9 * BESIDE, [1.0, 1.0]), ([0, 1], 1.1 * BESIDE, [1.0, 0.0])],
    ids=["of another body", "the other way round", "too far off"],
)
def test_a_new_contact_has_the_slip_of_one_of_its_own_bodies(others: list[int], away: float, expected: list[float], unit: float) -> None:
    """A contact of bodies 0 and 1 bore, at the origin; two of bodies of size 1 are new, one of the same two beside it, and another."""
    earlier = {"slip": np.array([3.0 * unit]), SEAT: np.array([[0.0, 1.0, 0.0, 0.0]])}
    contacts = _Two(bodies=np.array([[1, 0], others]), point=unit * np.array([[1e-3, 0.0], [away, 0.0]]))
    meeting: Any = _Two(
        recall=lambda name, default: default, variables=SimpleNamespace(values=earlier), contacts=contacts, size=np.full(2, unit)
    )
    assert (as_beside(meeting, "slip") / (3.0 * unit)).tolist() == expected
