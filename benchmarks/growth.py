"""Walls of 12 to 2565 bricks: time and memory a step against the number of contacts.

    python benchmarks/growth.py                        12, 48, 192 and 768 bricks
    python benchmarks/growth.py --bricks 12 48 192 768 2565 --plot docs/growth.png
    python benchmarks/growth.py --bricks 2565 --steps 3
    python benchmarks/growth.py --output               and FCLIB and VTK files of every step
    python benchmarks/growth.py --solver NSN-AC --tol 1e-6
    python benchmarks/growth.py --solver NSN-AC --tol 1e-6 --first 12 --steps 20    once the first wave has passed the tallest wall, too

The wall of cases/masonry_wall (8 x 4 x 4 elements a brick) with as many courses and bricks as it takes, its whole weight and the platen's
laid on within step 2. Each step is solved, to 1e-4 unless --tol says so, by ADMM with one factorisation of W + rho I, rho = 3e-5 ||W||, or
by another method, from the previous steps' reactions; steps 3 (--first) to the last count. Physics: the bottom platen's reaction over the
weight at the last step, which the wall still swings about by a few per mille to per cent, and at every step that reaction less the rate of
change of the vertical momentum, which is the weight to round-off. Each wall runs in a process of its own, so that its peak memory is its
own; processor time serves on a busy machine. The files are those of `fcsim run --export-every 1 --vtk-every 1`, in a temporary folder;
their seconds stand beside those of the step.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import json
import math
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy

from rich.console import Console
from rich.table import Table

from fcsim.export_fclib.chunks import Compressor
from fcsim.running.case import load_case
from fcsim.running.fclib_series import write_step
from fcsim.running.parameters import parse_parameters
from fcsim.running.vtk_series import SeriesWriter
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.step import Step

CASE = Path(__file__).resolve().parents[1] / "cases" / "masonry_wall"
WALLS = {12: (3, 3.5), 48: (6, 7.5), 192: (12, 15.5), 768: (24, 31.5), 2565: (45, 56.5)}
"""Bricks: courses, bricks a course."""
ADMM = {"initial_rho": "norm", "rho": 3e-5, "rho_update": "constant"}
"""Its options here."""
PHASES = ("detection", "assembly", "solve")
GRAVITY = 9.81
LABELS = {"step": "step without output", "cpu": "step without output, processor time", "output": "output (FCLIB, VTK)"}


class Output:
    """The files of the steps of one wall, in a folder that is removed."""

    def __init__(self, model: Any) -> None:
        self._folder = tempfile.TemporaryDirectory()
        self._path = Path(self._folder.name)
        self._series, self._compressor = SeriesWriter(self._path / "vtk", model), Compressor()

    def write(self, step: Step) -> tuple[float, float]:
        """Write the files of a step and remove them; return seconds and MB."""
        begin = time.perf_counter()
        write_step(self._path / "fclib", step, "wall", title=f"wall, step {step.number}", compression=self._compressor)
        self._series.write(step)
        seconds = time.perf_counter() - begin
        files = [path for path in self._path.rglob("*") if path.suffix in (".hdf5", ".vtu", ".vtp")]
        size = sum(path.stat().st_size for path in files)
        for path in files:
            path.unlink()
        return seconds, size / 1e6

    def close(self) -> None:
        self._folder.cleanup()


def measure(bricks: int, steps: int, output: bool = False, solver: str = "ADMM", tol: float = 1e-4, first: int = 3) -> dict[str, Any]:
    """Run one wall; medians over the steps from the `first` on. Output: its seconds and MB a step, and the seconds of the first step's."""
    courses, blocks = WALLS[bricks]
    begin = time.perf_counter()
    given = {"courses": str(courses), "blocks": str(blocks), "steps": str(steps), "gravity_last": "2"}
    case = load_case(CASE).build(parse_parameters(load_case(CASE), given))
    settings = SolverSettings(name=solver, tol=tol, options=ADMM if solver == "ADMM" else {}, fallback=())
    simulation = replace(case.simulation, solver=settings)
    _ = simulation.factor, simulation.matrix
    set_up = time.perf_counter() - begin
    model = simulation.model
    sensor = {s.column: s.measure for s in case.sensors}
    mass = sum(
        body.part.material.density * math.prod(map(float, body.part.points.max(0) - body.part.points.min(0))) for body in model.deformable
    )
    platen = model.rigid[model.number["top platen"] - len(model.deformable)].mass
    rows: list[dict[str, float]] = []
    imbalance = 0.0
    reaction, weight = math.nan, GRAVITY * (mass + platen)
    writer = Output(model) if output else None
    first_output = math.nan
    before = time.process_time()
    for step in simulation:
        seconds = {**step.seconds, "cpu": time.process_time() - before, "output": math.nan, "output_MB": math.nan}
        if writer:
            seconds["output"], seconds["output_MB"] = writer.write(step)
            first_output = seconds["output"] if step.number == 1 else first_output
        if step.number >= first:  # from here on the whole weight acts at both ends of the step
            reaction = sensor["bottom_Rz"](step) / weight
            imbalance = max(imbalance, abs(reaction - sensor["inertia_z"](step) / weight - 1))
            rows.append({**seconds, "iterations": step.result.iterations, "error": step.result.error, "contacts": len(step.contacts)})
        words = f"{step.result.iterations} iterations, {sum(step.seconds.values()):.1f} s, processor time {seconds['cpu']:.1f} s"
        words += f", output {seconds['output']:.2f} s" if writer else ""
        print(f"  step {step.number}: {words}", file=sys.stderr, flush=True)
        before = time.process_time()
        del step
    if writer:
        writer.close()
    middle = {key: statistics.median(row[key] for row in rows) for key in (*PHASES, "cpu", "output", "output_MB", "iterations", "contacts")}
    return {
        "bricks": bricks,
        "dofs": model.n_dofs,
        **middle,
        "step": statistics.median(sum(row[phase] for phase in PHASES) for row in rows),
        "first_output": first_output,
        "set_up": set_up,
        "error": max(row["error"] for row in rows),
        "reaction": reaction,
        "imbalance": imbalance,
        "peak_MiB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def exponents(rows: list[dict[str, Any]], key: str) -> list[float]:
    """Slope of log key against log contacts from each wall to the next."""
    pairs = itertools.pairwise(rows)
    return [math.log(b[key] / a[key]) / math.log(b["contacts"] / a["contacts"]) for a, b in pairs]


def report(rows: list[dict[str, Any]], solver: str, tol: float) -> Table:
    load = f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors"
    table = Table(title=f"walls, {solver} at {tol:g}, {load}; step without output; exponents from wall to wall")
    headings = [
        "bricks",
        "dofs",
        "contacts",
        *(f"{p}\n[s]" for p in PHASES),
        "step\n[s]",
        "processor\n[s]",
        "output\n[s]",
        "output\n[MB]",
        "exponent",
        "iterations",
        "error",
    ]
    for heading in (*headings, "reaction\n/ weight", "imbalance", "peak\n[MiB]", "exponent", "set-up\n[s]"):
        table.add_column(heading, justify="right")
    time_exponents, memory_exponents = ([math.nan, *exponents(rows, key)] for key in ("cpu", "peak_MiB"))
    for row, time_exponent, memory_exponent in zip(rows, time_exponents, memory_exponents, strict=True):
        cells = [f"{row[k]:.0f}" for k in ("bricks", "dofs", "contacts")]
        cells += [f"{row[k]:.3g}" for k in (*PHASES, "step", "cpu", "output", "output_MB")] + [
            f"{time_exponent:.2f}",
            f"{row['iterations']:.0f}",
            f"{row['error']:.1e}",
        ]
        cells += [
            f"{row['reaction']:.4f}",
            f"{row['imbalance']:.1e}",
            f"{row['peak_MiB']:.0f}",
            f"{memory_exponent:.2f}",
            f"{row['set_up']:.1f}",
        ]
        table.add_row(*cells)
    return table


def plot(rows: list[dict[str, Any]], path: Path) -> None:
    """Time by phase and memory against contacts, on log axes, with the slopes 1 and 1.3."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4.8), layout="constrained")
    seconds, memory = figure.subplots(1, 2)
    contacts = [row["contacts"] for row in rows]
    for key, style in (
        ("step", "ko-"),
        ("cpu", "C3x-"),
        ("solve", "C0s--"),
        ("assembly", "C1^:"),
        ("output", "C4d:"),
        ("detection", "C2v-."),
    ):
        values = [row[key] for row in rows]
        if not all(map(math.isnan, values)):
            seconds.loglog(contacts, values, style, label=LABELS.get(key, key))
    for slope, shade in ((1.0, "0.7"), (1.3, "0.4")):
        seconds.loglog(
            contacts, [rows[0]["step"] * (c / contacts[0]) ** slope for c in contacts], color=shade, lw=1, label=f"slope {slope}"
        )
    memory.loglog(contacts, [row["peak_MiB"] for row in rows], "ko-", label="peak memory of the process")
    memory.loglog(contacts, [rows[0]["peak_MiB"] * c / contacts[0] for c in contacts], color="0.7", lw=1, label="slope 1")
    for axes, label in ((seconds, "seconds a step"), (memory, "MiB")):
        axes.set(xlabel="contacts", ylabel=label)
        axes.grid(True, which="both", alpha=0.25)
        axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncol=2)  # below: curves fill the axes
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bricks", type=int, nargs="+", choices=tuple(WALLS), default=[12, 48, 192, 768])
    parser.add_argument("--steps", type=int, default=6, help="default 6")
    parser.add_argument("--first", type=int, default=3, help="the first that counts, at least 3 (default 3)")
    parser.add_argument("--output", action="store_true", help="write the FCLIB file and the VTK files of every step, and time that too")
    parser.add_argument("--solver", default="ADMM", help="a name of the table of solvers (default ADMM)")
    parser.add_argument("--tol", type=float, default=1e-4, help="error of each step (default 1e-4)")
    parser.add_argument("--csv", type=Path, help="write the table; walls that it has are not measured again")
    parser.add_argument("--plot", type=Path, help="write the picture")
    parser.add_argument("--measure", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.measure:
        print(json.dumps(measure(options.measure, options.steps, options.output, options.solver, options.tol, options.first)))
        return
    if not 3 <= options.first <= options.steps:
        parser.error(f"--first: expected a step from 3 to --steps {options.steps}, got {options.first}")
    rows: list[dict[str, Any]] = []
    if options.csv and options.csv.is_file():
        with options.csv.open(newline="", encoding="utf-8") as file:
            rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    for bricks in sorted(set(options.bricks) - {int(row["bricks"]) for row in rows}):
        print(f"{bricks} bricks", file=sys.stderr)
        command = [
            sys.executable,
            __file__,
            "--measure",
            str(bricks),
            "--steps",
            str(options.steps),
            "--first",
            str(options.first),
            *(["--output"] if options.output else []),
            *("--solver", options.solver, "--tol", str(options.tol)),
        ]
        rows.append(json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout))
        rows.sort(key=lambda row: row["bricks"])
        if options.csv:
            with options.csv.open("w", newline="", encoding="utf-8") as file:
                writer = csv.DictWriter(file, list(rows[0]))
                writer.writeheader()
                writer.writerows(rows)
    Console(width=200).print(report(rows, options.solver, options.tol))
    if options.plot:
        plot(rows, options.plot)


if __name__ == "__main__":
    main()
