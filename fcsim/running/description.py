"""run.json: what a run says of itself. One schema, written by the run and read by all that come after."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from fcsim.errors import InputError
from fcsim.files import plain_name
from fcsim.records import from_json, json_text, read_json, read_record, write_record

FILE = "run.json"
FORMAT = "fcsim run"
"""Marks a folder as a run's, whose files may be replaced when the user says so."""
SPARE = 2000
"""[bytes] Kept free at the end of run.json, so that a run can say how it ended on a disk that is full."""


@dataclass(frozen=True)
class Column:
    """A column of steps.csv as plots show it."""

    column: str
    label: str = ""
    unit: str = ""


@dataclass(frozen=True)
class Bound:
    """A value that a reaction is compared with."""

    value: float
    label: str = "bound"


@dataclass(frozen=True)
class HistoryPlot:
    """Curves over time or another column, drawn as plots/NAME.png."""

    name: str
    against: Column
    curves: tuple[Column, ...]

    def __post_init__(self) -> None:
        plain_name(self.name, "history")


@dataclass(frozen=True)
class Plots:
    """Which columns the plots take."""

    imposed: Column | None = None
    reaction: tuple[Column, ...] = ()
    bound: Bound | None = None
    histories: tuple[HistoryPlot, ...] = ()


@dataclass(frozen=True)
class SeenOverlap:
    """Depth [m], also as a share of a body's smallest extent, and between which bodies and where; see `fcsim.witness`."""

    depth: float = 0.0
    share: float = 0.0
    between: str = ""


@dataclass(frozen=True)
class RankWork:
    """What a rank of MPI sent in a run, or in its last part: exchanges in which it took part, messages, bytes (see `fcsim.ranks.World`)."""

    exchanges: int = 0
    messages: int = 0
    bytes: int = 0


@dataclass(frozen=True, kw_only=True)
class Description:
    """The content of run.json.

    parameters   the case's, all of them; assignments: those given, as texts
    bodies       their names, in the order of the numbers that VTK files have for them
    origin       SHA-256 of what the run began with, which its checkpoints repeat; see `begun`
    sources      SHA-256 of the script, and of the meshes and tables that it read, by their paths; model: of the mesh as it was built
    threads      on which it was computed, which changes no result
    status       running, finished, not converged, interrupted or failed; message: why; steps_done: up to where the files go
    ranks        what each rank sent, where several shared the run that finished
    overlap      the largest that the witness saw; notes: what is to be known of the results
    """

    format: str = ""
    case: str = ""
    title: str = ""
    description: str = ""
    parameters: Mapping[str, object] = field(default_factory=dict)
    assignments: Mapping[str, str] = field(default_factory=dict)
    scheme: str = ""
    notes: tuple[str, ...] = ()
    h: float | None = None
    steps: int | None = None
    solver: str = ""
    tol: float | None = None
    fclib_set: str = ""
    bodies: tuple[str, ...] = ()
    options: Mapping[str, object] = field(default_factory=dict)
    plots: Plots = field(default_factory=Plots)
    versions: Mapping[str, str] = field(default_factory=dict)
    threads: int | None = None
    sources: Mapping[str, str] = field(default_factory=dict)
    model: str = ""
    origin: str = ""
    status: str = ""
    message: str = ""
    steps_done: int | None = None
    overlap: SeenOverlap = field(default_factory=SeenOverlap)
    ranks: tuple[RankWork, ...] = ()

    def begun(self) -> Description:
        """As it is where the run begins: with its origin, that of its case, parameters (but the number of steps), sources and versions."""
        parameters = {name: value for name, value in self.parameters.items() if name != "steps"}
        began = (self.case, parameters, self.scheme, self.solver, self.tol, self.versions, self.sources, self.model)
        return replace(self, origin=hashlib.sha256(json_text(began).encode()).hexdigest())

    @property
    def is_a_runs(self) -> bool:
        """Whether fcsim wrote it: by its mark, or by what versions before the mark wrote."""
        return self.format == FORMAT or bool(self.case and self.scheme and "fcsim" in self.versions)


def read_description(directory: Path) -> Description:
    """Read directory/run.json; InputError where it is not there or not as expected."""
    path = directory / FILE
    if not path.is_file():
        raise InputError(f"{directory}: expected the folder of a run, found no {FILE}")
    return read_record(Description, path)


def is_a_run(directory: Path) -> bool:
    """Whether a folder's run.json says that fcsim wrote it; False for any other file of this name."""
    try:
        content = read_json(directory / FILE)
        wanted = {"format", "case", "scheme", "versions"}
        given = {key: content[key] for key in wanted if key in content} if isinstance(content, dict) else {}
        return isinstance(given.get("versions", {}), dict) and from_json(Description, given, FILE).is_a_runs
    except (InputError, OSError):
        return False


def write_description(directory: Path, description: Description) -> None:
    """Write directory/run.json, with room for the end of the run."""
    if description.status != "running":
        write_record(directory / FILE, description)
        return
    path = directory / FILE
    write_record(path, description)
    try:
        with path.open("a", encoding="utf-8") as file:
            file.write(" " * SPARE + "\n")
    except OSError as error:  # a full disk does not say which file it was
        error.filename = error.filename or str(path)
        raise


def write_end(directory: Path, description: Description) -> None:
    """Write directory/run.json at the end of a run. Where no new file fits on the disk, the old one's room is used."""
    try:
        write_record(directory / FILE, description)
    except OSError:
        path = directory / FILE
        room = path.stat().st_size
        short = replace(description, message=description.message[: SPARE // 4])
        content = json_text(short).encode()
        if len(content) > room:
            raise
        with path.open("r+b") as file:
            file.write(content.ljust(room - 1) + b"\n")
            file.flush()
            os.fsync(file.fileno())
