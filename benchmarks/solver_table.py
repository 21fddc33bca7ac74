"""Every method on every problem: time, iterations, error and status, in a Markdown table and a CSV.

    python benchmarks/solver_table.py FOLDER                     all methods on all FCLIB files of a folder, at 1e-4 and 1e-8
    python benchmarks/solver_table.py FILE FILE --solver NSN-AC --solver auto --tol 1e-6 --time-limit 60 --out table.md

Each method runs on each problem in a child process that has everything compiled and is killed past the time limit: a hang or a crash
is a result. The error of the reactions is computed here anew, from the file's matrices, with SciPy's LU and a cone projection of its
own; a method that says "solved" while that error is above the tolerance is reported as wrong. --resume goes on with an earlier CSV.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy is loaded: more threads than free processors slow everything down
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from report import Record, circumstances, table, write_markdown

from fcsim.bench.fclib_problem import read_problems
from fcsim.bench.reporting.summary import duration, geometric_mean
from fcsim.bench.reporting.time_table import CLOCKS
from fcsim.bench.workers import solves
from fcsim.errors import InputError
from fcsim.solvers import ALIASES, SOLVERS, method

FIELDS = ("problem", "form", "dimension", "nc", "n", "method", "family", "tol", "time_limit", "status", "solved", "error", "iterations")
TIMES = ("seconds", "cpu_seconds", "reduction")
COLUMNS = 6
"""Most methods a table, so that it fits a page."""
LETTERS = {
    "TIME_LIMIT": "T",
    "MAX_ITERATIONS": "I",
    "EXHAUSTED": "I",
    "STAGNATED": "S",
    "DIVERGED": "D",
    "SINGULAR": "X",
    "SOLVED": "WRONG",
}
LEGEND = (
    "A cell says the time of the whole solve (a global problem's reduction included) and the iterations, or in italics why there is no "
    "solution and the error reached: T time limit, I iterations used up, S stagnated, D diverged, X singular system, K killed (hung "
    "past the time limit or crashed), N not tried since the looser tolerance was not met in time, WRONG said to be solved while the "
    "error recomputed from its reactions is above the tolerance. A dot: the method is not for this dimension. "
    "Iterations are the method's own: sweeps, Newton steps, outer iterations."
)


def cell(row: dict[str, Any] | None, clock: str = "seconds") -> str:
    if row is None:
        return "·"
    if row["solved"]:
        return f"{duration(row[clock])} ({row['iterations']})"
    status = str(row["status"])
    letter = "N" if status.startswith("not tried") else LETTERS.get(status, "K")
    return f"*{letter}*" if row["error"] is None else f"*{letter} {row['error']:.0e}*"


def summary(rows: Sequence[dict[str, Any]], methods: Sequence[str], tolerances: Sequence[float], clock: str) -> list[str]:
    """How many problems each method solves, its mean time on them, the mean ratio to the fastest method, and its wrong claims."""
    fastest: dict[tuple[str, float], float] = {}
    for row in rows:
        if row["solved"]:
            key = row["problem"], row["tol"]
            fastest[key] = min(fastest.get(key, float("inf")), row[clock])
    header = ["method", "family"]
    for tol in tolerances:
        header += [f"solved at {tol:g}", "mean time", "to the fastest"]
    lines = []
    for name in methods:
        cells = [name, method(name).family]
        for tol in tolerances:
            own = [row for row in rows if row["method"] == name and row["tol"] == tol]
            solved = [row for row in own if row["solved"]]
            wrong = sum(row["status"] == "SOLVED" and not row["solved"] for row in own)
            ratios = [row[clock] / fastest[row["problem"], tol] for row in solved]
            cells.append(f"{len(solved)} of {len(own)}" + (f", {wrong} wrong" if wrong else ""))
            cells += [duration(geometric_mean([row[clock] for row in solved])), f"{geometric_mean(ratios):.1f}"] if solved else ["", ""]
        lines.append(cells)
    return table(header, lines, left=2)


def markdown(rows: Sequence[dict[str, Any]], tolerances: Sequence[float], time_limit: float, clock: str, head: Sequence[str]) -> list[str]:
    methods = [name for name in (*SOLVERS, *ALIASES) if any(row["method"] == name for row in rows)]
    problems = {row["problem"]: row for row in rows}
    about = "What every method of the table does on the same FCLIB files: how many problems it solves, how fast, and which it loses."
    lines = ["# Methods on the problems of an FCLIB collection", "", about, "", *head]
    lines += [
        "## All methods",
        "",
        f"Problems solved within {time_limit:g} s; means are geometric, over the problems that the method solves.",
    ]
    lines += ["", *summary(rows, methods, tolerances, clock), LEGEND, ""]
    families = list(dict.fromkeys(method(name).family for name in methods))
    for tol in tolerances:
        found = {(row["problem"], row["method"]): row for row in rows if row["tol"] == tol}
        lines += [f"## Error at most {tol:g}", ""]
        for family in families:
            members = [name for name in methods if method(name).family == family]
            lines += [f"### {family[0].upper()}{family[1:]}", ""]
            for start in range(0, len(members), COLUMNS):
                columns = members[start : start + COLUMNS]
                body = [
                    [
                        name,
                        f"{about['form']} {about['dimension']}D",
                        str(about["nc"]),
                        *(cell(found.get((name, m)), clock) for m in columns),
                    ]
                    for name, about in problems.items()
                ]
                lines += table(["problem", "form", "contacts", *columns], body, left=2)
    return lines


def main(arguments: Sequence[str] | None = None) -> int:
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", type=Path, nargs="+", metavar="FILES", help="FCLIB files, or folders of them")
    parser.add_argument(
        "--solver", action="append", choices=[*SOLVERS, *ALIASES], metavar="NAME", help="may be given several times (default: all)"
    )
    parser.add_argument("--tol", type=float, action="append", help="may be given several times (default: 1e-4 and 1e-8)")
    parser.add_argument("--time-limit", type=float, default=10.0, metavar="SECONDS", help="for one solve (default 10)")
    parser.add_argument("--clock", choices=CLOCKS, default="wall", help="cpu: the processor's time, for a busy machine")
    parser.add_argument("--jobs", type=int, default=1, help="children at a time (default 1; more disturb one another's times)")
    parser.add_argument("--out", type=Path, default=Path("docs/solver_table.md"), help="the CSV goes beside it")
    parser.add_argument("--resume", action="store_true", help="keep the rows that the CSV has already")
    options = parser.parse_args(arguments)
    options.clock, clock_name = CLOCKS[options.clock]
    tolerances = sorted(options.tol or [1e-4, 1e-8], reverse=True)
    methods = options.solver or [name for name, entry in SOLVERS.items() if 5 not in entry.dimensions]  # no rolling friction
    try:
        problems, notes = read_problems(options.paths)
    except InputError as error:
        parser.error(str(error))
    record = Record(options.out.with_suffix(".csv"), (*FIELDS, *TIMES), options.resume)
    names = {problem.name for problem in problems}
    record.keep(lambda row: row["problem"] in names and row["time_limit"] == options.time_limit)
    known = {(row["problem"], row["method"], row["tol"]) for row in record.rows}
    reused = len(known)
    solves.warm(methods)
    for number, problem in enumerate(problems, 1):
        about = problem.description
        fitting = [name for name in methods if about["dimension"] in method(name).dimensions]
        missing = [name for name in fitting if any((problem.name, name, tol) not in known for tol in tolerances)]
        print(f"{number}/{len(problems)} {problem.name}: {about['nc']} contacts, {len(missing)} methods", file=sys.stderr)
        for name, rows in solves.measure(problem, missing, tolerances, options.time_limit, options.jobs, repeat_within=0.1):
            record.add({**about, **row, "family": method(name).family, "time_limit": options.time_limit} for row in rows)
    latest = {(row["problem"], row["method"], row["tol"]): row for row in record.rows}  # a row measured again replaces the old one
    wanted = [row for row in latest.values() if row["tol"] in tolerances and row["method"] in methods]
    head = [*circumstances(options, arguments)[:-1], f"* Times: {clock_name}, medians where a solve is short.", ""]
    if reused:
        head[-1:] = [f"* {reused} of the CSV's rows are from an earlier run that this one went on with.", ""]
    head += [f"* {note}." for note in notes] + ([""] if notes else [])
    write_markdown(options.out, markdown(wanted, tolerances, options.time_limit, options.clock, head))
    print(options.out, file=sys.stderr)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
