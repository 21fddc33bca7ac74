"""The results table: what is appended is read back, torn lines are dropped, and what is wrong in a table is named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from fcsim.bench.results import FIELDS, Measurement, append, read_results
from fcsim.errors import InputError

ROW = Measurement(
    problem="Wall-i0002-17-1",
    form="global",
    dimension=3,
    nc=17,
    n=120,
    program="fcsim",
    solver="NSN-AC",
    tol=1e-4,
    time_limit=100.0,
    memory_limit=None,
    status="SOLVED",
    solved=True,
    seconds=0.1 + 0.2,  # not a short decimal
    cpu_seconds=0.25,
    iterations=7,
    error=3.3e-5,
    flops=None,
    machine="host",
    threads=1,
    version="0.1.0",
    started="2025-01-01T00:00:00+00:00",
)
KILLED = replace(
    ROW, solver="Siconos:NSGS", status='CRASHED: signal 11, "no", it said', solved=False, seconds=None, iterations=None, error=float("inf")
)


def test_rows_come_back_as_they_were(tmp_path: Path) -> None:
    rows = [ROW, KILLED, replace(ROW, problem='Ünï,"quoted"  name', memory_limit=2048.0)]
    for row in rows:
        append(tmp_path, row)
    assert read_results(tmp_path) == read_results(tmp_path / "results.csv") == rows
    assert (tmp_path / "results.csv").read_text(encoding="utf-8").splitlines()[0] == ",".join(FIELDS)
    assert KILLED.outcome == "CRASHED"


def test_a_message_of_several_lines_stays_one_row(tmp_path: Path) -> None:
    append(tmp_path, replace(KILLED, status="CRASHED: one\ntwo\u2028three"))
    [row] = read_results(tmp_path)
    assert row.status == "CRASHED: one two three"


def test_every_torn_end_is_dropped_and_overwritten(tmp_path: Path) -> None:
    table = tmp_path / "results.csv"
    append(tmp_path, ROW)
    one = table.read_bytes()
    append(tmp_path, KILLED)
    both = table.read_bytes()
    for cut in range(len(both)):
        table.write_bytes(both[:cut])
        assert read_results(tmp_path) == ([ROW] if cut >= len(one) else [])
    for cut in (0, 10, len(one) - 3, len(one), len(both) - 1):
        table.write_bytes(both[:cut])
        before = read_results(tmp_path)
        append(tmp_path, KILLED)
        assert read_results(tmp_path) == [*before, KILLED]


def test_a_measurement_made_again_takes_the_place_of_the_first(tmp_path: Path) -> None:
    stopped = replace(ROW, status="TIME_LIMIT", solved=False, time_limit=1.0)
    for row in (stopped, KILLED, ROW):
        append(tmp_path, row)
    assert read_results(tmp_path) == [ROW, KILLED]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("Wall-i0002-17-1,global,3", "Wall-i0002-17-1,global,three", r"line 2, column dimension: expected a whole number, got 'three'"),
        ("true", "perhaps", r"column solved: expected true or false, got 'perhaps'"),
        ("SOLVED", "DONE", r"column status: expected one of SOLVED, .*, got 'DONE'"),
        (",host,", ",", r"line 2: expected 22 columns, got 21"),
        ("problem,form", "problem,shape", r"expected the columns problem,form,.*; got problem,shape"),
        ("3.3e-05", "small", r"column error: expected a number, got 'small'"),
    ],
)
def test_what_is_wrong_in_a_table_is_named(tmp_path: Path, old: str, new: str, said: str) -> None:
    append(tmp_path, ROW)
    table = tmp_path / "results.csv"
    text = table.read_text(encoding="utf-8")
    assert old in text
    table.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=said) as caught:
        read_results(tmp_path)
    assert str(table) in str(caught.value)


def test_a_missing_table_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected a table of fcsim bench"):
        read_results(tmp_path / "nothing")
    with pytest.raises(InputError, match=r"results\.csv"):
        read_results(tmp_path)
