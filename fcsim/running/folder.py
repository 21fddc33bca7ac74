"""What a run leaves in its folder, read back: description, table of steps, VTK series.

DIR/run.json   case, title, parameters, and which columns the plots take, see `description`
DIR/steps.csv  one row a step
DIR/vtk/       run.pvd, and blocks, contacts and rigid bodies of each instant as .vtu and .vtp files
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray
from fcsim.brief import brief
from fcsim.errors import InputError
from fcsim.running.description import FILE, Description, Plots, read_description
from fcsim.running.series.collection import files_of
from fcsim.tables import read_rows

DRAWN = ("blocks", "contacts", "rigid")


@dataclass(frozen=True)
class Instant:
    """The VTK files of one instant; None where a run has no such bodies."""

    t: float
    blocks: Path | None
    contacts: Path | None
    rigid: Path | None


@dataclass(frozen=True, eq=False)
class RunFolder:
    """A run folder, opened with `open_run`.

    description  run.json
    columns      name -> values of steps.csv, one a step: numbers where every entry is one, text otherwise
    instants     the VTK series in the order of time, () where the run wrote none
    """

    directory: Path
    description: Description
    columns: Mapping[str, NDArray]
    instants: tuple[Instant, ...]

    __repr__ = brief

    @property
    def title(self) -> str:
        return self.description.title or self.description.case or self.directory.name

    @property
    def plots(self) -> Plots:
        """Which columns of steps.csv are the imposed displacement, the reactions and the bound."""
        return self.description.plots

    def numbers(self, name: str) -> FloatArray | None:
        """The column `name` as numbers (nsteps,), or None where it is absent, empty or not made of numbers."""
        values = self.columns.get(name)
        return values if values is not None and values.size and values.dtype.kind == "f" else None

    def at(self, name: str, t: float) -> float | None:
        """The column `name` at the step nearest to the time t [s], or None where there is no such column."""
        values, times = self.numbers(name), self.numbers("t")
        return None if values is None or times is None else float(values[np.argmin(np.abs(times - t))])


def open_run(directory: str | Path) -> RunFolder:
    """Open the folder of a run; InputError where it is none, naming what was expected."""
    directory = Path(directory)
    for name in (FILE, "steps.csv"):
        if not (directory / name).is_file():
            raise InputError(
                f"{directory}: expected the folder of a run (run.json, steps.csv, vtk/, as `fcsim run` writes), found no {name}"
            )
    description = read_description(directory)
    return RunFolder(directory, description, read_columns(directory / "steps.csv"), instants_in(directory / "vtk"))


def read_columns(path: Path) -> dict[str, NDArray]:
    """The columns of steps.csv: float64 where all entries are numbers or empty (nan), else text."""
    header, *rows = read_rows(path) or [[]]
    if not header:
        raise InputError(f"{path}: expected a header with the names of the columns, got an empty file")
    if len(set(header)) != len(header):
        raise InputError(f"{path}: expected different names of the columns, got {', '.join(header)[:200]}")
    rows = [row for row in rows if len(row) == len(header)]  # the last row of a run that was killed may be cut
    return {name: _numbers_or_text([row[k] for row in rows]) for k, name in enumerate(header)}


def _numbers_or_text(entries: list[str]) -> NDArray:
    try:
        return np.array([float(entry) if entry else np.nan for entry in entries], dtype=np.float64)
    except ValueError:
        return np.array(entries, dtype=np.str_)


def instants_in(directory: Path) -> tuple[Instant, ...]:
    """The instants of the VTK series in `directory`, in the order of time; InputError where a file of theirs is missing."""
    files: dict[float, dict[str, Path | None]] = {}
    for entry, file in files_of(directory):
        if entry.series in DRAWN:
            files.setdefault(entry.t, dict.fromkeys(DRAWN))[entry.series] = file
    return tuple(Instant(t, **files[t]) for t in sorted(files))
