"""Functions of time for supports, loads and gravity: ramps, tables from CSV files, acceleration records."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from fcsim.arrays import FloatArray, is_number, numbers_of
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.files import note_read, path_of, regular

UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6},
    "velocity": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
    "acceleration": {"m/s^2": 1.0, "cm/s^2": 1e-2, "Gal": 1e-2, "g": 9.80665},
    "force": {"N": 1.0, "kN": 1e3, "MN": 1e6},
    "moment": {"N m": 1.0, "kN m": 1e3},
    "pressure": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9},
    "factor": {"": 1.0, "1": 1.0, "%": 1e-2},
}
"""Units of a table's columns by quantity, in SI units."""


@dataclass(frozen=True)
class Ramp:
    """`start` until t0 [s], `end` from t1 > t0 on, linear in between."""

    t0: float
    t1: float
    start: float = 0.0
    end: float = 1.0

    def __post_init__(self) -> None:
        if not (all(map(is_number, (self.t0, self.t1, self.start, self.end))) and self.t0 < self.t1):
            raise InputError(f"Ramp: expected finite numbers with t0 < t1, got {self}")

    def __call__(self, t: float) -> float:
        return float(np.interp(t, [self.t0, self.t1], [self.start, self.end]))


@dataclass(frozen=True)
class Steady:
    """The acceleration (d,) [m/s^2], the same at all times."""

    acceleration: tuple[float, ...]

    def __call__(self, t: float) -> tuple[float, ...]:
        return self.acceleration


def gravity_of(given: object) -> Callable[[float], ArrayLike] | None:
    """A model's gravity as a function of the time; of an acceleration, one that is steady. InputError where it is neither."""
    if given is None or callable(given):
        return given
    acceleration = numbers_of(given)
    if acceleration.ndim != 1 or not acceleration.size or not np.all(np.isfinite(acceleration)):
        raise InputError(
            "gravity: expected an acceleration, as (0.0, 0.0, -9.81) [m/s^2], or a function of the time, as lambda t: (0.0, 0.0, -9.81), "
            f"got {shown(given)}"
        )
    return Steady(tuple(acceleration.tolist()))


@dataclass(frozen=True)
class GravityRamp:
    """The acceleration (d,) [m/s^2], applied gradually: none until t0 [s], whole from t1 > t0 on."""

    acceleration: tuple[float, ...]
    t0: float
    t1: float

    def __post_init__(self) -> None:
        acceleration = numbers_of(self.acceleration)
        finite = acceleration.ndim == 1 and acceleration.size > 0 and np.all(np.isfinite(acceleration))
        if not (finite and is_number(self.t0) and is_number(self.t1) and self.t0 < self.t1):
            raise InputError(f"GravityRamp: expected finite numbers with t0 < t1, got {self}")

    def __call__(self, t: float) -> FloatArray:
        return np.asarray(self.acceleration) * float(np.interp(t, [self.t0, self.t1], [0.0, 1.0]))


@dataclass(frozen=True, eq=False)
class Table:
    """Values (n,) at increasing times (n,) [s], n >= 2, linear in between; the first and the last hold outside."""

    times: FloatArray
    values: FloatArray

    def __post_init__(self) -> None:
        for name in ("times", "values"):
            object.__setattr__(self, name, _vector(getattr(self, name), f"{type(self).__name__}, {name}"))
        if len(self.times) < 2 or len(self.times) != len(self.values):
            raise InputError(
                f"{type(self).__name__}: expected two times or more and as many values, got {len(self.times)} and {len(self.values)}"
            )
        if np.any(np.diff(self.times) <= 0):
            row = int(np.argmax(np.diff(self.times) <= 0))
            raise InputError(
                f"{type(self).__name__}: expected increasing times, got {self.times[row]:g} s and then {self.times[row + 1]:g} s (rows "
                f"{row + 1} and {row + 2})"
            )

    def __call__(self, t: float) -> float:
        return float(np.interp(t, self.times, self.values))


class AccelerationRecord(Table):
    """Accelerations [m/s^2] at increasing times [s], linear in between, none outside; its velocity and displacement are exact integrals.

    `velocity` is what a support of the base takes: it is zero before the record and keeps its last value after it.
    """

    def __call__(self, t: float) -> float:
        return float(np.interp(t, self.times, self.values, left=0.0, right=0.0))

    @cached_property
    def _velocity(self) -> FloatArray:
        """Velocities at the times."""
        h = np.diff(self.times)
        return np.concatenate([[0.0], np.cumsum(0.5 * h * (self.values[1:] + self.values[:-1]))])

    @cached_property
    def _displacement(self) -> FloatArray:
        h, a = np.diff(self.times), self.values
        return np.concatenate([[0.0], np.cumsum(h * self._velocity[:-1] + h**2 * (2 * a[:-1] + a[1:]) / 6)])

    def _place(self, t: float) -> tuple[int, float, float]:
        """Interval of t, time since its beginning, slope of the acceleration in it."""
        k = int(np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.times) - 2))
        slope = (self.values[k + 1] - self.values[k]) / (self.times[k + 1] - self.times[k])
        return k, float(np.clip(t, self.times[0], self.times[-1]) - self.times[k]), float(slope)

    def velocity(self, t: float) -> float:
        """Velocity [m/s], from rest."""
        k, s, slope = self._place(t)
        return float(self._velocity[k] + s * (self.values[k] + 0.5 * slope * s))

    def displacement(self, t: float) -> float:
        """Displacement [m], from rest."""
        k, s, slope = self._place(t)
        within = self._displacement[k] + s * (self._velocity[k] + s * (0.5 * self.values[k] + slope * s / 6))
        return float(within + max(t - self.times[-1], 0.0) * self._velocity[-1])

    def scaled(self, factor: float) -> AccelerationRecord:
        return replace(self, values=factor * self.values)

    def delayed(self, by: float) -> AccelerationRecord:
        """The same record, `by` [s] later."""
        return replace(self, times=self.times + by)


