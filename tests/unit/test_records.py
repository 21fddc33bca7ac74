"""JSON and CSV as people and programs write them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from fcsim.errors import InputError
from fcsim.records import read_json, read_record
from fcsim.tables import read_rows


@dataclass(frozen=True)
class Weight:
    kg: float


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_a_mark_at_the_beginning_is_no_content(tmp_path: Path, encoding: str) -> None:
    (tmp_path / "a.json").write_text('{"kg": 2}', encoding=encoding)
    (tmp_path / "a.csv").write_text("ä,b\n1,2\n", encoding=encoding)
    assert read_record(Weight, tmp_path / "a.json") == Weight(2.0)
    assert read_rows(tmp_path / "a.csv") == [["ä", "b"], ["1", "2"]]


@pytest.mark.parametrize("text", ['{"kg": 1, "kg": 2}', '{"a": [{"b": 1, "c": 2, "b": 3}]}'])
def test_a_key_that_comes_twice_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(InputError, match=r"a\.json: expected JSON: the key '(kg|b)' comes twice in one object"):
        read_json(tmp_path / "a.json")


@pytest.mark.parametrize("number", ["1" + "0" * 400, "1e400", "NaN", "-Infinity"])
def test_numbers_that_no_float_holds_are_refused(tmp_path: Path, number: str) -> None:
    (tmp_path / "a.json").write_text(f'{{"kg": {number}}}')
    with pytest.raises(InputError, match=r"a\.json, 'kg': expected a finite number"):
        read_record(Weight, tmp_path / "a.json")


@pytest.mark.parametrize("encoding", ["utf-16", "latin-1"])
def test_other_encodings_are_named(tmp_path: Path, encoding: str) -> None:
    (tmp_path / "a.json").write_text('{"ä": 1}', encoding=encoding)
    with pytest.raises(InputError, match=r"a\.json: expected JSON: 'utf-8' codec"):
        read_json(tmp_path / "a.json")


@pytest.mark.parametrize("text", ['{"title": "\\ud800"}', '{"\\uDFFF": 1}'])
def test_half_a_character_is_refused(tmp_path: Path, text: str) -> None:
    """No file of ours could take it: a run ended at its first FCLIB file."""
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(InputError, match=r"a\.json: expected JSON: .*surrogates not allowed"):
        read_json(tmp_path / "a.json")
    (tmp_path / "b.json").write_text('{"title": "\\ud83e\\uddf1"}')
    assert read_json(tmp_path / "b.json") == {"title": "\U0001f9f1"}
