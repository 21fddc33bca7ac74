"""manifest.csv of a collection: one row a file."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from fcsim.errors import InputError
from fcsim.tables import read_table, write_table

MANIFEST = "manifest.csv"
LONGEST_NAME = 255
"""[bytes] Of a file on the usual file systems."""

AT_REST = "AT_REST"
"""Status of a step whose q is round-off and whose answer is r = 0: a relative error says nothing there."""


@dataclass(frozen=True, kw_only=True)
class Entry:
    """A file of a collection; its place is <form>/<name>. None stands for what is not known (an empty cell)."""

    name: str
    form: str
    """global or local."""
    step: int | None
    time: float | None
    """[s] At the end of the step."""
    nc: int
    n: int | None
    """Degrees of freedom; those of the global problem for its local form, None where that is not known."""
    m: int
    """Contact unknowns."""
    density: float | None
    """m / n."""
    symmetric: bool | None
    """Of W, as rank and condition."""
    rank: int | None
    condition: float | None
    """Largest over smallest nonzero singular value."""
    solver: str
    iterations: int
    """Of `solver`: built collections, in the run, from the previous steps' reactions; selections, from r = 0."""
    error: float | None
    """Of the stored solution, by a judge that shares no code with the solvers; None without a solution."""
    sha256: str
    status: str
    """How `solver` ended."""
    tol: float
    """[1] That `solver` was asked for."""
    fill: float | None
    """Nonzero entries of W / m^2."""
    dimension: int
    source: str
    """The file that this one is a copy of; empty in a built collection."""

    parameters: str = ""
    """Of the case that the problem came of, as JSON: mu, E, ...; empty where they are not known."""

    def __post_init__(self) -> None:
        if self.form not in ("global", "local"):
            raise InputError(f"form: expected global or local, got {self.form!r}")
        if self.name in ("", ".", "..") or any(c in self.name for c in "/\\\0") or len(os.fsencode(self.name)) > LONGEST_NAME:
            raise InputError(f"name: expected the name of a file, got {self.name[:120]!r}")

    @property
    def place(self) -> str:
        """Path in the collection's folder."""
        return f"{self.form}/{self.name}"


def write_manifest(directory: Path, entries: Iterable[Entry]) -> Path:
    """Write directory/manifest.csv, whole or not at all."""
    return write_table(Path(directory) / MANIFEST, Entry, entries)


def read_manifest(directory: str | Path) -> list[Entry]:
    """Read the manifest of a collection's folder; InputError with file, line and column where it cannot be."""
    path = Path(directory) / MANIFEST
    if not path.is_file():
        raise InputError(f"{directory}: expected the folder of a collection, found no {MANIFEST} in it")
    return read_table(path, Entry)


def read_manifests_below(directory: Path) -> dict[str, Entry]:
    """What the manifests in a folder and its folders say of the files, by their paths from `directory`."""
    known: dict[str, Entry] = {}
    for path in sorted(directory.rglob(MANIFEST)):
        known |= {(path.parent / entry.place).relative_to(directory).as_posix(): entry for entry in read_manifest(path.parent)}
    return known
