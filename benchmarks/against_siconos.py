"""This package beside Siconos: same files, same machine, same run, same independent error.

    python benchmarks/against_siconos.py FOLDER                      all FCLIB files of a folder, at 1e-4 and 1e-8
    python benchmarks/against_siconos.py FOLDER --quick              problems of at most 100 contacts, 2 s a run
    python benchmarks/against_siconos.py FILE --solver auto --tol 1e-6 --exhaustive

Siconos runs through the Python that has it (--siconos-python); every configuration of `siconos_worker.py` is tried. Siconos stops on a
norm that may be orders of magnitude weaker than the error used here, so its tolerance is tightened until the error computed by this
script is met, and the time of that last run alone counts. A configuration is stopped when it takes much longer than the best one found
so far, since the best one is what is compared; with --exhaustive each may use the whole time limit. For a global problem, Siconos'
local solvers are given W, and the time of our reduction is added to theirs. Runs start from r = 0 with nothing known of the problem;
ours in a process that has loaded the compiled code by an unmeasured run of about 2 s at most, Siconos', which is compiled code itself, in
a process that has started and read the problem. --resume goes on with an earlier CSV.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # both programs on one thread; before NumPy is loaded
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import statistics
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from report import Record, circumstances, table, write_markdown

from fcsim.bench.fclib_problem import FclibProblem, read_problems
from fcsim.bench.reporting.summary import duration, geometric_mean
from fcsim.bench.reporting.time_table import CLOCKS
from fcsim.bench.workers import solves
from fcsim.bench.workers.killable import Task, run_killable
from fcsim.bench.workers.siconos_client import Siconos, siconos_on, siconos_version
from fcsim.bench.workers.siconos_worker import REPEAT_AT_MOST, REPEAT_WITHIN
from fcsim.errors import InputError
from fcsim.problem import GlobalProblem
from fcsim.problem.reduction import reduce
from fcsim.solvers import ALIASES, SOLVERS, method, solve

FIELDS = ("problem", "form", "dimension", "nc", "n", "what", "program", "configuration", "storage", "tol", "time_limit", "status", "solved")
TIMES = ("error", "iterations", "siconos_tol", "seconds", "cpu_seconds", "reduction")
METHODS = ("auto", "NSN-AC", "NSGS-AC", "NSN-AC-HYBRID", "PPA-NSN-AC")
MARGIN = {"seconds": 1.5, "cpu_seconds": 4.0}
LEAST = 0.05
"""A configuration may take, by the wall clock, MARGIN times the best time found so far plus LEAST s."""
LONG = 0.01
"""[s] Below, the time of a solve is mostly Python's."""
SWEEPS, TURNS = 200, 5
SWEEPS_FROM = 20
"""The speed of sweeps is compared on problems of at least so many contacts."""


def reduction_seconds(problem: FclibProblem, clock: str) -> float:
    """Median seconds of our reduction of a global problem to W and q, 0 for a local one."""
    p = problem.problem
    if not isinstance(p, GlobalProblem):
        return 0.0
    reduce(p).local.q  # noqa: B018 - compiles

    seconds: list[float] = []
    while not seconds or (sum(seconds) < 0.3 and len(seconds) < 7):
        fresh, tick = replace(p), time.process_time if clock == "cpu_seconds" else time.perf_counter
        start = tick()
        reduce(fresh).local.q  # noqa: B018
        seconds.append(tick() - start)
    return statistics.median(seconds)


def siconos_rows(
    siconos: Siconos, tol: float, options: argparse.Namespace, reduction: float, order: Counter[tuple[str, str]]
) -> Iterator[dict[str, Any]]:
    """A row for each configuration, those that were best on other problems first, since they limit the time of the rest."""
    best = float("inf")
    for name, storage in sorted(siconos.configurations, key=lambda pair: -order[pair]):
        added = 0.0 if storage == "global" else reduction
        allowed = options.time_limit if options.exhaustive else min(options.time_limit, MARGIN[options.clock] * best + LEAST)
        row: dict[str, Any] = {"program": "siconos", "configuration": name, "storage": storage, "tol": tol, "reduction": added}
        row |= siconos.solve(name, storage, tol, allowed)
        if row["status"] == "time limit" and allowed < options.time_limit:
            row["status"] = "slower than the best"
        if row.get("seconds") is not None:
            row["seconds"] += added
            row["cpu_seconds"] += added
        if row["solved"]:
            best = min(best, row[options.clock])
        yield row


