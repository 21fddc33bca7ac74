"""This code on one thread and on several, and an earlier one (its folder) in turns: seconds, ratios, memory, and whether bits are the same.

    python benchmarks/threads.py --against FOLDER                            the wall's 500 steps with their files, three times
    python benchmarks/threads.py --against FOLDER --problem refined          steps 1 to 100 of a refined wall
    python benchmarks/threads.py --against FOLDER --problem 192 --repeat 1   bricks under their weight by ADMM to 1e-6, steps 3 to 6
    python benchmarks/threads.py --problem wall refined 192 768 2565

Each measurement is a process of its own. Walls: `run_case` with its default output, seconds from the second step's end to the run's;
growth: the wall of benchmarks/growth.py at 1e-6, the median seconds of a step without output. Medians of the repetitions; "main" is the
processor time of the thread that computes the steps, "process" that of all, so that both say something on a busy machine too. Bits are
those of the reactions of every step. FOLDER holds a clone of an earlier commit, run by the same Python.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fcsim.timestep.step import Step

HERE = Path(__file__).resolve().parents[1]
CASE = Path("cases") / "masonry_wall"
RUNS = {"wall": {"steps": "500"}, "refined": {"steps": "100", "divisions": "16,8,8"}}
GROWTH = {"192": ("12", "15.5"), "768": ("24", "31.5"), "2565": ("45", "56.5")}
"""Courses, bricks a course, see benchmarks/growth.py."""
ADMM = {"initial_rho": "norm", "rho": 3e-5, "rho_update": "constant"}


class Watch:
    """Looks at the steps: their reactions' digest, seconds and processor time from a step's end on."""

    def __init__(self, begin: int) -> None:
        self._begin, self._digest = begin, hashlib.sha256()
        self.marks: list[tuple[float, float, float]] = []

    def __call__(self, _: object, step: Step) -> None:
        self._digest.update(step.result.r.tobytes())
        if step.number >= self._begin:
            self.mark()

    def mark(self) -> None:
        self.marks.append((time.perf_counter(), time.thread_time(), time.process_time()))

    def found(self) -> dict[str, object]:
        """Seconds in all and by step."""
        wall, main, process = (after - before for before, after in zip(self.marks[0], self.marks[-1], strict=True))
        steps = [b[0] - a[0] for a, b in zip(self.marks[:-1], self.marks[1:], strict=True)]
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10
        median = statistics.median(steps)
        return {"all": wall, "main": main, "process": process, "median": median, "bits": self._digest.hexdigest(), "peak_MiB": peak}


def measure(problem: str, steps: str | None, folder: Path) -> dict[str, object]:
    """Measure with the fcsim that this process imports, of whichever layout."""
    try:
        places = [import_module(f"fcsim.{name}") for name in ("running.case", "running.parameters", "running.run", "timestep.chain")]
    except ImportError:  # commits before the rooms were
        places = [import_module(f"fcsim.{name}") for name in ("case", "case", "run", "timestep.simulation")]
    load_case, parse_parameters, run_case, SolverSettings = (
        getattr(place, name) for place, name in zip(places, ("load_case", "parse_parameters", "run_case", "SolverSettings"), strict=True)
    )
    script = load_case(folder / CASE)
    if problem in RUNS:
        watch = Watch(2)
        with tempfile.TemporaryDirectory() as out:
            given = RUNS[problem] | ({"steps": steps} if steps else {})
            summary = run_case(script, given, Path(out) / "run", watch=watch)
        watch.mark()
        if summary.status != "finished":
            raise SystemExit(f"{problem}: {summary.status}: {summary.message}")
        return watch.found()
    courses, blocks = GROWTH[problem]
    case = script.build(parse_parameters(script, {"courses": courses, "blocks": blocks, "steps": steps or "6", "gravity_last": "2"}))
    settings = SolverSettings(name="ADMM", tol=1e-6, options=ADMM, fallback=())
    watch = Watch(2)
    for step in replace(case.simulation, solver=settings):
        watch(case, step)
        print(f"  step {step.number}: {step.result.iterations} iterations, {sum(step.seconds.values()):.1f} s", file=sys.stderr, flush=True)
        del step
    return watch.found()


@dataclass(frozen=True)
class Code:
    """Code to measure: its folder, and how many threads it is told to take (None: as many as it takes)."""

    name: str
    folder: Path
    threads: str | None

    def run(self, problem: str, steps: str | None) -> dict[str, object]:
        """Measure in a new process."""
        known = {key: value for key, value in os.environ.items() if key != "FCSIM_THREADS"}
        environment = known | {"PYTHONPATH": str(self.folder)} | ({"FCSIM_THREADS": self.threads} if self.threads else {})
        command = [sys.executable, "-P", str(Path(__file__).resolve()), "--measure", problem, "--folder", str(self.folder)]
        command += ["--steps", steps] if steps else []
        ended = subprocess.run(command, env=environment, cwd=self.folder, stdout=subprocess.PIPE, text=True, check=True)
        found: dict[str, object] = json.loads(ended.stdout.splitlines()[-1])
        return found


def middle(found: list[dict[str, object]], key: str) -> float:
    return statistics.median(float(str(one[key])) for one in found)


def report(problem: str, found: dict[str, list[dict[str, object]]]) -> None:
    """Print the table of a problem, the ratios to its first line."""
    from rich.console import Console
    from rich.table import Table

    key = "all" if problem in RUNS else "median"
    table = Table(title=f"{problem}: load {os.getloadavg()[0]:.1f} on {len(os.sched_getaffinity(0))} processors")
    headings = ("", "seconds" if problem in RUNS else "seconds a step", "ratio", "main", "process", "peak MiB", "bits")
    for heading in headings:
        table.add_column(heading, justify="right")
    first = next((middle(rows, key) for rows in found.values()), math.nan)
    for name, rows in found.items():
        seconds = middle(rows, key)
        cells = [f"{seconds:.2f}", f"{first / seconds:.2f}", *(f"{middle(rows, k):.2f}" for k in ("main", "process"))]
        table.add_row(name, *cells, f"{middle(rows, 'peak_MiB'):.0f}", str(rows[0]["bits"])[:8])
    Console(width=120).print(table)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", type=Path, help="a clone of an earlier commit")
    parser.add_argument("--problem", nargs="+", default=["wall"], choices=[*RUNS, *GROWTH])
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--threads", default=None, help="of the second measurement of this code (default: as many as it takes by itself)")
    parser.add_argument("--steps", default=None, help="fewer or more steps than the problem has")
    parser.add_argument("--measure", help=argparse.SUPPRESS)
    parser.add_argument("--folder", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.measure:
        print(json.dumps(measure(options.measure, options.steps, options.folder)))
        return
    codes = [Code("one thread", HERE, "1"), Code(f"{options.threads or 'all'} threads", HERE, options.threads)]
    if options.against:
        codes.insert(0, Code("before", options.against.resolve(), None))
    for problem in options.problem:
        found: dict[str, list[dict[str, object]]] = {code.name: [] for code in codes}
        for _ in range(options.repeat):
            for code in codes:  # in turns: the machine's speed varies by the hour
                found[code.name].append(code.run(problem, options.steps))
        report(problem, found)


if __name__ == "__main__":
    main()
