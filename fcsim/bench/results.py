"""The table that a bench writes and profiles are drawn from: results.csv, one row a measurement.

Rows are appended whole and never changed. A process that is killed while it writes leaves at most one line without its end, which is
dropped by readers and overwritten by the next row. A measurement that was made again (with looser limits) follows the earlier one and
takes its place when the file is read.
"""

from __future__ import annotations

import csv
import os
from dataclasses import dataclass
from pathlib import Path

from fcsim.errors import InputError
from fcsim.tables import cells, columns, line, read_table, write_table

FILE = "results.csv"
SLACK = 1.01
"""An error up to tol * SLACK meets tol: the judge factors M by another library than the solver, and their u differ by round-off."""

OWN_STATUSES = ("SOLVED", "MAX_ITERATIONS", "STAGNATED", "SINGULAR", "DIVERGED", "TIME_LIMIT", "INFEASIBLE", "EXHAUSTED")
"""What a solver says of itself."""
STATUSES = (*OWN_STATUSES, "KILLED_TIME", "KILLED_MEMORY", "CRASHED", "WRONG")
"""KILLED_*: ended from outside at a hard limit; WRONG: said to be solved, but the error recomputed outside the solver is above tol."""


NOT_TRIED = "not tried"
"""Stands in the status of what was recorded as TIME_LIMIT because a looser tolerance was not met in time."""


@dataclass(frozen=True)
class Measurement:
    """One solve of a problem by a solver to a tolerance. What is None was not measured, or could not be."""

    problem: str
    """Stem of the FCLIB file."""
    form: str
    """global or local."""
    dimension: int
    nc: int
    n: int
    """Degrees of freedom of a global problem, contact unknowns of a local one."""
    program: str
    """fcsim or siconos."""
    solver: str
    tol: float
    time_limit: float
    """[s]"""
    memory_limit: float | None
    """[MiB]"""
    status: str
    """One of STATUSES, which a text may follow after ": "."""
    solved: bool
    """The independently computed error is at most SLACK * tol."""
    seconds: float | None
    """[s] Wall time of the whole solve, with a global problem's reduction; None where it was killed or not tried."""
    cpu_seconds: float | None
    iterations: int | None
    error: float | None
    """Computed outside the solver; inf where the answer is not finite."""
    flops: float | None
    machine: str
    threads: int
    version: str
    """Of the program."""
    started: str
    """Time of day in ISO 8601, UTC."""
    plugin: str = ""
    """SHA-256 of the plugin that the solver came with; empty for fcsim's own and Siconos'."""

    @property
    def outcome(self) -> str:
        """The status without its text."""
        return self.status.partition(":")[0]

    @property
    def key(self) -> tuple[str, str, str, float]:
        """What is measured once: problem, form, solver, tolerance."""
        return self.problem, self.form, self.solver, self.tol


FIELDS = tuple(columns(Measurement))


def results_file(path: Path) -> Path:
    """The table itself: `path`, or results.csv in the folder `path`."""
    return path / FILE if path.is_dir() else path


def read_results(path: Path) -> list[Measurement]:
    """Read a results table, or that of a results folder; of measurements made again the last is kept, where the first stood.

    A last line without its end is dropped. Raises InputError that names file, line and column.
    """
    file = results_file(Path(path))
    if not file.is_file():
        raise InputError(f"{path}: expected a table of fcsim bench, or the folder that holds {FILE}; there is none")
    try:
        text = file.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{file}: expected a table as UTF-8 text ({error})") from None
    rows = list(csv.reader(text[: text.rfind("\n") + 1].splitlines()))
    if not rows:  # nothing was written, or the header not to its end
        return []
    kept: dict[tuple[str, str, str, float], Measurement] = {}
    for number, measurement in enumerate(read_table(file, Measurement, rows), 2):
        if measurement.outcome not in STATUSES:
            expected = f"expected one of {', '.join(STATUSES)}, got {measurement.status!r}"
            raise InputError(f"{file}, line {number}, column status: {expected}")
        kept[measurement.key] = measurement
    return list(kept.values())


def take_over(path: Path) -> None:
    """Bring a table of an earlier version, which lacks columns at the right, to the present ones."""
    file = results_file(path)
    if not file.is_file():
        return
    with file.open(encoding="utf-8", errors="replace") as text:
        header = tuple(text.readline().strip().split(","))
    if header != FIELDS and header == FIELDS[: len(header)]:
        write_table(file, Measurement, read_results(file))


def append(path: Path, measurement: Measurement) -> None:
    """Append a row to a table (or that of a folder), made with its header where it is new; returns when it is on the disk."""
    with results_file(path).open("a+b") as file:  # every write goes to the end
        whole = file.seek(0, os.SEEK_END)
        if whole and (file.seek(-1, os.SEEK_END), file.read(1))[1] != b"\n":  # a torn line
            file.seek(0)
            whole = file.read().rfind(b"\n") + 1
            file.truncate(whole)
        header = line(FIELDS) if whole == 0 else ""
        file.write((header + line(cells(measurement))).encode())
        file.flush()
        os.fsync(file.fileno())
