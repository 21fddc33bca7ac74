"""The summary tables of solver comparisons (as in Acary, Brémond, Huber 2018): the fastest solver per problem, and each solver."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fcsim.arrays import FloatArray
from fcsim.bench.reporting.profiles import RESOLUTION
from fcsim.bench.reporting.time_table import TimeTable, tolerance_name
from fcsim.tables import cell, line

AT_TIME_LIMIT = ("KILLED_TIME", "TIME_LIMIT")
BROKEN = ("KILLED_MEMORY", "CRASHED")


@dataclass(frozen=True)
class SolverSummary:
    """One solver at one tolerance. With r_ps of `fcsim.bench.reporting.profiles` and S the problems that it solved:

    unsolved = at_time_limit + wrong + broken + the rest, which gave up by itself; wrong: said solved, the recomputed error is above tol;
    broken: crashed or above the memory limit; won: problems with r_ps = 1, ties won by all;
    ratio        geometric mean of r_ps over S
    common_ratio the same over the problems that every solver solved
    speedup      geometric mean of t_reference / t_s over the problems that both solved (`both` in number); None without a reference
    speedup_bound the same over S, with the time limit for the time of the reference where that ended at it: a lower bound of the
                 mean without time limit, over `bounded` problems
    """

    solver: str
    solved: int
    unsolved: int
    at_time_limit: int
    wrong: int
    broken: int
    won: int
    ratio: float
    common_ratio: float
    speedup: float | None = None
    both: int = 0
    speedup_bound: float | None = None
    bounded: int = 0


@dataclass(frozen=True)
class Summary:
    """One tolerance. Times [s] of the fastest solver of each problem, mean and population standard deviation over the solved problems.

    The values per contact leave out problems without contacts. common: problems that every solver solved. censored_from: least ratio
    (time limit / time of the fastest) of the solves that ended at the time limit, on problems that another solver solved: with a
    longer limit, profiles change from this ratio on; infinity where no solve did.
    """

    tol: float
    clock: str
    problems: int
    unsolved_by_all: int
    not_measured: int
    fastest_mean: float
    fastest_deviation: float
    per_contact_mean: float
    per_contact_deviation: float
    common: int
    censored_from: float
    reference: str | None
    solvers: tuple[SolverSummary, ...]


def summarize(table: TimeTable, reference: str | None = None, *, resolution: float = RESOLUTION) -> Summary:
    """Return the summary of one tolerance; `reference` is the solver that the others' speed-up is over, ignored where it is not there.

    All problems of the table count, those that no solver solved included.
    """
    times = np.maximum(table.times, resolution)
    reached = np.isfinite(times)
    fastest = times.min(axis=1)
    solvable = reached.any(axis=1)
    common = reached.all(axis=1)
    touching = solvable & (table.contacts > 0)
    per_contact = fastest[touching] / table.contacts[touching]
    reference_index = table.solvers.index(reference) if reference in table.solvers else None
    rows = []
    for s, name in enumerate(table.solvers):
        outcomes = table.outcomes(name)
        own = reached[:, s]
        ratios = times[:, s][own] / fastest[own]
        row = SolverSummary(
            solver=name,
            solved=int(own.sum()),
            unsolved=int((~own).sum()),
            at_time_limit=sum(outcomes[status] for status in AT_TIME_LIMIT),
            wrong=outcomes["WRONG"],
            broken=sum(outcomes[status] for status in BROKEN),
            won=int((ratios == 1).sum()),
            ratio=geometric_mean(ratios),
            common_ratio=geometric_mean(times[common, s] / fastest[common]),
        )
        rows.append(row if reference_index is None else _with_speedup(row, table, times, reference_index, s))
    return Summary(
        tol=table.tol,
        clock=table.clock,
        problems=len(table.problems),
        unsolved_by_all=int((~solvable).sum()),
        not_measured=len(table.left_out),
        fastest_mean=_mean(fastest[solvable]),
        fastest_deviation=_deviation(fastest[solvable]),
        per_contact_mean=_mean(per_contact),
        per_contact_deviation=_deviation(per_contact),
        common=int(common.sum()),
        censored_from=float((table.limits / fastest[:, None])[stopped_at_limit(table) & solvable[:, None]].min(initial=math.inf)),
        reference=None if reference_index is None else reference,
        solvers=tuple(rows),
    )


def stopped_at_limit(table: TimeTable) -> NDArray[np.bool_]:
    """(problems, solvers) Whether a solve ended unsolved at its time limit."""
    return np.array([[m.outcome in AT_TIME_LIMIT and not m.solved for m in row] for row in table.rows])


def geometric_mean(values: ArrayLike) -> float:
    """exp(mean(log)), NaN for nothing."""
    logarithms = np.log(values)
    return float(np.exp(logarithms.mean())) if logarithms.size else math.nan


def _mean(values: FloatArray) -> float:
    return float(values.mean()) if len(values) else math.nan


def _deviation(values: FloatArray) -> float:
    return float(values.std()) if len(values) else math.nan


def _with_speedup(row: SolverSummary, table: TimeTable, times: FloatArray, reference: int, s: int) -> SolverSummary:
    of_reference = times[:, reference]
    both = np.isfinite(of_reference) & np.isfinite(times[:, s])
    bound = np.where(stopped_at_limit(table)[:, reference], table.limits[:, reference], of_reference)
    bounded = np.isfinite(bound) & np.isfinite(times[:, s])
    return replace(
        row,
        speedup=geometric_mean(of_reference[both] / times[both, s]),
        both=int(both.sum()),
        speedup_bound=geometric_mean(bound[bounded] / times[bounded, s]),
        bounded=int(bounded.sum()),
    )


def number(value: float | None, unit: str = "") -> str:
    """Three digits; a dash for what is not there."""
    if value is None or not math.isfinite(value):
        return "–"
    text = f"{value:.3g}" if value < 1000 else f"{value:.0f}"
    return f"{text} {unit}".rstrip()


def duration(seconds: float) -> str:
    """Three digits in the unit that suits: s, ms or µs; what rounds to 1000 of one is 1 of the next."""
    scale, unit = next(((scale, unit) for scale, unit in ((1.0, "s"), (1e-3, "ms")) if seconds >= 0.9995 * scale), (1e-6, "µs"))
    return number(seconds / scale, unit)


FASTEST: dict[str, Callable[[Summary], str]] = {
    "tolerance": lambda s: tolerance_name(s.tol),
    "problems": lambda s: str(s.problems),
    "solved by none": lambda s: str(s.unsolved_by_all),
    "solved by all": lambda s: str(s.common),
    "mean": lambda s: duration(s.fastest_mean),
    "standard deviation": lambda s: duration(s.fastest_deviation),
    "mean per contact": lambda s: duration(s.per_contact_mean),
    "deviation per contact": lambda s: duration(s.per_contact_deviation),
}
"""Columns of the table over tolerances."""


def solver_columns(summary: Summary) -> dict[str, Callable[[SolverSummary], str]]:
    """Columns of the table of one tolerance's solvers."""
    columns: dict[str, Callable[[SolverSummary], str]] = {
        "solver": lambda r: r.solver,
        "solved": lambda r: str(r.solved),
        "unsolved": lambda r: str(r.unsolved),
        "time limit": lambda r: str(r.at_time_limit),
        "wrong": lambda r: str(r.wrong),
        "broken": lambda r: str(r.broken),
        "won": lambda r: str(r.won),
        "ratio": lambda r: number(r.ratio),
        "common ratio": lambda r: number(r.common_ratio),
    }
    if summary.reference is not None:
        columns[f"faster than {summary.reference}"] = lambda r: f"{number(r.speedup)} ({r.both})"
        columns["at least"] = lambda r: f"{number(r.speedup_bound)} ({r.bounded})"
    return columns


