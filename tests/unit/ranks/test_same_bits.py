"""Ranks that share a simulation find what one process finds, bit by bit: contacts, statuses, cut steps, states, reactions, energies."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

import pytest

from tests.unit.ranks.conftest import OnRanks
from tests.unit.ranks.scenarios import SCENARIOS, seen


@cache
def alone(name: str) -> dict[str, Any]:
    return json.loads(json.dumps(seen(SCENARIOS[name])))  # type: ignore[no-any-return]


@pytest.mark.parametrize("ranks", [3, *(pytest.param(ranks, marks=pytest.mark.slow) for ranks in (2, 4))])
@pytest.mark.parametrize("name", SCENARIOS)
def test_the_same_bits(on_ranks: OnRanks, name: str, ranks: int) -> None:
    wanted = alone(name)
    for answer in on_ranks("scenarios", ranks):
        got = answer["seen"][name]
        assert got["steps"] == wanted["steps"] and got["digest"] == wanted["digest"]
        assert len(set(got["owners"])) > 1, "all bodies are one rank's: nothing was shared"


def test_the_scenarios_are_what_they_say() -> None:
    assert all(any(step[0] > 0 for step in alone(name)["steps"]) for name in SCENARIOS)
    assert any(step[2] > 1 for step in alone("steps that are cut")["steps"])


def test_what_is_sent_is_counted(on_ranks: OnRanks) -> None:
    answers = on_ranks("scenarios", 3)
    assert len({answer["sent"][0] for answer in answers}) == 1  # all take part in every exchange
    assert all(answer["sent"][1] <= 2 * answer["sent"][0] and answer["sent"][2] > 0 for answer in answers)
