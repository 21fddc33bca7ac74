"""A small set of computations against recorded ratios: what got slower, what got faster.

    python benchmarks/compare.py                  measures and compares with benchmarks/ratios.json; exit code 1 where something is slower
    python benchmarks/compare.py --record         measures and writes benchmarks/ratios.json

What is recorded is no time but its ratio to a fixed piece of NumPy work done in the same process, before and after it (a Cholesky factor,
products with a large matrix), so that records hold, roughly, from machine to machine and from hour to hour. Processor time; medians.
Linear algebra on one thread.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy is loaded
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from fcsim.errors import InputError
from fcsim.files import replacing
from fcsim.problem.reduction import reduce
from fcsim.running.case import load_case
from fcsim.running.parameters import parse_parameters
from fcsim.solvers import Memory, solve

CASE = Path(__file__).resolve().parents[1] / "cases" / "masonry_wall"
RATIOS = Path(__file__).with_name("ratios.json")
STEPS = 40
SWEEPS = 300
SLOWER = 1.3
"""A ratio that grew by this factor counts as slower; less is within what the processor's clock and caches do."""


def median_seconds(work: Callable[[], object], repeat: int = 5) -> float:
    """Median processor time of `work`, after one run that is not measured."""
    work()
    seconds = []
    for _ in range(repeat):
        start = time.process_time()
        work()
        seconds.append(time.process_time() - start)
    return statistics.median(seconds)


def reference_work() -> Callable[[], object]:
    """The unit: a Cholesky factor of order 1500 and 30 products with its matrix, half compute-bound and half memory-bound."""
    root = np.random.default_rng(0).standard_normal((1500, 1500))
    A = root @ root.T + 1500 * np.eye(1500)
    x = np.ones(1500)

    def work() -> object:
        for _ in range(30):
            A @ x
        return np.linalg.cholesky(A)

    return work


def measurements() -> Iterator[tuple[str, float]]:
    """What is compared, with its processor time [s]."""
    script = load_case(CASE)
    case = script.build(parse_parameters(script, {"steps": str(STEPS)}))
    simulation = case.simulation
    _ = simulation.factor, simulation.matrix
    start, last = time.process_time(), None
    for step in simulation:
        last = step
    assert last is not None
    yield f"wall: a step (mean of {STEPS})", (time.process_time() - start) / STEPS
    positions = simulation.model.positions(simulation.scheme.detection_configuration(simulation.model, last.previous))
    yield "wall: detection", median_seconds(lambda: simulation.detector(positions))
    problem, local = last.problem, last.reduction.local
    yield "wall: W from a global problem", median_seconds(lambda: reduce(replace(problem)).local, 3)
    memory = solve(local, "NSN-AC", tol=1e-8, memory=Memory.of(np.arange(local.nc))).memory  # as in a simulation: a factor is held
    yield "wall: NSN-AC from r = 0 to 1e-8", median_seconds(lambda: solve(replace(local), "NSN-AC", tol=1e-8, memory=memory), 3)
    yield "wall: NSN-NM from r = 0 to 1e-8", median_seconds(lambda: solve(replace(local), "NSN-NM", tol=1e-8), 3)
    yield f"wall: {SWEEPS} sweeps of NSGS-AC", median_seconds(lambda: solve(replace(local), "NSGS-AC", tol=1e-14, max_iterations=SWEEPS), 3)
    rng = np.random.default_rng(1)
    root = rng.standard_normal((90, 90))
    small = replace(local, W=root @ root.T + np.eye(90), q=rng.standard_normal(90), mu=np.full(30, 0.5))
    yield "30 contacts: auto to 1e-8", median_seconds(lambda: solve(small, "auto", tol=1e-8), 100)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--record", action="store_true", help=f"write {RATIOS.name} instead of comparing with it")
    options = parser.parse_args()
    recorded: dict[str, float] = {}
    if not options.record:
        if not RATIOS.is_file():
            raise InputError(f"{RATIOS.name}: expected the recorded ratios beside this script, found none; make them with --record")
        recorded = json.loads(RATIOS.read_text(encoding="utf-8"))
    work = reference_work()
    units = [median_seconds(work)]
    table = Table()
    table.add_column("what")
    for heading in ("now", "recorded", "now / recorded"):
        table.add_column(heading, justify="right")
    table.add_column("")
    ratios, slower = {}, []
    for name, seconds in measurements():
        units.append(median_seconds(work))
        ratios[name] = ratio = seconds / statistics.fmean(units[-2:])
        before = recorded.get(name)
        change = ratio / before if before else None
        if change is not None and change > SLOWER:
            slower.append(name)
        verdict = "" if change is None else "slower" if change > SLOWER else "faster" if change < 1 / SLOWER else "as before"
        table.add_row(name, f"{ratio:.3g}", f"{before:.3g}" if before else "", f"{change:.2f}" if change else "", verdict)
    table.title = f"ratios to {1e3 * min(units):.1f} to {1e3 * max(units):.1f} ms of NumPy work, load {os.getloadavg()[0]:.1f}"
    console = Console(width=110)
    console.print(table)
    if options.record:
        with replacing(RATIOS) as temporary:
            temporary.write_text(
                json.dumps({name: float(f"{ratio:.4g}") for name, ratio in ratios.items()}, indent=1) + "\n", encoding="utf-8"
            )
        console.print(f"recorded in {RATIOS.name}")
    elif slower:
        console.print(f"slower than recorded by more than {SLOWER:g} times: {'; '.join(slower)}", highlight=False)
    return 1 if slower else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except InputError as error:
        sys.exit(f"compare.py: {error}")
