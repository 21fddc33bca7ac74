"""A dry facade, two storeys with a door, a window and their lintels, on a table tilted until it falls, and on to the rubble.

See README.md beside this file.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from itertools import groupby
from typing import NamedTuple

import numpy as np

from fcsim import (
    Body,
    Case,
    Everything,
    FloatArray,
    Gap,
    History,
    InputError,
    Material,
    Model,
    Sensor,
    Simulation,
    SolverSettings,
    Support,
    Theta,
    build_model,
    main,
)
from fcsim.assembly.layout import DIRECTIONS
from fcsim.mesh import BlockKind, blocks_that_are, brick, rigid_box

GRAVITY = 9.81  # [m/s^2]
TABLE = 0.15  # thickness by the facade's height

LAYOUT = (
    "ABBCCDDE",
    "AALLLLBB",
    "ABB..CCD",
    "AAB..CDD",
    "ABBCCDDE",
    "AALLLLBB",
    "ABB..CCD",
    "AAB..CDD",
    "ABB..CCD",
    "AAB..CDD",
)
"""The courses from above; a letter is half a block wide, neighbouring equal letters are one block, points are openings."""


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units, angles in degrees. start, rate, stop: the table's tilt at t = 0, its speed, and where it ends.

    half: width of half a block, its height and its depth; divisions: elements of half a block; E, nu, beta: of deformable blocks
    """

    half: tuple[float, float, float] = (0.2, 0.2, 0.2)
    divisions: tuple[int, int, int] = (1, 1, 1)
    blocks_are: BlockKind = "rigid"
    E: float = 1e9
    nu: float = 0.2
    density: float = 2000.0
    beta: float = 1e-4
    mu: float = 0.6
    start: float = 23.5
    rate: float = 5.0
    stop: float = 28.0
    h: float = 5e-3
    theta: float = 0.5
    steps: int = 800
    solver: str = "auto"
    tol: float = 1e-4


class Block(NamedTuple):
    """A block's place in its course: from the column `first` to before `last`, in the row `row` from below, in half blocks."""

    row: int
    first: int
    last: int


def blocks() -> list[Block]:
    """The blocks of the layout, course by course from below."""
    found: list[Block] = []
    for row, course in enumerate(reversed(LAYOUT)):
        column = 0
        for letter, run in groupby(course):
            first, column = column, column + len(list(run))
            if letter != ".":
                found.append(Block(row, first, column))
    return found


def build(p: Parameters) -> Case:
    """Return the case with the given parameters."""
    if not 0 <= p.start < 90 or not p.start <= p.stop < 90 or not p.rate >= 0:
        raise InputError(f"tilting_facade: expected 0 <= start <= stop < 90 degrees and a rate >= 0, got {p.start}, {p.stop}, {p.rate}")
    model = facade_model(p)
    table = model.number["table"]
    simulation = Simulation(model, Everything(model, p.mu), Theta(p.h, p.theta, Gap()), p.steps, SolverSettings(name=p.solver, tol=p.tol))
    weight = GRAVITY * p.density * float(np.prod(p.half)) * sum(block.last - block.first for block in blocks())
    highest = model.reference[: model.node_offset[table], 2].max()
    top = np.flatnonzero(model.reference[:, 2] > highest - 1e-6 * p.half[1])
    return Case(
        name="tilting_facade",
        title=f"A facade of {len(blocks())} blocks on a tilting table",
        simulation=simulation,
        sensors=(
            Sensor("tilt", "tilt of the table", "degrees", lambda s: tilt(p, s.state.t)),
            Sensor("drift", "displacement of the top, downhill", "m", lambda s: float(model.node_displacement(s.state.x)[top, 0].mean())),
            Sensor("table_Rz", "force on the table, normal", "N", lambda s: -float(s.contact_force_on(table)[2])),
            Sensor("table_Rx", "force on the table, downhill", "N", lambda s: -float(s.contact_force_on(table)[0])),
        ),
        plots={
            "reaction": ("table_Rz", "table_Rx"),
            "bound": (weight, "weight"),
            "histories": (History("drift", ("drift",), against="tilt"), History("tilt", ("tilt",))),
        },
        fclib_set="FCSIM_TiltingFacade",
        description=f"{len(blocks())} blocks ({p.blocks_are}) of {weight:.0f} N, mu = {p.mu:g}, {model.n_dofs} degrees of freedom",
    )


def tilt(p: Parameters, t: float) -> float:
    """The table's angle at the time t [s], in degrees."""
    return min(p.start + p.rate * max(t, 0.0), p.stop)


def facade_model(p: Parameters) -> Model:
    """Blocks on a held table with a rim that stops the rubble, in the table's axes: gravity turns instead, x is downhill. (The table
    turns so slowly that its own acceleration, rate^2 times the height, is 2e-3 of gravity.)"""
    width, height, depth = p.half
    nx, ny, nz = p.divisions
    material = Material(p.E, p.nu, p.density)
    parts = {
        halves: brick(f"{halves} halves", (halves * width, depth, height), (halves * nx, ny, nz), material, elements="Q1-enhanced")
        for halves in {block.last - block.first for block in blocks()}
    }
    placed = [
        Body(f"block {k + 1}", parts[b.last - b.first], translation=np.array([b.first * width, 0.0, b.row * height]))
        for k, b in enumerate(blocks())
    ]
    length, tall = width * len(LAYOUT[0]), height * len(LAYOUT)
    thick, below = TABLE * tall, 1.4 * tall
    table = rigid_box("table", (length + below + tall / 2, 2 * tall, thick), ((length + below - tall / 2) / 2, depth / 2, -thick / 2), 1.0)
    rim = rigid_box("rim", (thick, 2 * tall, tall), (length + below - thick / 2, depth / 2, tall / 2), 1.0)

    def gravity(t: float) -> FloatArray:
        angle = np.deg2rad(tilt(p, t))
        return GRAVITY * np.array([np.sin(angle), 0.0, -np.cos(angle)])

    supports = [Support(name, DIRECTIONS[3]) for name in ("table", "rim")]
    return build_model([*blocks_that_are(p.blocks_are, placed), table, rim], supports=supports, gravity=gravity, beta=p.beta)


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
