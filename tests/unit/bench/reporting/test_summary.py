"""Summary tables against numbers computed by hand."""

import csv
import io
import math

import pytest

from fcsim.bench.reporting.comparison import Selection, compare
from fcsim.bench.reporting.summary import csv_text, duration, markdown, number, summarize, tables
from fcsim.bench.reporting.time_table import time_table
from fcsim.bench.results import Measurement
from fcsim.errors import InputError


def measurement(problem, solver, seconds, nc, status="SOLVED"):
    return Measurement(
        problem, "global", 3, nc, 60, "fcsim", solver, 1e-4, 16.0, None, status, status == "SOLVED", seconds, seconds, 5, 1e-5, None,
        "a machine", 1, "1", "2024-01-01T00:00:00+00:00",
    )  # fmt: skip


# problem, nc, A, B, C
ROWS = [
    ("P", 2, (1.0, "SOLVED"), (2.0, "SOLVED"), (4.0, "SOLVED")),
    ("Q", 4, (3.0, "SOLVED"), (3.0, "SOLVED"), (None, "KILLED_TIME")),
    ("R", 0, (5.0, "SOLVED"), (0.1, "WRONG"), (0.2, "CRASHED: signal 11")),
    ("S", 8, (9.0, "STAGNATED"), (16.0, "TIME_LIMIT"), (None, "KILLED_MEMORY")),
]


@pytest.fixture
def measurements():
    return [measurement(p, s, t, nc, status) for p, nc, *cells in ROWS for s, (t, status) in zip("ABC", cells, strict=True)]


def test_the_fastest_of_each_problem(measurements):
    summary = summarize(time_table(measurements, 1e-4))
    assert (summary.problems, summary.unsolved_by_all, summary.common) == (4, 1, 1)
    # fastest 1, 3, 5: mean 3, variance (4 + 0 + 4) / 3
    assert summary.fastest_mean == pytest.approx(3.0) and summary.fastest_deviation == pytest.approx(math.sqrt(8 / 3))
    # per contact, R has none: 1/2 and 3/4, mean 5/8, deviation 1/8
    assert summary.per_contact_mean == pytest.approx(0.625) and summary.per_contact_deviation == pytest.approx(0.125)
    # on Q, C ended at 16 s where 3 s was the best; on S nobody tells what the ratio is
    assert summary.censored_from == pytest.approx(16 / 3)


def test_each_solver(measurements):
    a, b, c = summarize(time_table(measurements, 1e-4)).solvers
    assert (a.solved, a.unsolved, a.at_time_limit, a.wrong, a.broken, a.won) == (3, 1, 0, 0, 0, 3)
    assert (b.solved, b.unsolved, b.at_time_limit, b.wrong, b.broken, b.won) == (2, 2, 1, 1, 0, 1)  # a tie on Q
    assert (c.solved, c.unsolved, c.at_time_limit, c.wrong, c.broken, c.won) == (1, 3, 1, 0, 2, 0)
    assert a.ratio == pytest.approx(1.0) and b.ratio == pytest.approx(math.sqrt(2)) and c.ratio == pytest.approx(4.0)
    assert (a.common_ratio, b.common_ratio, c.common_ratio) == pytest.approx((1.0, 2.0, 4.0))
    assert a.speedup is None


def test_faster_than_a_reference(measurements):
    a, b, c = summarize(time_table(measurements, 1e-4), "C").solvers
    # both solved P only: 4/1; with 16 s for C's time on Q: (4/1 16/3)^(1/2)
    assert (a.speedup, a.both, a.bounded) == (pytest.approx(4.0), 1, 2)
    assert a.speedup_bound == pytest.approx(math.sqrt(4 * 16 / 3))
    assert b.speedup == pytest.approx(2.0) and b.speedup_bound == pytest.approx(math.sqrt(2 * 16 / 3))
    assert c.speedup == pytest.approx(1.0) and c.bounded == 1


def test_a_solver_that_solves_nothing(measurements):
    rows = [*measurements, *(measurement(p, "D", None, nc, "KILLED_TIME") for p, nc, *_ in ROWS)]
    summary = summarize(time_table(rows, 1e-4), "D")
    last = summary.solvers[-1]
    assert last.solved == last.won == last.both == 0 and math.isnan(last.ratio) and math.isnan(last.speedup)
    assert summary.common == 0 and math.isnan(summary.solvers[0].common_ratio)
    # of D only the limit is known: A is faster by at least (16/1 16/3 16/5)^(1/3)
    assert math.isnan(summary.solvers[0].speedup) and summary.solvers[0].speedup_bound == pytest.approx((16**3 / 15) ** (1 / 3))
    assert "| D | 0 | 4 | 4 | 0 | 0 | 0 | – | – |" in markdown([summary])
    assert {row["ratio"] for row in csv.DictReader(io.StringIO(csv_text([summary]))) if row["solver"] == "D"} == {""}


def test_nothing_solved_at_all():
    rows = [measurement("P", "A", None, 2, "CRASHED")]
    summary = summarize(time_table(rows, 1e-4))
    assert summary.unsolved_by_all == 1 and math.isnan(summary.fastest_mean) and summary.censored_from == math.inf


def test_tables_say_the_same(measurements):
    comparison = compare(measurements, Selection(reference="C"))
    (_, header, (first,)), (title, columns, rows) = tables(comparison.summaries)
    assert dict(zip(header, first, strict=True)) == {
        "tolerance": "1e-4", "problems": "4", "solved by none": "1", "solved by all": "1", "mean": "3 s",
        "standard deviation": "1.63 s", "mean per contact": "625 ms", "deviation per contact": "125 ms",
    }  # fmt: skip
    assert title == "Tolerance 1e-4" and [row[0] for row in rows] == ["A", "B", "C"]
    assert dict(zip(columns, rows[1], strict=True)) == {
        "solver": "B", "solved": "2", "unsolved": "2", "time limit": "1", "wrong": "1", "broken": "0", "won": "1", "ratio": "1.41",
        "common ratio": "2", "faster than C": "2 (1)", "at least": "3.27 (2)",
    }  # fmt: skip
    text = markdown(comparison.summaries)
    assert "| B | 2 | 2 | 1 | 1 | 0 | 1 | 1.41 | 2 | 2 (1) | 3.27 (2) |" in text and "Faster than C" in text
    read = list(csv.DictReader(io.StringIO(csv_text(comparison.summaries))))
    assert [row["solver"] for row in read] == ["A", "B", "C"] and float(read[1]["ratio"]) == pytest.approx(math.sqrt(2), rel=1e-15)
    assert read[0]["fastest_mean"] == "3.0"


def test_numbers():
    assert [number(v) for v in (None, math.nan, math.inf, 0.1234, 12.34, 12345.6)] == ["–", "–", "–", "0.123", "12.3", "12346"]
    assert [duration(v) for v in (0.9996, 0.9994, 9.996e-4)] == ["1 s", "999 ms", "1 ms"]
    assert [duration(v) for v in (12.34, 0.01234, 1.234e-5, math.nan)] == ["12.3 s", "12.3 ms", "12.3 µs", "–"]


def test_no_measurements():
    with pytest.raises(InputError, match="at least one measurement"):
        compare([])
