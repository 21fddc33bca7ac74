"""Small problems: a call of `solve` beside Siconos' best configuration, what of it is the method's own time, and `solve_many`.

    python benchmarks/small.py                       families of 1 to 50 contacts, at 1e-8
    python benchmarks/small.py --sizes 10 30 --seeds 0 1 2 --out small.csv
    python benchmarks/small.py --without-siconos

Prints a table and what it sums up to. Ours: processor time of `solve` on arrays, the constructor of the problem included, the least of some
turns of many calls each, and of the compiled method alone (the seconds that the result reports). Siconos' as in against_siconos.py: every
configuration, its tolerance tightened until this package's error is met, the time of its own solve alone, without Python.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy is loaded

import argparse
import csv
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from fcsim.bench.families import FAMILIES, problems
from fcsim.bench.fclib_problem import FclibProblem
from fcsim.bench.reporting.summary import duration, geometric_mean
from fcsim.bench.workers.siconos_client import siconos_on, siconos_version
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.problem.reduction import reduced
from fcsim.solvers import solve, solve_many

INFEASIBLE = ("rods", "wedged", "squeezed")
TURNS, WITHIN = 5, 0.02
"""Turns of a measurement, and seconds that each may take."""
CALLS = 200
"""Calls of which each tells what of it is not the method: the two are of one call, since those of others differ by what goes on beside."""


def least_seconds(work: Callable[[], object]) -> float:
    """Processor time of a call, the least of some turns of many calls each; the first call is not measured."""
    work()
    begun = time.process_time()
    work()
    calls = max(1, int(WITHIN / max(time.process_time() - begun, 1e-6)))
    turns = []
    for _ in range(TURNS):
        begun = time.process_time()
        for _ in range(calls):
            work()
        turns.append((time.process_time() - begun) / calls)
    return min(turns)


def chosen(sizes: list[int], seeds: list[int]) -> list[tuple[str, LocalProblem]]:
    """(name, problem in local form with a dense W) of the families that have solutions."""
    found = []
    for family in FAMILIES:
        for size in sizes if family not in INFEASIBLE else ():
            for seed in seeds:
                problem = problems(family, size, seed)
                if isinstance(problem, GlobalProblem | LocalProblem) and problem.nc:
                    local = reduced(problem).local
                    W = local.W if isinstance(local.W, np.ndarray) else local.W.toarray()
                    found.append((f"{family}:{size}:{seed}", replace(local, W=W, motion=None)))
    return found


def ours(problem: LocalProblem, name: str, tol: float) -> tuple[float, float, float] | None:
    """Seconds of a call from arrays, of the method's own, and of a call beside it (median); None where it is not solved."""
    arrays, d = (problem.W, problem.q, problem.mu), problem.dimension
    result = solve(problem, name, tol=tol)
    if not result.solved:
        return None
    seconds = least_seconds(lambda: solve(LocalProblem(*arrays, dimension=d), name, tol=tol))
    own, beside = [], []
    for _ in range(CALLS):
        begun = time.perf_counter()
        result = solve(LocalProblem(*arrays, dimension=d), name, tol=tol)
        beside.append(time.perf_counter() - begun - result.seconds["solve"])
        own.append(result.seconds["solve"])
    return seconds, min(own), float(np.median(beside))


def theirs(name: str, problem: LocalProblem, tol: float, python: Path) -> tuple[float, str] | None:
    """Seconds of Siconos' best configuration and its name."""
    best: tuple[float, str] | None = None
    with siconos_on(FclibProblem(name, "local", problem), python) as siconos:
        for configuration, storage in siconos.configurations:
            row = siconos.solve(configuration, storage, tol, 0.05)
            if row["solved"] and (best is None or row["cpu_seconds"] < best[0]):
                best = row["cpu_seconds"], f"{configuration}, {storage}"
    return best


def many(found: list[tuple[str, LocalProblem]], tol: float) -> str:
    """Problems a second by `solve_many` on one and two threads, by the wall clock."""
    copies = [problem for _, problem in found] * max(1, 2000 // len(found))
    lines = []
    for threads in (1, 2):
        solve_many(copies[: len(found)], tol=tol, threads=threads)
        begun = time.perf_counter()
        solve_many(copies, tol=tol, threads=threads)
        lines.append(f"{len(copies) / (time.perf_counter() - begun):.0f} on {threads} thread{'s' if threads > 1 else ''}")
    return f"solve_many, problems a second: {', '.join(lines)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=[3, 10, 20, 40])
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--tol", type=float, default=1e-8)
    parser.add_argument("--siconos-python", type=Path, default=Path("/usr/bin/python3"), help="the Python that has siconos.numerics")
    parser.add_argument("--without-siconos", action="store_true")
    parser.add_argument("--out", type=Path, help="CSV file")
    options = parser.parse_args()
    version = None if options.without_siconos else siconos_version(options.siconos_python)
    found, rows = chosen(options.sizes, options.seeds), []
    whose = f"Siconos' best{f' ({version})' if version else ''}"
    print(f"| problem | contacts | auto | of it the method | NSGS-AC | {whose} | auto / Siconos |")
    print("|---|---:|---:|---:|---:|---:|---:|")
    for name, problem in found:
        auto, sweeps = ours(problem, "auto", options.tol), ours(problem, "NSGS-AC", options.tol)
        best = theirs(name, problem, options.tol, options.siconos_python) if version else None
        ratio = auto[0] / best[0] if auto and best else None
        rows.append({"problem": name, "nc": problem.nc, "auto": auto and auto[0], "sweeps": auto and auto[1], "ratio": ratio})
        rows[-1] |= {"beside": auto and auto[2]}
        rows[-1] |= {"NSGS-AC": sweeps and sweeps[0], "siconos": best and best[0], "configuration": best and best[1]}
        cells = [name, str(problem.nc), *(duration(x) if x else "-" for x in (rows[-1]["auto"], rows[-1]["sweeps"], rows[-1]["NSGS-AC"]))]
        print(
            "| " + " | ".join([*cells, f"{duration(best[0])} ({best[1]})" if best else "-", f"{ratio:.2f}" if ratio else "-"]) + " |",
            flush=True,
        )
    for least, most in ((1, 9), (10, 10**9)):
        ratios = [row["ratio"] for row in rows if row["ratio"] and least <= row["nc"] <= most]
        if ratios:
            what = f"{least} contacts and more" if most > 1000 else f"{least} to {most} contacts"
            print(f"auto over Siconos' best, {what}: geometric mean {geometric_mean(ratios):.2f} on {len(ratios)}, worst {max(ratios):.2f}")
    over = [row["beside"] for row in rows if row["beside"] and row["nc"] <= 30]
    if over:
        most = f"{duration(float(np.median(over)))}, at most {duration(max(over))}"
        print(f"auto over the method's own time in the same call, up to 30 contacts: median {most} of {len(over)} problems")
    print(many(found, options.tol))
    if options.out:
        with options.out.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    sys.exit(main())
