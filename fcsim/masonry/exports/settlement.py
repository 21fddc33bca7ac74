"""A settlement as rows, JSON and files: settle.json, settle.csv."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from fcsim.masonry.histories.settle import Movement, Settlement
from fcsim.masonry.openings import OPEN
from fcsim.masonry.problem import MasonryProblem
from fcsim.masonry.report import write_csv
from fcsim.records import write_record
from fcsim.version import __version__

_NO_SHARE = 1e-3  # of the support's way: joints that are open by less need not be said to be
_NO_FORCE = 1e-7  # of the largest force


def columns_of(problem: MasonryProblem, seen: Settlement) -> tuple[str, ...]:
    """The columns of its table."""
    axes = "xz" if problem.dimension == 2 else "xyz"
    forces = [f"{name} {axis} [kN]" for name in seen.forces for axis in axes]
    return ("moved [mm]", *forces, "widest joint [mm]", "slip [mm]", "open joints")


def rows_of(problem: MasonryProblem, seen: Settlement, digits: int) -> list[tuple[str, ...]]:
    """A row a step, the first before the support moves; round-off of the solver is 0."""
    largest = max((float(np.abs(of).max()) for of in seen.forces.values()), default=0.0)
    no_length, no_force = min(OPEN * problem.size, _NO_SHARE * seen.moved[-1]), _NO_FORCE * largest

    def said(value: float, unit: float, noise: float) -> str:
        return f"{0.0 if abs(value) <= noise else value / unit:.{digits}g}"

    rows = []
    for k in range(len(seen.moved)):
        forces = [said(value, 1e3, no_force) for of in seen.forces.values() for value in of[k]]
        lengths = [said(value, 1e-3, no_length) for value in (seen.opening[k], seen.slip[k])]
        rows.append((f"{1e3 * seen.moved[k]:.{digits}g}", *forces, *lengths, str(int(seen.open_joints[k]))))
    return rows


def settlement_summary(problem: MasonryProblem, movements: Sequence[Movement], seen: Settlement) -> Mapping[str, object]:
    """A settlement in JSON's types."""
    return {
        "name": problem.name,
        "version": __version__,
        "movements": movements,
        "falls": seen.falls,
        "turned": seen.turned,
        "moved": seen.moved,
        "forces": seen.forces,
        "opening": seen.opening,
        "slip": seen.slip,
        "open_joints": seen.open_joints,
        "joints": seen.joints,
    }


def write_settlement(directory: Path, problem: MasonryProblem, movements: Sequence[Movement], seen: Settlement) -> None:
    """Write the way into a folder: settle.json, settle.csv."""
    directory.mkdir(parents=True, exist_ok=True)
    write_record(directory / "settle.json", settlement_summary(problem, movements, seen))
    write_csv(directory / "settle.csv", columns_of(problem, seen), rows_of(problem, seen, digits=9))
