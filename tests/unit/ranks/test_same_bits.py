"""Ranks that share a simulation find what one process finds, bit by bit: contacts, statuses, cut steps, states, reactions, energies."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from tests.unit.ranks.conftest import Ended, Program
from tests.unit.ranks.scenarios import SCENARIOS, seen

PROGRAM = Path(__file__).with_name("scenarios.py")


@cache
def alone(name: str) -> dict[str, Any]:
    return json.loads(json.dumps(seen(SCENARIOS[name])))  # type: ignore[no-any-return]


Shared = Callable[[int], list[dict[str, Any]]]


@pytest.fixture(scope="module")
def shared(mpiexec: Program) -> Shared:
    """What each of so many ranks has seen; their hash seeds differ, as those of processes do."""

    @cache  # of a failure too: each test would begin the ranks anew
    def ended(ranks: int) -> Ended:
        for name in SCENARIOS:  # first, so that the ranks find compiled what one process computes with: each would compile it
            alone(name)
        return mpiexec(ranks, PROGRAM, env={"PYTHONPATH": str(Path(__file__).parents[3])})

    def of(ranks: int) -> list[dict[str, Any]]:
        assert ended(ranks).code == 0, ended(ranks).err
        found = [json.loads(line) for line in ended(ranks).out.splitlines() if line.startswith("{")]
        assert sorted(answer["rank"] for answer in found) == list(range(ranks))
        return found

    return of


@pytest.mark.parametrize("ranks", [3, *(pytest.param(ranks, marks=pytest.mark.slow) for ranks in (2, 4))])
@pytest.mark.parametrize("name", SCENARIOS)
def test_the_same_bits(shared: Shared, name: str, ranks: int) -> None:
    wanted = alone(name)
    for answer in shared(ranks):
        got = answer["seen"][name]
        assert got["steps"] == wanted["steps"] and got["digest"] == wanted["digest"]
        assert len(set(got["owners"])) > 1, "all bodies are one rank's: nothing was shared"


def test_the_scenarios_are_what_they_say() -> None:
    assert all(any(step[0] > 0 for step in alone(name)["steps"]) for name in SCENARIOS)
    assert any(step[2] > 1 for step in alone("steps that are cut")["steps"])


def test_what_is_sent_is_counted(shared: Shared) -> None:
    answers = shared(3)
    assert len({answer["sent"][0] for answer in answers}) == 1  # all take part in every exchange
    assert all(answer["sent"][1] <= 2 * answer["sent"][0] and answer["sent"][2] > 0 for answer in answers)