NOTES = (
    "Times are those of whole solves, reduction included. A problem counts as solved only if its error, recomputed outside the solver, "
    "meets the tolerance.",
    "The fastest solver of each problem: mean and standard deviation (of the population) of its time over the problems that any "
    "solver solved; per contact: of that time divided by the number of contacts.",
    "Unsolved contains: time limit (stopped there; the time is censored: it would be at least the limit); wrong (said to be solved, but "
    "the recomputed error is above the tolerance); broken (crashed or above the memory limit); the rest gave up by itself.",
    "Won: problems on which no solver was faster. Ratio: geometric mean of the time over that of the fastest solver, over the "
    "problems that this solver solved, so not over the same ones for all; common ratio: over those that every solver solved.",
)
SPEEDUP_NOTE = (
    "Faster than {reference}: geometric mean of its time over that of the solver, over the problems that both solved (their number in "
    "brackets). At least: the same with the time limit in place of the time of {reference} where that ended at the limit, which "
    "is a lower bound of the mean without limit."
)


def notes(summaries: Sequence[Summary]) -> list[str]:
    """What the columns mean."""
    references = dict.fromkeys(s.reference for s in summaries if s.reference is not None)
    return [*NOTES, *(SPEEDUP_NOTE.format(reference=name) for name in references)]


def ordered(summary: Summary) -> list[SolverSummary]:
    """Solvers from best to worst: by problems solved, then problems won, then the ratio."""
    return sorted(summary.solvers, key=lambda r: (-r.solved, -r.won, r.ratio if math.isfinite(r.ratio) else math.inf))


def tables(summaries: Sequence[Summary]) -> list[tuple[str, list[str], list[list[str]]]]:
    """(title, header, rows) of the table over tolerances and of one table for each tolerance: text, the first column to the left."""
    first = [[text(s) for text in FASTEST.values()] for s in summaries]
    result = [("The fastest solver of each problem", list(FASTEST), first)]
    for s in summaries:
        columns = solver_columns(s)
        result.append((f"Tolerance {tolerance_name(s.tol)}", list(columns), [[text(r) for text in columns.values()] for r in ordered(s)]))
    return result


def markdown(summaries: Sequence[Summary]) -> str:
    """All tables as Markdown, with notes."""
    lines = []
    for title, header, rows in tables(summaries):
        lines += [f"## {title}", "", *markdown_table(header, rows), ""]
    return "\n".join([*lines, *(f"* {note}" for note in notes(summaries))]) + "\n"


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """The lines of a table: text in the first column, numbers in the others."""
    rule = [":---"] + ["---:"] * (len(header) - 1)
    return ["| " + " | ".join(cells) + " |" for cells in (header, rule, *rows)]


def csv_text(summaries: Sequence[Summary]) -> str:
    """Everything as one tidy CSV: a row for each tolerance and solver, with full digits; empty where there is no value."""
    own = [name for name in Summary.__dataclass_fields__ if name != "solvers"]
    of_solver = list(SolverSummary.__dataclass_fields__)
    rows = ([getattr(s, name) for name in own] + [getattr(row, name) for name in of_solver] for s in summaries for row in s.solvers)
    return line(own + of_solver) + "".join(line(_finite(value) for value in row) for row in rows)


def _finite(value: object) -> str:
    return "" if isinstance(value, float) and not math.isfinite(value) else cell(value)
