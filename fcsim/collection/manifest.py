"""manifest.csv of a collection: one row a file."""

from __future__ import annotations

import csv
import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from fcsim.errors import InputError
from fcsim.files import replacing

MANIFEST = "manifest.csv"

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

    @property
    def place(self) -> str:
        """Path in the collection's folder."""
        return f"{self.form}/{self.name}"


COLUMNS = tuple(field.name for field in fields(Entry))
_KINDS = {field.name: str(field.type) for field in fields(Entry)}
_READ: dict[str, Any] = {"int": int, "float": float, "str": str, "bool": lambda text: {"true": True, "false": False}[text.lower()]}


def _text(value: Any) -> str:
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else repr(float(value)) if isinstance(value, float) else str(value)


def write_manifest(directory: Path, entries: Iterable[Entry]) -> Path:
    """Write directory/manifest.csv, whole or not at all."""
    path = Path(directory) / MANIFEST
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows([_text(getattr(entry, name)) for name in COLUMNS] for entry in entries)
    return path


def read_manifest(directory: str | Path) -> list[Entry]:
    """Read the manifest of a collection's folder; InputError with file, line and column where it cannot be."""
    path = Path(directory) / MANIFEST
    if not path.is_file():
        raise InputError(f"{directory}: expected the folder of a collection, found no {MANIFEST} in it")
    try:
        rows = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: expected a table as UTF-8 text ({error})") from None
    if not rows or tuple(rows[0]) != COLUMNS:
        raise InputError(f"{path}: expected the columns {','.join(COLUMNS)}; got {','.join(rows[0])[:300] if rows else 'nothing'}")
    return [_entry(row, f"{path}, line {number}") for number, row in enumerate(rows[1:], 2)]


def _entry(row: list[str], where: str) -> Entry:
    if len(row) != len(COLUMNS):
        raise InputError(f"{where}: expected {len(COLUMNS)} columns, got {len(row)}")
    values: dict[str, Any] = {}
    for name, text in zip(COLUMNS, row, strict=True):
        kind, _, optional = _KINDS[name].partition(" | ")
        try:
            values[name] = None if optional and not text else _READ[kind](text)
        except (KeyError, ValueError):
            raise InputError(f"{where}, column {name}: expected a value of type {kind}, got {text!r}") from None
    return Entry(**values)


def sha256(path: Path) -> str:
    """SHA-256 of a file's bytes, as `sha256sum` prints it."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
