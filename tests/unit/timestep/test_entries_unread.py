"""The steps of a wall of deformable bricks go by products with W: its entries are summed for its factor, not at every step."""

from __future__ import annotations

from pathlib import Path

import pytest

from fcsim.arrays import FloatArray
from fcsim.problem.by_bodies.shares import BodiesShares
from fcsim.running.case import load_case
from fcsim.running.parameters import parse_parameters
from fcsim.solvers.base import Status

WALL = Path(__file__).resolve().parents[3] / "cases" / "masonry_wall"


def test_entries_are_summed_for_a_factor_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first loaded step factors W, the next ones go on with that factor."""
    sums: list[int] = []
    entries, number = BodiesShares.entries, 1

    def counted(shares: BodiesShares) -> FloatArray:
        sums.append(number)
        return entries(shares)

    monkeypatch.setattr(BodiesShares, "entries", counted)
    script = load_case(WALL)
    case = script.build(parse_parameters(script, {"steps": "8"}))
    for step in case.simulation:
        assert step.result.status is Status.SOLVED
        number = step.number + 1
    assert sums == [2]
