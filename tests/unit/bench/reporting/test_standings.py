"""Standings against figures computed by hand: who solves what, sums with the time limit for the unsolved, problems without a solution."""

import math

import pytest

from fcsim.bench.reporting.leaderboard import every_solver, failures, group_table, heading, overview
from fcsim.bench.reporting.standings import ALL, groups, refusals, standings
from fcsim.bench.results import Measurement
from fcsim.errors import InputError

LIMIT = 10.0


def measured(problem: str, solver: str, seconds: float | None, status: str = "SOLVED", dimension: int = 3, nc: int = 4) -> Measurement:
    """A row; seconds by the wall, twice as many of the processor."""
    return Measurement(
        problem=problem,
        form="global",
        dimension=dimension,
        nc=nc,
        n=6 * nc,
        program="fcsim",
        solver=solver,
        tol=1e-8,
        time_limit=LIMIT,
        memory_limit=None,
        status=status,
        solved=status == "SOLVED",
        seconds=seconds,
        cpu_seconds=None if seconds is None else 2 * seconds,
        iterations=1,
        error=1e-9,
        flops=None,
        machine="m",
        threads=1,
        version="1",
        started="2026-01-01T00:00:00+00:00",
    )


OF = {("p", "global"): ("piles", "Piles.", True), ("q", "global"): ("piles", "Piles.", True), ("s", "global"): ("stuck", "Stuck.", False)}
OF |= {("t", "global"): ("towers", "Towers.", None), ("k", "global"): ("piles", "Piles.", True)}
ROWS = [
    measured("p", "A", 1.0),
    measured("p", "B", 2.0),
    measured("q", "A", 8.0),
    measured("q", "B", None, "KILLED_TIME: late"),
    measured("t", "A", 3.0, nc=9),
    measured("t", "B", 0.75, nc=9),
    measured("k", "A", 1.0, "STAGNATED"),
    measured("k", "B", 1.0, "MAX_ITERATIONS"),
    measured("s", "A", 0.5, "INFEASIBLE"),
    measured("s", "B", None, "CRASHED: signal 11"),
]


def test_figures_of_a_group() -> None:
    piles = groups(ROWS, OF, 1e-8)[0]
    assert (piles.name, piles.problems) == ("piles", [("k", "global"), ("p", "global"), ("q", "global")])
    a, b = standings(piles)
    assert (a.solver, a.solved, a.measured, a.bound) == ("A", 2, 3, 0)
    assert (a.median, a.total, a.to_best, a.ratio, a.worst) == (8.0, 9.0, 1.0, pytest.approx(1.0), 1.0)
    # q was not solved: 2 s and the limit of 10 s; k by none: in no sum
    assert (b.solver, b.solved, b.measured, b.bound) == ("B", 1, 3, 1)
    assert (b.median, b.total, b.to_best) == (math.inf, 12.0, pytest.approx(12 / 9))
    assert (b.ratio, b.worst) == (pytest.approx(2.0), 2.0)


def test_all_leaves_out_what_has_no_solution() -> None:
    found = groups(ROWS, OF, 1e-8)
    assert [group.name for group in found] == ["piles", "stuck", "towers", ALL]
    whole = found[-1]
    assert {name for name, _ in whole.problems} == {"p", "q", "t", "k"} and heading(whole) == "all, 3D: 4 problems of 4 to 9 contacts"
    a, b = standings(whole)
    assert (a.total, b.total) == (12.0, 12.75)
    assert a.ratio == pytest.approx((1 * 1 * 4) ** (1 / 3)) and a.worst == 4.0
    assert b.ratio == pytest.approx(2**0.5)


def test_the_clock_is_the_one_asked_for() -> None:
    a, b = standings(groups(ROWS, OF, 1e-8)[0], "cpu")
    assert (a.solver, a.total, b.solver, b.total) == ("A", 18.0, "B", 14.0)


def test_a_solver_is_counted_on_what_it_is_made_for() -> None:
    """One that was measured on a part of the problems is compared on that part, and is in no profile."""
    rows = [*ROWS, measured("p", "C", 0.5)]
    piles = groups(rows, OF, 1e-8)[0]
    by = {row.solver: row for row in standings(piles)}
    assert (by["C"].solved, by["C"].measured, by["C"].total, by["C"].to_best) == (1, 1, 0.5, 1.0)
    assert by["A"].to_best == 1.0 and by["A"].worst == 2.0
    assert piles.solvers_of_all == ["A", "B"]


def test_dimensions_are_apart() -> None:
    flat = [measured("d", "A", 1.0, dimension=2), measured("e", "A", 1.0, dimension=2)]
    of = OF | {("d", "global"): ("piles", "Piles.", True), ("e", "global"): ("slabs", "Slabs.", True)}
    names = [(group.name, group.dimension) for group in groups([*ROWS, *flat], of, 1e-8)]
    assert names == [("piles", 3), ("piles", 2), ("stuck", 3), ("towers", 3), ("slabs", 2), (ALL, 3), (ALL, 2)]


def test_problems_without_a_solution() -> None:
    stuck = groups(ROWS, OF, 1e-8)[1]
    a, b = refusals(stuck)
    assert (a.solver, a.infeasible, a.median) == ("A", 1, 0.5)
    assert (b.solver, b.infeasible, b.failed, b.median) == ("B", 0, 1, LIMIT)
    header, cells = group_table(stuck, "wall")
    assert header[1] == "says infeasible" and cells[0] == ["A", "1 of 1", "0", "0", "0", "0", "500 ms"]
    ends = {"STAGNATED": "gave_up", "TIME_LIMIT: late": "late", "WRONG: said": "failed", "SOLVED": "solved", "INFEASIBLE": "infeasible"}
    for status, name in ends.items():
        (row,) = refusals(groups([measured("s", "A", 1.0, status)], OF, 1e-8)[0])
        counts = {key: getattr(row, key) for key in ("infeasible", "gave_up", "late", "failed", "solved")}
        assert counts == dict.fromkeys(counts, 0) | {name: 1}


def test_the_overview_says_who_leads() -> None:
    header, rows = overview(groups(ROWS, OF, 1e-8), "B", "wall")
    assert header[3:5] == ("leads", "B")
    assert rows == [
        ["piles, 3D", "3", "2", "A", "1 of 3", "≥ 12 s", "1.33", "2"],
        ["stuck, 3D", "1", "0", "A", "0 infeasible", "–", "–", "–"],
        ["towers, 3D", "1", "1", "B", "1 of 1", "750 ms", "1", "1"],
        ["all, 3D", "4", "3", "A", "2 of 4", "≥ 12.8 s", "1.06", "2"],
    ]


def test_every_solver_by_groups() -> None:
    """p: 1 and 2 s, q: 8 s by A alone, t: 3 and 0.75 s; k is solved by none, s has no solution."""
    header, rows = every_solver(groups(ROWS, OF, 1e-8), "wall")
    assert header == ("solver", "all", "piles, 3", "towers, 1")
    assert rows == [["A", "3 of 4 (1.59)", "2 (1)", "1 (4)"], ["B", "2 of 4 (1.41)", "1 (2)", "1 (1)"]]


def test_who_fails_on_what() -> None:
    rows = dict(failures(groups(ROWS, OF, 1e-8)))
    assert rows == {"no solver": "1: k", "B": "1: KILLED_TIME: q"}


def test_a_solved_row_without_a_time_is_refused() -> None:
    broken = groups([measured("p", "A", None)], OF, 1e-8)[0]
    with pytest.raises(InputError, match="p by A at 1e-8: solved, expected a time"):
        standings(broken)
