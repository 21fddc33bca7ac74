"""A time limit ends a solve that ranks share on all of them at the same iteration, whatever their clocks say."""

from __future__ import annotations

from tests.unit.ranks.conftest import OnRanks


def test_a_time_limit_is_that_of_one_clock(on_ranks: OnRanks) -> None:
    first, second = on_ranks("clocks", 2)
    assert first == second
    assert first["iterations"] > 10
    assert first["status"] == first["alone"] == "TIME_LIMIT"
