"""What a run leaves in its folder, read back: description, table of steps, VTK series.

DIR/run.json   case, title, parameters, and which columns the plots take, see `description`
DIR/steps.csv  one row a step
DIR/vtk/       blocks, contacts and rigid bodies: a .pvd collection of each, one .vtu or .vtp file an instant
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray
from fcsim.brief import brief
from fcsim.errors import InputError
from fcsim.files import inside, replacing
from fcsim.running.description import FILE, Description, Plots, read_description
from fcsim.tables import read_rows

SERIES = ("blocks", "contacts", "rigid")


def read_collection(path: Path) -> list[tuple[float, str]]:
    """Return the (time [s], file name) entries of a ParaView collection (.pvd), in its order."""
    try:
        entries = ElementTree.parse(path).getroot().findall("./Collection/DataSet")
        found = [(float(entry.attrib["timestep"]), entry.attrib["file"]) for entry in entries]
        if not all(math.isfinite(t) for t, _ in found):
            raise ValueError("a time that is no finite number")
        return found
    except (ElementTree.ParseError, KeyError, ValueError, LookupError) as error:
        raise InputError(f"{path}: expected a ParaView collection (.pvd) with a time and a file in each entry: {error}") from None


def write_collection(path: Path, entries: list[tuple[float, str]]) -> None:
    """Write a ParaView collection (.pvd) of (time [s], file name relative to the collection)."""
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
    collection = ElementTree.SubElement(root, "Collection")
    for t, file in entries:
        ElementTree.SubElement(collection, "DataSet", timestep=repr(float(t)), group="", part="0", file=file)
    ElementTree.indent(root)
    with replacing(path) as temporary:
        ElementTree.ElementTree(root).write(temporary, encoding="utf-8", xml_declaration=True)


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
    for series in SERIES:
        collection = directory / f"{series}.pvd"
        for t, name in read_collection(collection) if collection.is_file() else []:
            file = inside(directory, directory / name)
            if not file.is_file():
                raise InputError(f"{collection}: expected the file {name} of t = {t} s beside it, found none")
            files.setdefault(t, dict.fromkeys(SERIES))[series] = file
    return tuple(Instant(t, **files[t]) for t in sorted(files))
