"""Rows and products that ranks make in parts are on all of them, bit for bit, what one process makes."""

from __future__ import annotations

import json
from typing import Any

import pytest

from tests.unit.ranks import parts
from tests.unit.ranks.conftest import OnRanks


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("one")
    parts.main(folder)
    return json.loads((folder / "0.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("ranks", [3, pytest.param(2, marks=pytest.mark.slow)])
def test_parts_are_those_of_one_process(on_ranks: OnRanks, expected: Any, ranks: int) -> None:
    found = on_ranks("parts", ranks)
    for own in found:
        for name in ("rows", "few", "several", "alone"):
            assert own[name][0] == expected[name][0]
        assert own["products"] == expected["products"] and own["largest"] == expected["largest"]
        assert own["vectors"] == expected["vectors"]
        assert own["sent"] and own["kept"] == expected["kept"] and own["held"] == expected["held"]
        common = own["common"]
        assert common["digests"] == expected["common"]["digests"]
        assert common["sent"] < 1000 and common["still"] and not common["grows"]  # 480 000 bytes are written a time
        assert own["runs"] == expected["runs"] and own["runs"][1]
        assert own["refused"] == [expected["refused"][0], False]
        assert own["few"][1] == own["alone"][1] == expected["rows"][1] == 1001
    for name, count in (("rows", 1001), ("several", 2)):
        made = [own[name][1] for own in found]
        assert sum(made) == count and max(made) - min(made) <= 1  # each rank as many
    assert all(own["entered"][0] == expected["entered"][0] for own in found)
    looks = [own["entered"][1] for own in found]
    assert expected["entered"][1] == sum(looks) == 2 and max(looks) == 1