def own_sweep_seconds(problem: FclibProblem, limit: float, clock: str) -> float | None:
    """Seconds of a sweep of NSGS-AC, the median of runs as for Siconos; None where it did not make enough."""

    def items() -> Iterator[Any]:
        local = reduce(problem.problem).local if isinstance(problem.problem, GlobalProblem) else problem.problem
        solve(local, "NSGS-AC", tol=1e-300, max_iterations=2)
        tick = time.process_time if clock == "cpu_seconds" else time.perf_counter
        measured: list[float] = []
        while not measured or (sum(measured) < REPEAT_WITHIN and len(measured) < REPEAT_AT_MOST):
            fresh = replace(local)  # with nothing kept from before
            start = tick()
            result = solve(fresh, "NSGS-AC", tol=1e-300, max_iterations=SWEEPS, time_limit=limit)
            measured.append(tick() - start)
        yield statistics.median(measured), result.iterations

    ended = next(run_killable([Task(None, items, limit * REPEAT_AT_MOST + solves.GRACE)]))
    if not ended.items or not ended.items[0][1]:
        return None
    seconds, iterations = ended.items[0]
    return float(seconds / iterations)


def sweep_rows(problem: FclibProblem, siconos: Siconos, options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Seconds a sweep of NSGS with the local Newton method, the least of some turns on both sides; Siconos with each storage of W."""
    theirs = [pair for pair in (("NSGS NSN", "block"), ("NSGS NSN", "dense"), ("NSGS sparse", "sparse")) if pair in siconos.configurations]
    least: dict[tuple[str, str], float] = {}
    for _ in range(TURNS):
        turn = {("NSGS-AC", ""): own_sweep_seconds(problem, options.time_limit, options.clock)}
        turn |= {pair: siconos.seconds_per_sweep(*pair, SWEEPS, options.time_limit, options.clock) for pair in theirs}
        for pair, seconds in turn.items():
            least[pair] = min(seconds or float("inf"), least.get(pair, float("inf")))
    for (name, storage), seconds in least.items():
        program = {"program": "siconos", "storage": storage} if storage else {"program": "fcsim"}
        yield {"what": "sweep", **program, "configuration": name, "seconds": seconds if seconds < float("inf") else None}


def measure(problem: FclibProblem, options: argparse.Namespace, order: Counter[tuple[str, str]]) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    methods = [name for name in options.solver if problem.problem.dimension in method(name).dimensions]
    for _, own in solves.measure(problem, methods, options.tol, options.time_limit, repeat_within=0.3):
        rows += [{**row, "program": "fcsim", "configuration": row["method"]} for row in own]
    reduction = reduction_seconds(problem, options.clock)
    with siconos_on(problem, options.siconos_python) as siconos:
        for tol in options.tol:
            found = list(siconos_rows(siconos, tol, options, reduction, order))
            solved = [row for row in found if row["solved"]]
            if solved:
                best = min(solved, key=lambda row: row[options.clock])
                order[best["configuration"], best["storage"]] += 1
            rows += found
        rows = [{"what": "solve", **row} for row in rows]
        if problem.problem.dimension == 3 and problem.problem.nc >= SWEEPS_FROM:
            rows += sweep_rows(problem, siconos, options)
    about = problem.description
    return [{**about, **row, "time_limit": options.time_limit} for row in rows]


def best_of(rows: Sequence[dict[str, Any]], clock: str) -> dict[str, Any] | None:
    return min((row for row in rows if row["solved"]), key=lambda row: row[clock], default=None)


def result_text(row: dict[str, Any] | None, clock: str, named: bool = True) -> str:
    if row is None:
        return "not solved"
    storage = f", {row['storage']}" if row.get("storage") not in (None, "global") else ""
    return duration(row[clock]) + (f" ({row['configuration']}{storage})" if named else "")


def ratio_lines(pairs: dict[str, tuple[float, float]], what: str) -> list[str]:
    """Geometric mean of Siconos' best time over ours, from the problems' (Siconos' seconds, our seconds)."""

    def mean(kept: dict[str, tuple[float, float]]) -> str:
        return f"{geometric_mean([theirs / ours for theirs, ours in kept.values()]):.2f} on {len(kept)} problems"

    theirs_long = {name: pair for name, pair in pairs.items() if pair[0] > LONG}
    either_long = {name: pair for name, pair in pairs.items() if max(pair) > LONG}
    late = [f"{name} ({ours / theirs:.1f} x)" for name, (theirs, ours) in either_long.items() if ours > 2 * theirs]
    return [
        f"* Siconos' best over {what}, geometric mean: {mean(pairs)}; where Siconos takes more than 10 ms: {mean(theirs_long)}; "
        f"where either does: {mean(either_long)}.",
        f"* Where either takes more than 10 ms, {what} is more than 2 x slower on: {', '.join(late) or 'none'}.",
    ]


def comparison(rows: Sequence[dict[str, Any]], tol: float, methods: Sequence[str], clock: str) -> list[str]:
    """The table of one tolerance and what it sums up to."""
    first = methods[0]
    problems = {row["problem"]: row for row in rows}
    body: list[list[str]] = []
    pairs: dict[str, dict[str, tuple[float, float]]] = {first: {}, "our best": {}}
    solved_by: Counter[str] = Counter()
    only_siconos = []
    for name, about in problems.items():
        here = [row for row in rows if row["problem"] == name and row["tol"] == tol and row["what"] == "solve"]
        theirs = best_of([row for row in here if row["program"] == "siconos"], clock)
        ours = [row for row in here if row["program"] == "fcsim" and row["configuration"] in methods]
        chosen, best = best_of([row for row in ours if row["configuration"] == first], clock), best_of(ours, clock)
        solved_by.update(who for who, row in (("siconos", theirs), (first, chosen), ("our best", best)) if row is not None)
        cells = [name, f"{about['form']} {about['dimension']}D", str(about["nc"]), result_text(theirs, clock)]
        for what, row in ((first, chosen), ("our best", best)):
            cells += [result_text(row, clock, named=what != first), ""]
            if theirs is not None and row is not None:
                pairs[what][name] = theirs[clock], row[clock]
                cells[-1] = f"{theirs[clock] / row[clock]:.2g}"
        if theirs is not None and chosen is None:
            only_siconos.append(name)
        body.append(cells)
    lines = [f"## Error at most {tol:g}", ""]
    lines += table(["problem", "form", "contacts", "Siconos' best", first, "ratio", "our best", "ratio"], body, left=2)
    lines += [
        f"* Solved of {len(problems)} problems: {solved_by['siconos']} by at least one configuration of Siconos, "
        f"{solved_by[first]} by {first}, {solved_by['our best']} by at least one of ours ({', '.join(methods)}).",
        f"* Solved by Siconos, not by {first}: {', '.join(only_siconos) or 'none'}.",
    ]
    for what in (first, "our best"):
        lines += ratio_lines(pairs[what], what)
    return [*lines, ""]


def configurations(rows: Sequence[dict[str, Any]], tolerances: Sequence[float], clock: str, exhaustive: bool) -> list[str]:
    """How many problems each configuration of Siconos, with any storage of W, solved, and on how many it was the best."""
    counts: dict[str, Counter[str]] = {}
    for tol in tolerances:
        for name in dict.fromkeys(row["problem"] for row in rows):
            theirs = [r for r in rows if r["program"] == "siconos" and r["what"] == "solve" and r["problem"] == name and r["tol"] == tol]
            best = best_of(theirs, clock)
            for configuration in dict.fromkeys(row["configuration"] for row in theirs):
                own = [row for row in theirs if row["configuration"] == configuration]
                count = counts.setdefault(configuration, Counter())
                count[f"tried {tol}"] += 1
                count[f"solved {tol}"] += any(row["solved"] for row in own)
                count[f"best {tol}"] += any(row is best for row in own)
    tight = min(tolerances)
    ordered = sorted(counts.items(), key=lambda item: (-item[1][f"solved {tight}"], -item[1][f"best {tight}"]))
    header = ["configuration", *(text for tol in tolerances for text in (f"solved at {tol:g}", "best"))]
    body = [
        [name, *(text for tol in tolerances for text in (f"{c[f'solved {tol}']} of {c[f'tried {tol}']}", str(c[f"best {tol}"])))]
        for name, c in ordered
    ]
    note = (
        "Each may use the whole time limit." if exhaustive else "Solved means: before it was stopped for being slower than the best so far."
    )
    return ["## Siconos' configurations", "", note, "", *table(header, body)]


def sweeps(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Sweeps a second of NSGS on both sides."""
    measured = [row for row in rows if row["what"] == "sweep" and row["seconds"]]
    body, ratios = [], []
    for name, about in {row["problem"]: row for row in measured}.items():
        own = [row for row in measured if row["problem"] == name and row["program"] == "fcsim"]
        theirs = min((r for r in measured if r["problem"] == name and r["program"] == "siconos"), key=lambda r: r["seconds"], default=None)
        if own and theirs:
            ratios.append(theirs["seconds"] / own[0]["seconds"])
            speed = [f"{1 / row['seconds']:.0f}" for row in (own[0], theirs)]
            body.append([name, str(about["nc"]), speed[0], f"{speed[1]} ({theirs['storage']})", f"{ratios[-1]:.2f}"])
    if not body:
        return []
    text = f"{SWEEPS} sweeps from r = 0 with the local Newton method, set-up included, Siconos' error evaluation at its cheapest (light); "
    text += f"the quickest of {TURNS} turns, each the median of several runs."
    lines = ["## Sweeps a second of NSGS", "", text, ""]
    lines += table(["problem", "contacts", "NSGS-AC", "Siconos NSGS + ONECONTACT_NSN, best storage", "ratio"], body)
    return [*lines, f"* Geometric mean of the ratios: {geometric_mean(ratios):.2f}; the least: {min(ratios):.2f}.", ""]


def main(arguments: Sequence[str] | None = None) -> int:
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", type=Path, nargs="+", metavar="FILES", help="FCLIB files, or folders of them")
    parser.add_argument(
        "--solver", action="append", choices=[*SOLVERS, *ALIASES], metavar="NAME", help=f"ours; default: {', '.join(METHODS)}"
    )
    parser.add_argument("--tol", type=float, action="append", help="may be given several times (default: 1e-4 and 1e-8)")
    parser.add_argument("--time-limit", type=float, default=30.0, metavar="SECONDS", help="for one run (default 30)")
    parser.add_argument("--quick", action="store_true", help="problems of at most 100 contacts, at most 2 s a run")
    parser.add_argument("--exhaustive", action="store_true", help="do not stop configurations that are slower than the best")
    parser.add_argument("--clock", choices=CLOCKS, default="wall", help="cpu: the processor's time, for a busy machine")
    parser.add_argument("--siconos-python", type=Path, default=Path("/usr/bin/python3"), help="the Python that has siconos.numerics")
    parser.add_argument("--out", type=Path, default=Path("docs/against_siconos.md"), help="the CSV goes beside it")
    parser.add_argument("--resume", action="store_true", help="keep the problems that the CSV has already")
    options = parser.parse_args(arguments)
    options.solver = options.solver or [name for name in METHODS if name in SOLVERS]
    options.tol = sorted(options.tol or [1e-4, 1e-8], reverse=True)
    options.clock, clock_name = CLOCKS[options.clock]
    if options.quick:
        options.time_limit = min(options.time_limit, 2.0)
    version = siconos_version(options.siconos_python)
    if version is None:
        parser.error(f"--siconos-python {options.siconos_python}: it cannot import siconos.numerics; name a Python that can")
    try:
        problems, notes = read_problems(options.paths)
    except InputError as error:
        parser.error(str(error))
    problems = [p for p in problems if p.problem.nc > 0 and (not options.quick or p.problem.nc <= 100)]
    record = Record(options.out.with_suffix(".csv"), (*FIELDS, *TIMES), options.resume)
    wanted = {(name, tol) for name in ("siconos", *options.solver) for tol in options.tol}
    known = set()
    for problem in problems:  # a problem is known when everything asked for was measured on it, each row once
        rows = [row for row in record.rows if row["problem"] == problem.name and row["time_limit"] == options.time_limit]
        fitting = {(name, tol) for name, tol in wanted if name == "siconos" or problem.problem.dimension in method(name).dimensions}
        if fitting <= {(row["configuration"] if row["program"] == "fcsim" else "siconos", row["tol"]) for row in rows}:
            known.add(problem.name)
    record.keep(lambda row: row["problem"] in known and row["time_limit"] == options.time_limit)
    order: Counter[tuple[str, str]] = Counter()
    solves.warm(options.solver)
    for number, problem in enumerate(problems, 1):
        print(f"{number}/{len(problems)} {problem.name}: {problem.problem.nc} contacts", file=sys.stderr)
        if problem.name not in known:
            record.add(measure(problem, options, order))
    head = circumstances(options, arguments, [f"Siconos {version}"])[:-1]
    head += [
        f"* Times: {clock_name}, medians where a run is short; time limit {options.time_limit:g} s a run. Ratio: Siconos' time over ours."
    ]
    if known:
        head += [f"* {len(known)} problems are from an earlier run that this one went on with."]
    head += [f"* {note}." for note in notes] + [""]
    about = "Which is faster, and where: `auto` and every configuration of Siconos on the same problems, to the same error."
    lines = ["# fcsim and Siconos side by side", "", about, "", *head]
    for tol in options.tol:
        lines += comparison(record.rows, tol, options.solver, options.clock)
    write_markdown(
        options.out, [*lines, *sweeps(record.rows), *configurations(record.rows, options.tol, options.clock, options.exhaustive)]
    )
    print(options.out, file=sys.stderr)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
