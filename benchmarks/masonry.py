"""Masonry at the sizes that engineers asked for: python benchmarks/masonry.py [NAME ...], each with its goal in seconds.

* facade: 1012 rigid blocks in space, one step of statics under their weight, from the file on (goal 20 s)
* wall: `fcsim tilt` of a plane wall of 52 blocks until it falls (goal 10 s)
* corner: `fcsim tilt` of an L-corner of 56 blocks in space (goal 120 s)
* film: `fcsim tilt --out --film` of a facade of 40 blocks, two storeys: collapse angle, crack map, film (goal 120 s)

Prints seconds by the clock and of processor time, those of child processes with them.
Compiled kernels are kept: a second run counts.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np

from fcsim.command_line.main import main as fcsim
from fcsim.contact_detection import Everything
from fcsim.masonry import Acceleration, Block, MasonryProblem, read_model, structure, write_masonry
from fcsim.masonry.atlas.shapes import cuboid, wall
from fcsim.masonry.problem import GRAVITY
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation

LENGTH, HEIGHT, THICKNESS, MU = 0.4, 0.2, 0.2, 0.6
PLAIN, EVEN, ODD, LINTEL, TOP = (0.5, 1, 1, 1, 0.5), (1, 0.5, -1, 0.5, 1), (0.5, 1, -1, 1, 0.5), (1, 2, 1), (4 / 3,) * 3
STOREYS = (PLAIN, EVEN, ODD, LINTEL, PLAIN, EVEN, ODD, LINTEL, PLAIN, TOP)
"""Courses of 40 blocks with a window in each of two storeys, in units of a block's length, voids negative."""
GOALS = {"facade": 20.0, "wall": 10.0, "corner": 120.0, "film": 120.0}


def on_a_floor(name: str, dimension: int, blocks: Iterator[Block]) -> MasonryProblem:
    """Blocks under their weight on a wide floor."""
    solid = tuple(blocks)
    points = np.concatenate([block.surface.points for block in solid])
    low, high = points.min(axis=0) - 1, points.max(axis=0) + 1
    if dimension == 2:
        low[1], high[1] = 0.0, THICKNESS
    floor = cuboid("floor", low, (high[0], high[1], 0.0), support=True)
    return MasonryProblem(name, dimension, (floor, *solid), MU, (Acceleration((0.0, 0.0, -GRAVITY)),))


def facade(units: int, courses: int) -> Iterator[Block]:
    """Running bond with half blocks at the ends of every second course."""
    for course in range(courses):
        ends = [0.0, *(k + 0.5 * (1 + (course + 1) % 2) for k in range(units - (course + 1) % 2)), float(units)]
        for k, (a, b) in enumerate(pairwise(ends)):
            yield cuboid(f"c{course}b{k}", (a * LENGTH, 0, course * HEIGHT), (b * LENGTH, THICKNESS, (course + 1) * HEIGHT))


def corner(units: int, courses: int) -> Iterator[Block]:
    """Two legs along x and y that take turns at the corner."""
    for course in range(courses):
        low, high = course * HEIGHT, (course + 1) * HEIGHT
        for leg in (0, 1):
            begin = THICKNESS if leg != course % 2 else 0.0
            for k in range(units):
                a, b = begin + k * LENGTH, begin + (k + 1) * LENGTH
                ends = ((a, 0.0), (b, THICKNESS)) if leg == 0 else ((0.0, a), (THICKNESS, b))
                yield cuboid(f"c{course}l{leg}b{k}", (*ends[0], low), (*ends[1], high))


def stands(path: Path) -> None:
    """One step of statics of the file's blocks."""
    problem = read_model(path)
    model, _ = structure(problem)
    (step,) = Simulation(model, Everything(model, problem.friction), QuasiStatic(1.0, 1e-6 * GRAVITY), 1, created=np.inf)
    print(f"facade: {len(problem.blocks) - 1} blocks, {len(step.contacts)} contacts, error {step.result.error:.1e}")


def main(names: list[str]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        write_masonry(place / "facade.json", on_a_floor("facade", 3, facade(40, 25)))
        write_masonry(place / "wall.json", on_a_floor("wall", 2, facade(7, 7)))
        write_masonry(place / "film.json", wall(STOREYS, (0.6, 0.3), MU, depth=0.3))
        write_masonry(place / "corner.json", on_a_floor("corner", 3, corner(4, 7)))
        for name in names or GOALS:
            clock, cpu = time.perf_counter(), sum(os.times()[:4])
            if name == "facade":
                stands(place / "facade.json")
            else:
                film = ["--out", str(place / "out"), "--film"] if name == "film" else []
                fcsim(["tilt", str(place / f"{name}.json"), *film])
            clock, cpu = time.perf_counter() - clock, sum(os.times()[:4]) - cpu
            print(f"==== {name}: {clock:.1f} s by the clock, {cpu:.1f} s of processor; goal {GOALS[name]:.0f} s", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
