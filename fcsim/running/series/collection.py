"""The ParaView collection (.pvd) of a run: one file that lists all files of all instants, those of an instant as named blocks.

A .pvd, and no VTKHDF file, which VTK could write too: every instant is a file of its own, written whole and then listed, so a run that is
killed leaves a series that opens; one that goes on replaces entries, where an HDF5 file would have to be cut in place. ParaView of any
version opens it, and meshio and VTK the files within. What it costs is that the mesh stands in the file of each instant.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from fcsim.errors import InputError
from fcsim.files import inside, replacing

SERIES = ("blocks", "contacts", "rigid", "links")
"""Names of the blocks of an instant; their place here is their number, so that a block keeps it where another one is missing."""
COLLECTION = "run.pvd"


class Entry(NamedTuple):
    """A file of an instant t [s], by its name relative to the collection; series: one of SERIES."""

    t: float
    file: str
    series: str


def read_collection(path: Path) -> list[Entry]:
    """Return the entries of a ParaView collection (.pvd), in its order; where they have no name, the collection's is that of the series."""
    try:
        entries = ElementTree.parse(path).getroot().findall("./Collection/DataSet")
        found = [Entry(float(e.attrib["timestep"]), e.attrib["file"], e.attrib.get("name", path.stem)) for e in entries]
        if not all(math.isfinite(entry.t) for entry in found):
            raise ValueError("a time that is no finite number")
        return found
    except (ElementTree.ParseError, KeyError, ValueError, LookupError) as error:
        raise InputError(f"{path}: expected a ParaView collection (.pvd) with a time and a file in each entry: {error}") from None


def write_collection(path: Path, entries: list[Entry]) -> None:
    """Write a ParaView collection (.pvd)."""
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
    collection = ElementTree.SubElement(root, "Collection")
    for t, file, series in entries:
        part = str(SERIES.index(series)) if series in SERIES else "0"
        ElementTree.SubElement(collection, "DataSet", timestep=repr(float(t)), group="", part=part, name=series, file=file)
    ElementTree.indent(root)
    with replacing(path) as temporary:
        ElementTree.ElementTree(root).write(temporary, encoding="utf-8", xml_declaration=True)


def entries_in(directory: Path) -> list[Entry]:
    """The entries of the series in `directory`, in the order of time; of a run of fcsim 0.2, those of its collection of each series."""
    found = [Path(directory / COLLECTION)]
    if not found[0].is_file():
        found = earlier_collections(directory)
    entries = [entry for path in found for entry in read_collection(path)]
    return sorted(entries, key=lambda entry: (entry.t, SERIES.index(entry.series) if entry.series in SERIES else len(SERIES)))


def earlier_collections(directory: Path) -> list[Path]:
    """Where fcsim 0.2 wrote a collection for each series."""
    return [path for series in SERIES if (path := directory / f"{series}.pvd").is_file()]


def files_of(directory: Path) -> list[tuple[Entry, Path]]:
    """The entries and their files, each there and within `directory`; InputError where one is not."""
    found = []
    for entry in entries_in(directory):
        file = inside(directory, directory / entry.file)
        if not file.is_file():
            raise InputError(f"{directory}: expected the file {entry.file} of t = {entry.t} s, as a .pvd of it says, found none")
        found.append((entry, file))
    return found