def read_table(path: str | Path, column: str, quantity: str = "factor", time: str = "t") -> Table:
    """Return the table of a CSV file: a header `t [s], name [unit], ...`, then numbers; lines that begin with # are comments.

    quantity: what the column is, a key of `UNITS`, by which its unit is read; factors need no unit. Raises InputError that names the file
    and the line for a file that cannot be read, without such columns or with another unit, with anything but finite numbers, rows of
    another length, or times that do not increase.
    """
    return _read(path_of("path", "a CSV file", path), column, quantity, time, Table)


def read_acceleration_record(path: str | Path, column: str = "a", time: str = "t") -> AccelerationRecord:
    """Return the acceleration record of a CSV file as `read_table` reads it, its column in m/s^2, cm/s^2, Gal or g."""
    return _read(path_of("path", "a CSV file", path), column, "acceleration", time, AccelerationRecord)


def _read[T: Table](path: Path, column: str, quantity: str, time: str, kind: type[T]) -> T:
    if quantity not in UNITS:
        raise InputError(f"quantity: expected one of {', '.join(UNITS)}, got {quantity!r}")
    try:
        text = regular(path).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: expected a CSV file of times and values, got: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: expected a CSV file of times and values as UTF-8 text: {error}") from None
    note_read(path)
    lines = enumerate(text.splitlines(), start=1)
    rows = [(number, _cells(path, number, line)) for number, line in lines if line.strip() and not line.lstrip().startswith("#")]
    if not rows:
        raise InputError(f"{path}: expected a header 't [s], {column} [unit]' and rows of numbers, found none")
    header = dict(_heading(entry) for entry in rows[0][1])
    columns = [name for name, _ in map(_heading, rows[0][1])]
    if len(header) < len(columns):
        raise InputError(f"{path}: expected each column once in the header, found {', '.join(columns)}")
    for name in (time, column):
        if name not in header:
            found = ", ".join(columns) if len(columns) > 1 else f"{rows[0][1][0].strip()!r} alone; commas separate entries"
            raise InputError(f"{path}: expected a column {name!r} in the header, found {found}")
    scale = {}
    for name, what in ((time, "time"), (column, quantity)):
        if header[name] not in UNITS[what]:
            known = ", ".join(unit for unit in UNITS[what] if unit)
            raise InputError(f"{path}: expected the column {name!r} as {name} [unit] with a unit among {known}, found {header[name]!r}")
        scale[name] = UNITS[what][header[name]]
    values: dict[str, list[float]] = {time: [], column: []}
    for number, row in rows[1:]:
        if len(row) != len(columns):
            raise InputError(f"{path}, line {number}: expected {len(columns)} entries as in the header, found {len(row)}")
        for name, collected in values.items():
            entry = row[columns.index(name)].strip()
            try:
                collected.append(float(entry))
            except ValueError:
                raise InputError(f"{path}, line {number}: expected a number in column {name!r}, found {entry!r}") from None
            if not np.isfinite(collected[-1]):
                raise InputError(f"{path}, line {number}: expected a finite number in column {name!r}, found {entry!r}")
    try:
        return kind(scale[time] * np.array(values[time]), scale[column] * np.array(values[column]))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _cells(path: Path, number: int, line: str) -> list[str]:
    """The entries of one line: a quotation mark that is not closed would swallow those that follow."""
    try:
        return next(csv.reader([line], strict=True))
    except csv.Error as error:
        raise InputError(f"{path}, line {number}: expected entries separated by commas ({error})") from None


def _heading(entry: str) -> tuple[str, str]:
    """Split `name [unit]`."""
    name, _, unit = entry.partition("[")
    return name.strip(), unit.strip().removesuffix("]").strip()


def _vector(values: ArrayLike | Sequence[float], what: str) -> FloatArray:
    vector = numbers_of(values)
    if vector.ndim != 1 or not np.all(np.isfinite(vector)):
        raise InputError(f"{what}: expected a vector of finite numbers, got {shown(values)}")
    vector.setflags(write=False)
    return vector
