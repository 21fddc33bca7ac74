"""The record of a run's steps: steps.csv while it runs, steps.h5 with units when it ends."""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from fcsim.errors import InputError
from fcsim.files import replacing, replacing_hdf5
from fcsim.interrupts import end_forks_of
from fcsim.running.case import Sensor
from fcsim.tables import read_rows
from fcsim.timestep.step import Step

PHASES = ("detection", "assembly", "solve", "output")


@dataclass(frozen=True)
class Row:
    """The texts of a step's row: of `COLUMNS`, and of the sensors."""

    values: list[str]
    measured: list[str]


class StepTable:
    """steps.csv, one row a step, in the file at once; a resumed run drops the rows after its checkpoint.

    Raises InputError where the rows to go on from are not those of `start` steps with these columns.
    """

    def __init__(self, path: Path, sensors: Sequence[Sensor], start: int) -> None:
        self._sensors, self._process = sensors, os.getpid()
        header = [*COLUMNS, *(f"seconds_{phase}" for phase in PHASES), *(sensor.column for sensor in sensors)]
        kept = _rows_up_to(path, start, header) if start else []
        with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([header, *kept])
        self._path, self._file = path, path.open("ab", buffering=0)

    def row(self, step: Step) -> Row:
        """What the row of a step says, but for the seconds."""
        values = [_text(measure(step)) for _, measure in COLUMNS.values()]
        measured = [_text(_number(sensor, step)) for sensor in self._sensors]
        end_forks_of(self._process)
        return Row(values, measured)

    def write(self, row: Row, seconds: Mapping[str, float]) -> None:
        """Add the row of a step, whole or not at all; seconds by phase."""
        phases = [f"{seconds.get(phase, 0.0):.5f}" for phase in PHASES]
        text = io.StringIO(newline="")
        csv.writer(text).writerow([*row.values, *phases, *row.measured])
        number, left = self._file.fileno(), text.getvalue().encode()
        before = os.fstat(number).st_size
        try:
            while left:
                left = left[os.write(number, left) :]
        except BaseException as error:  # an interrupt, too
            os.ftruncate(number, before)  # the step is not one that the run has done: half its row, or one that came later, would say so
            if isinstance(error, OSError):
                error.filename = str(self._path)
            raise

    def to_the_disk(self) -> None:
        """Return when the rows are on the disk: a checkpoint stands for all before it."""
        os.fsync(self._file.fileno())

    def close(self) -> None:
        self._file.close()


def _rows_up_to(path: Path, start: int, header: list[str]) -> list[list[str]]:
    """The rows of the steps 1 to `start`."""
    if not path.is_file():
        raise InputError(f"{path}: expected the rows of {start} steps to go on from, found no such file")
    found, *rows = read_rows(path) or [[]]
    if found != header:
        differing = sorted({*found} ^ {*header}) or ["the same in another order"]
        raise InputError(f"{path}: expected the columns of this case to go on with, it differs in {', '.join(differing)[:300]}")
    kept = [row for row in rows if len(row) == len(header) and row[0].isdecimal() and int(row[0]) <= start]
    if [int(row[0]) for row in kept] != list(range(1, start + 1)):
        raise InputError(f"{path}: expected one row for each of the {start} steps to go on from, found {len(kept)}")
    return kept


def write_hdf5(table: Path, path: Path, sensors: Sequence[Sensor]) -> None:
    """Write the rows of steps.csv as HDF5: one dataset (nsteps,) a column, with the attributes `unit` and, of sensors, `label`."""
    header, *rows = read_rows(table)
    rows = [row for row in rows if len(row) == len(header)]  # a full disk may cut the last one
    units = {name: unit for name, (unit, _) in COLUMNS.items()} | {f"seconds_{phase}": "s" for phase in PHASES}
    units |= {sensor.column: sensor.unit for sensor in sensors}
    labels = {sensor.column: sensor.label for sensor in sensors}
    with replacing_hdf5(path) as content:
        for k, name in enumerate(header):
            entries = [row[k] for row in rows]
            try:
                content[name] = np.array([float(entry) for entry in entries])
            except ValueError:
                content.create_dataset(name, data=entries, dtype=h5py.string_dtype())
            content[name].attrs["unit"] = units[name]
            if name in labels:
                content[name].attrs["label"] = labels[name]


