"""Processor time of a step of the masonry wall with linear, turning and neo-Hookean blocks, beside each other.

    OMP_NUM_THREADS=1 .venv/bin/python benchmarks/nonlinear_wall.py
    OMP_NUM_THREADS=1 .venv/bin/python benchmarks/nonlinear_wall.py --steps 200 --kinds linear,turning

The three walls take their steps in turns, so that what else the machine does meets all alike; medians and ratios are printed. Nothing is
written.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.table import Table

from fcsim.errors import InputError
from fcsim.mesh import Body, Material
from fcsim.mesh.material import neo_hooke
from fcsim.running.case import load_case
from fcsim.running.parameters import parse_parameters
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step

CASE = Path(__file__).resolve().parents[1] / "cases" / "masonry_wall"
KINDS = ("linear", "turning", "neo-hooke")


def wall(kind: str, assignments: dict[str, str], loop: str = "auto") -> Simulation:
    """The wall with blocks of one of `KINDS`; loop: see `SolverSettings`."""
    script = load_case(CASE)
    simulation = script.build(parse_parameters(script, assignments)).simulation
    simulation = replace(simulation, solver=replace(simulation.solver, loop=loop))
    model = simulation.model
    if kind == "linear":
        return simulation
    if kind == "turning":
        return replace(simulation, model=replace(model, kinematics="turning"))
    parts = {id(body.part): body.part for body in model.bodies if isinstance(body, Body)}
    rubber = {}
    for key, part in parts.items():
        stone = part.material
        assert isinstance(stone, Material)
        rubber[key] = replace(part, material=neo_hooke(stone.E, stone.nu, stone.density))
    bodies = tuple(replace(body, part=rubber[id(body.part)]) if isinstance(body, Body) else body for body in model.bodies)
    return replace(simulation, model=replace(model, bodies=bodies, kinematics="turning"))


def measure(kinds: list[str], steps: int, assignments: dict[str, str], loop: str) -> tuple[dict[str, list[float]], dict[str, list[int]]]:
    """Seconds of processor time of each step by kind, and the linearised problems of each."""
    runs: dict[str, Iterator[Step]] = {kind: iter(wall(kind, {**assignments, "steps": str(steps)}, loop)) for kind in kinds}
    seconds: dict[str, list[float]] = {kind: [] for kind in kinds}
    problems: dict[str, list[int]] = {kind: [] for kind in kinds}
    for number in range(steps):
        for kind, run in runs.items():
            begin = time.process_time()
            step = next(run)
            taken = time.process_time() - begin
            if number:  # the first one sets up
                seconds[kind].append(taken)
                problems[kind].append(max(len(step.linearised), len(step.attempts)))
    return seconds, problems


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=60)
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", dest="assignments")
    parser.add_argument("--loop", default="auto", choices=("auto", "one", "sequence"))
    options = parser.parse_args()
    kinds = options.kinds.split(",")
    if unknown := [kind for kind in kinds if kind not in KINDS]:
        raise InputError(f"--kinds: expected some of {', '.join(KINDS)}, got {unknown[0]!r}")
    seconds, problems = measure(kinds, options.steps, dict(text.split("=", 1) for text in options.assignments), options.loop)
    table = Table(
        "blocks", "median step [s]", "of the first", "Newton problems", title=f"masonry wall, {options.steps} steps, processor time"
    )
    first = statistics.median(seconds[kinds[0]])
    for kind in kinds:
        median = statistics.median(seconds[kind])
        table.add_row(kind, f"{median:.3f}", f"{median / first:.2f}", f"{statistics.fmean(problems[kind]):.1f}")
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
