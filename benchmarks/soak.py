"""Twenty thousand steps of a shaken wall: memory that does not grow, energy that balances, a run in two halves equal to a whole one.

    python benchmarks/soak.py                  20 000 steps whole, and again to the middle, killed there, and on
    python benchmarks/soak.py --steps 4000

Four rigid blocks in two courses on a base that swings so strongly that they slide in every cycle. The process is forked, so that its
memory is its own, and is asked for its resident memory after every step. Exit code 1 where something is not as it should be:

* memory after step 1000 grows by less than 1 % (the largest against that of steps 900 to 1000);
* the energy balance of all steps together closes to 1e-8 of the work that the base has done, up and down, and of what friction took;
* the run that was killed by SIGKILL in the middle and resumed has the same table of steps and the same checkpoint, byte by byte but for
  seconds.
"""

from __future__ import annotations

import argparse
import csv
import os
import signal
import sys
import tempfile
from array import array
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from fcsim import (
    Case,
    Detector,
    Gap,
    GravityRamp,
    Material,
    Simulation,
    SolverSettings,
    Step,
    Support,
    SurfacePair,
    Theta,
    build_model,
    contact_force,
    contact_surface,
)
from fcsim.mesh import blocks_that_are, rigid_box, running_bond
from fcsim.running.case import load_case
from fcsim.running.run import RunOptions, run_case

GRAVITY = 9.81
OPTIONS = RunOptions(export_every=0, vtk_every=0, checkpoint_every=500)
SETTLED = 1000
GROWTH, BALANCE = 0.01, 1e-8
COUNTED = ("load_work", "support_work", "damping_dissipation", "numerical_dissipation", "normal_dissipation", "tangential_dissipation")


@dataclass(frozen=True)
class Parameters:
    """SI units; the base's acceleration is a sine of `shaking`."""

    courses: int = 2
    blocks: float = 1.5
    friction: float = 0.4
    shaking: float = 6.0
    frequency: float = 4.0
    h: float = 1e-3
    steps: int = 20_000
    tol: float = 1e-9


def build(p: Parameters) -> Case:
    """A wall of rigid blocks on a base that swings along x."""
    wall = running_bond(p.courses, p.blocks, (0.2, 0.1, 0.1), (2, 1, 1), material=Material(1e9, 0.2, 2000.0))
    length, _, _ = wall.size
    base = rigid_box("base", (10 * length, 10 * length, 0.1), (length / 2, 0.05, -0.05), 100.0)
    omega = 2 * np.pi * p.frequency
    model = build_model(
        [*blocks_that_are("rigid", wall.bodies), base],
        supports=[
            Support("base", ("y", "z", "rx", "ry", "rz")),
            Support("base", ("x",), velocity=lambda t: p.shaking / omega * (1 - np.cos(omega * t)) - p.shaking / omega),
        ],
        gravity=GravityRamp((0.0, 0.0, -GRAVITY), -1.0, 0.0),
    )
    names = np.array([body.name for body in wall.bodies])
    first, lower, upper = names[wall.bodies_of_course(1)], names[wall.course < wall.courses], names[wall.course > 1]
    pairs = [
        SurfacePair(*(contact_surface(model, [(n, s) for n in of]) for of, s in sides), p.friction, 2e-3, "nodes", name)
        for name, *sides in (
            ("base", (first, wall.bottom), (["base"], "z+")),
            ("beds", (upper, wall.bottom), (lower, wall.top)),
            ("heads", (names, "x-"), (names, "x+")),
        )
    ]
    settings = SolverSettings(tol=p.tol)
    simulation = Simulation(model, Detector(pairs, model.n_nodes), Theta(p.h, 0.5, Gap()), p.steps, settings)
    return Case("soak", "Shaken wall", simulation, (contact_force("base_Rx", model, "base", "x"),))


def resident() -> int:
    """[bytes] Of this process, mapped files left out."""
    _, pages, of_files, *_ = map(int, Path("/proc/self/statm").read_text().split())
    return (pages - of_files) * os.sysconf("SC_PAGE_SIZE")


def in_a_process(out: Path, steps: int, resume: bool = False, killed_after: int = 0) -> list[int]:
    """Run the case in a process of its own and return its memory after each step, [] where it was killed."""
    memory = out.with_suffix(".memory")
    child = os.fork()
    if child == 0:
        seen = array("q")  # eight bytes a step

        def watch(case: Case, step: Step) -> None:
            seen.append(resident())
            if step.number == killed_after:
                os.kill(os.getpid(), signal.SIGKILL)

        code = 1
        try:
            summary = run_case(load_case(__file__), {"steps": str(steps)}, out, OPTIONS, resume=resume, watch=watch)
            print(f"{out.name}: {summary.status}, {summary.computed} steps in {summary.wall_time:.0f} s {summary.message}", flush=True)
            memory.write_text("\n".join(map(str, seen)))
            code = 0 if summary.converged else 1
        finally:
            os._exit(code)
    _, status = os.waitpid(child, 0)
    if killed_after:
        assert os.WIFSIGNALED(status), status
        return []
    if status != 0:
        raise SystemExit(f"{out}: the run did not end well")
    return [int(line) for line in memory.read_text().splitlines()]


def rows(out: Path) -> list[dict[str, str]]:
    """steps.csv without seconds, and without the overlaps, which are looked for at a run's end too."""
    with (out / "steps.csv").open(newline="", encoding="utf-8") as file:
        return [{k: v for k, v in row.items() if not k.startswith(("seconds", "overlap"))} for row in csv.DictReader(file)]


def state(out: Path) -> dict[str, bytes]:
    with h5py.File(out / "checkpoint.h5") as file:
        return {name: np.asarray(file[name]).tobytes() for name in ("x", "v")}


def imbalance(table: list[dict[str, str]]) -> float:
    """The sum of all steps' residuals over the sum of all works and dissipations, each by its size."""
    total = sum(float(row["energy_residual"]) for row in table)
    return abs(total) / sum(abs(float(row[name])) for row in table for name in COUNTED)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument("--steps", type=int, default=20_000, help="more than 1000 (default 20 000)")
    steps = parser.parse_args().steps
    with tempfile.TemporaryDirectory() as folder:
        whole, halved = Path(folder) / "whole", Path(folder) / "halved"
        memory = in_a_process(whole, steps)
        in_a_process(halved, steps, killed_after=steps // 2 + 123)
        in_a_process(halved, steps, resume=True)
        table = rows(whole)
        growth = max(memory[SETTLED:]) / max(memory[SETTLED - 100 : SETTLED]) - 1
        sliding = sum(int(row["sliding"]) > 0 for row in table)
        same = table == rows(halved) and state(whole) == state(halved)
        balance = imbalance(table)
        cut = sum(int(row["substeps"]) > 1 for row in table)
    print(f"{steps} steps, {sliding} of them with sliding contacts, {cut} cut; error at most {max(float(r['error']) for r in table):.1e}")
    print(
        f"memory: {memory[SETTLED] / 2**20:.1f} MiB after step {SETTLED}, growth from there {100 * growth:.2f} % (less than {GROWTH:.0%})"
    )
    print(f"energy: all residuals together {balance:.1e} of the works (less than {BALANCE:g})")
    print(f"killed after step {steps // 2 + 123} and resumed: {'equal in every value' if same else 'DIFFERENT'}")
    return 0 if growth < GROWTH and balance < BALANCE and same and sliding > steps // 10 else 1


if __name__ == "__main__":
    sys.exit(main())
