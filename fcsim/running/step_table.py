"""The record of a run's steps: steps.csv while it runs, steps.h5 with units when it ends."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from fcsim.files import replacing, replacing_hdf5
from fcsim.running.case import Sensor
from fcsim.timestep.step import Step

PHASES = ("detection", "assembly", "solve", "output")


class StepTable:
    """steps.csv, one row a step, flushed at once; a resumed run drops the rows after its checkpoint."""

    def __init__(self, path: Path, sensors: Sequence[Sensor], start: int) -> None:
        self._sensors = sensors
        kept: list[list[str]] = []
        if start and path.is_file():
            with path.open(newline="", encoding="utf-8") as file:
                kept = [row for row in csv.reader(file) if row and row[0].isdigit() and int(row[0]) <= start]
        header = [*COLUMNS, *(f"seconds_{phase}" for phase in PHASES), *(sensor.column for sensor in sensors)]
        with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([header, *(row for row in kept if len(row) == len(header))])
        self._file = path.open("a", newline="", encoding="utf-8")
        self._writer = csv.writer(self._file)

    def write(self, step: Step, seconds: Mapping[str, float]) -> None:
        """Add the row of a step; seconds by phase."""
        values = [_text(measure(step)) for _, measure in COLUMNS.values()]
        phases = [f"{seconds.get(phase, 0.0):.5f}" for phase in PHASES]
        self._writer.writerow([*values, *phases, *(_text(sensor.measure(step)) for sensor in self._sensors)])
        self._file.flush()

    def close(self) -> None:
        self._file.close()


def write_hdf5(table: Path, path: Path, sensors: Sequence[Sensor]) -> None:
    """Write the rows of steps.csv as HDF5: one dataset (nsteps,) a column, with the attributes `unit` and, of sensors, `label`."""
    with table.open(newline="", encoding="utf-8") as file:
        header, *rows = list(csv.reader(file))
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


def _text(value: Any) -> str:
    return f"{value:.12g}" if isinstance(value, float | np.floating) else str(value)


COLUMNS: dict[str, tuple[str, Callable[[Step], Any]]] = {
    "step": ("", lambda step: step.number),
    "t": ("s", lambda step: step.state.t),
    "nc": ("", lambda step: len(step.contacts)),
    "active": ("", lambda step: int(np.count_nonzero(step.contact_status))),
    "sliding": ("", lambda step: int(np.count_nonzero(step.contact_status == 2))),
    "sticking": ("", lambda step: int(np.count_nonzero(step.contact_status == 1))),
    "status": ("", lambda step: step.result.status.name),
    "solver": ("", lambda step: step.result.method),
    "attempts": ("", lambda step: len(step.attempts)),
    "substeps": ("", lambda step: step.substeps),
    "iterations": ("", lambda step: step.iterations),
    "error": ("", lambda step: step.result.error),
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
    "normal_dissipation": ("J", lambda step: step.energy.normal_dissipation),
    "tangential_dissipation": ("J", lambda step: step.energy.tangential_dissipation),
    "friction_dissipation": ("J", lambda step: step.energy.friction_dissipation),
    "energy_residual": ("J", lambda step: step.energy.residual),
}
"""Columns of steps.csv before the phases' seconds and the case's sensors: unit and value; see `Step`, `Energy` and `Overlap` (nan at the
steps where it was not measured)."""
