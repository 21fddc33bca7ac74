"""Seconds a step of the masonry wall, by phase and solver.

    .venv/bin/python benchmarks/wall.py                 the whole wall, 500 steps, default solver
    .venv/bin/python benchmarks/wall.py --steps 60 --solver NSN-AC --solver NSN-NM

Nothing is written: detection, assembly (W, loads, states) and solve are timed as the simulation itself does; output is not part of it.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import time
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from fcsim.errors import NotConverged
from fcsim.running.case import load_case
from fcsim.running.parameters import parse_parameters

CASE = Path(__file__).resolve().parents[1] / "cases" / "masonry_wall"
PHASES = ("detection", "assembly", "solve")


def measure(assignments: dict[str, str]) -> tuple[dict[str, list[float]], int, float, str]:
    """Run the wall; return the seconds of each step by phase, Newton iterations, the set-up's seconds and how it ended."""
    begin = time.perf_counter()
    script = load_case(CASE)
    case = script.build(parse_parameters(script, assignments))
    _ = case.simulation.factor, case.simulation.matrix
    set_up = time.perf_counter() - begin
    seconds: dict[str, list[float]] = {phase: [] for phase in PHASES}
    iterations, status = 0, "converged"
    try:
        for step in case.simulation:
            for phase in PHASES:
                seconds[phase].append(step.seconds[phase])
            iterations += step.result.iterations
    except NotConverged as error:
        status = str(error)
    return seconds, iterations, set_up, status


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=500)
    parser.add_argument("--solver", action="append", help="may be given several times (default: NSN-AC)")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", dest="assignments")
    options = parser.parse_args()
    given = dict(text.split("=", 1) for text in options.assignments)
    table = Table(title=f"masonry wall, {options.steps} steps, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    table.add_column("solver")
    for heading in (*(f"{phase}\n[ms]" for phase in PHASES), "mean step\n[ms]", "median step\n[ms]", "iterations\na step", "set-up\n[s]"):
        table.add_column(Text(heading), justify="right")  # Text: [ms] is a unit, not a style
    table.add_column("ended")
    for solver in options.solver or ["NSN-AC"]:
        seconds, iterations, set_up, status = measure({**given, "steps": str(options.steps), "solver": solver})
        count = max(len(seconds["solve"]), 1)
        steps = [sum(values) for values in zip(*seconds.values(), strict=True)] or [0.0]
        phases = [f"{1e3 * sum(seconds[phase]) / count:.1f}" for phase in PHASES]
        table.add_row(
            solver,
            *phases,
            f"{1e3 * statistics.fmean(steps):.1f}",
            f"{1e3 * statistics.median(steps):.1f}",
            f"{iterations / count:.1f}",
            f"{set_up:.2f}",
            f"step {count}, {status}",
        )
    console = Console(width=120)
    console.print(table)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10
    console.print(f"peak memory {peak:.0f} MiB", highlight=False)


if __name__ == "__main__":
    main()