def refuse_taken(case: str, sensors: Sequence[Sensor]) -> None:
    """Refuse sensors whose columns are those of every run."""
    taken = {*COLUMNS, *(f"seconds_{phase}" for phase in PHASES)}
    for sensor in sensors:
        if sensor.column in taken:
            raise InputError(f"case {case!r}, sensors: expected columns that no run has by itself, got {sensor.column!r}")


def _number(sensor: Sensor, step: Step) -> float | int:
    """What a sensor measures; a function that fails, or returns something else than a number, is the case's fault and said in one line."""
    try:
        value: object = sensor.measure(step)
    except (ArithmeticError, LookupError, TypeError, ValueError, AttributeError, NameError) as error:
        raise InputError(f"sensor {sensor.column!r}, step {step.number}: {type(error).__name__}: {error}") from error
    if isinstance(value, np.ndarray | np.generic) and np.ndim(value) == 0:
        value = value.item()
    if not isinstance(value, int | float):
        raise InputError(f"sensor {sensor.column!r}, step {step.number}: expected a number, got {type(value).__name__} {value!s:.60}")
    return value


def _text(value: object) -> str:
    return f"{value:.12g}" if isinstance(value, float | np.floating) else str(value)


COLUMNS: dict[str, tuple[str, Callable[[Step], object]]] = {
    "step": ("", lambda step: step.number),
    "t": ("s", lambda step: step.state.t),
    "nc": ("", lambda step: len(step.contacts)),
    "active": ("", lambda step: int(np.count_nonzero(step.contact_status))),
    "sliding": ("", lambda step: int(np.count_nonzero(step.contact_status == 2))),
    "sticking": ("", lambda step: int(np.count_nonzero(step.contact_status == 1))),
    "rolling": ("", lambda step: int(np.count_nonzero(step.rolling))),
    "spinning": ("", lambda step: int(np.count_nonzero(step.spinning))),
    "status": ("", lambda step: step.result.status.name),
    "solver": ("", lambda step: step.result.method),
    "attempts": ("", lambda step: len(step.attempts)),
    "substeps": ("", lambda step: step.substeps),
    "iterations": ("", lambda step: step.iterations),
    "error": ("", lambda step: step.result.error),
    "linearised": ("", lambda step: len(step.linearised)),
    "inner_residual": ("", lambda step: step.linearised[-1].residual if step.linearised else 0.0),
    "penetration": ("m", lambda step: step.penetration),
    "overlap": ("m", lambda step: math.nan if step.overlap is None else step.overlap.depth),
    "overlap_between": ("", lambda step: "" if step.overlap is None else step.overlap.between),
    "momentum_residual": ("", lambda step: step.result.checks.momentum),
    "kinetic_energy": ("J", lambda step: step.energy.kinetic),
    "elastic_energy": ("J", lambda step: step.energy.elastic),
    "load_work": ("J", lambda step: step.energy.load_work),
    "support_work": ("J", lambda step: step.energy.support_work),
    "damping_dissipation": ("J", lambda step: step.energy.damping_dissipation),
    "numerical_dissipation": ("J", lambda step: step.energy.numerical_dissipation),
    "material_dissipation": ("J", lambda step: step.energy.material_dissipation),
    "normal_dissipation": ("J", lambda step: step.energy.normal_dissipation),
    "tangential_dissipation": ("J", lambda step: step.energy.tangential_dissipation),
    "friction_dissipation": ("J", lambda step: step.energy.friction_dissipation),
    "fracture_dissipation": ("J", lambda step: step.energy.fracture_dissipation),
    "link_work": ("J", lambda step: step.energy.link_work),
    "link_energy": ("J", lambda step: step.energy.links),
    "contact_energy": ("J", lambda step: step.energy.contact),
    "contact_gain": ("J", lambda step: step.energy.contact_gain),
    "energy_created": ("J", lambda step: step.ledger.created),
    "energy_residual": ("J", lambda step: step.energy.residual),
}
"""Columns of steps.csv before the phases' seconds and the case's sensors: unit and value; see `Step`, `Energy` and `Overlap` (nan
at the steps where it was not measured)."""
