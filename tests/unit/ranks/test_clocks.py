"""A time limit ends a solve that ranks share on all of them at the same iteration, whatever their clocks say."""

from __future__ import annotations

import json
from pathlib import Path

from tests.unit.ranks.conftest import Program


def test_a_time_limit_is_that_of_one_clock(mpiexec: Program, tmp_path: Path) -> None:
    ended = mpiexec(2, Path(__file__).with_name("clocks.py"), tmp_path)
    assert ended.code == 0, ended.err
    first, second = (json.loads((tmp_path / f"{rank}.json").read_text(encoding="utf-8")) for rank in range(2))
    assert first == second
    assert first["iterations"] > 10
    assert first["status"] == first["alone"] == "TIME_LIMIT"
