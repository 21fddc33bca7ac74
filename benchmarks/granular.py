"""Beds of balls as granular codes solve them, to a loose tolerance: `NSGS-AC`, `NSGS-AA` and `auto` beside Siconos' Gauss-Seidel.

    python benchmarks/granular.py                          about 10 000 balls, 20 000 contacts, at 1e-4
    python benchmarks/granular.py --sizes 3000 30000 46000 --without-siconos

One step of a bed of the family "spheres" (`fcsim.bench.families`) from rest, r = 0. Prints a table: processor time of the reduction to
W, of each method of ours from W and q, and of Siconos' driver alone on the same W, its tolerance tightened until the same independent
error is met (the published one, computed here for both). One thread.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy is loaded

import argparse
import time
from dataclasses import replace
from pathlib import Path

from fcsim.bench.families import problems
from fcsim.bench.fclib_problem import FclibProblem
from fcsim.bench.reporting.summary import duration
from fcsim.bench.workers.siconos_client import siconos_on, siconos_version
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.problem.reduction import reduce
from fcsim.solvers import solve

OURS = ("NSGS-AC", "NSGS-AA", "auto")
THEIRS = ("NSGS NSN", "NSGS NSN_GP")
STORAGE = "block"
"""Siconos' own storage for sweeps."""


def ours(problem: LocalProblem, name: str, tol: float, limit: float) -> tuple[str, float, int, float]:
    """Name, processor time of the quicker of two solves, iterations, error."""
    seconds = float("inf")
    for _ in range(2):
        begun = time.process_time()
        result = solve(problem, name, tol=tol, error="published", time_limit=limit)
        seconds = min(seconds, time.process_time() - begun)
    return name, seconds, result.iterations, result.error


def rows(size: int, seed: int, tol: float, limit: float, python: Path | None) -> list[str]:
    """The lines of one bed's table."""
    given = problems("spheres", size, seed)
    assert isinstance(given, GlobalProblem)
    reduce(given).local  # noqa: B018  loads compiled code: not measured
    begun = time.process_time()
    local = reduce(replace(given)).local
    reduction = time.process_time() - begun
    lines = [f"| {given.n // 6} balls, {given.nc} contacts | reduction to W | {duration(reduction)} | | |"]
    measured = [ours(local, name, tol, limit) for name in OURS]
    if python is not None:
        named = FclibProblem(f"spheres-{size}-{seed}", "local", local)
        with siconos_on(named, python) as siconos:
            for name in THEIRS:
                row = siconos.solve(name, STORAGE, tol, limit)
                if row["solved"]:
                    measured.append((f"Siconos {name}", row["cpu_seconds"], row["iterations"], row["error"]))
                else:
                    lines.append(f"| | Siconos {name} | {row['status']} | | |")
    for name, seconds, iterations, error in measured:
        lines.append(f"| | {name} | {duration(seconds)} | {iterations} | {error:.1e} |")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=[30_000], help="contacts, about")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--tol", type=float, default=1e-4)
    parser.add_argument("--limit", type=float, default=60.0, help="seconds a solve")
    parser.add_argument("--siconos-python", type=Path, default=Path("/usr/bin/python3"))
    parser.add_argument("--without-siconos", action="store_true")
    arguments = parser.parse_args()
    python = None if arguments.without_siconos else arguments.siconos_python
    if python is not None:
        print(f"Siconos {siconos_version(python) or 'is not there'}\n")
    print("| bed | what | processor time | iterations | error |\n|---|---|---:|---:|---:|")
    for size in arguments.sizes:
        print("\n".join(rows(size, arguments.seed, arguments.tol, arguments.limit, python)), flush=True)


if __name__ == "__main__":
    main()
