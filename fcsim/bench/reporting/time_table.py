"""From measurements to one table of times for one tolerance: problems by solvers."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray
from fcsim.bench.results import Measurement
from fcsim.errors import InputError

CLOCKS = {"wall": ("seconds", "wall clock"), "cpu": ("cpu_seconds", "processor time")}
"""Clocks to compare by: the column of the results, the name."""


@dataclass(frozen=True, eq=False)
class TimeTable:
    """Times of the problems that were measured with every solver at one tolerance.

    times   (problems, solvers) [s], infinity where unsolved
    rows    the measurements behind it, rows[p][s]
    left_out names of problems that some solver was not measured on: they are in no count
    """

    tol: float
    clock: str
    problems: tuple[str, ...]
    solvers: tuple[str, ...]
    times: FloatArray
    rows: tuple[tuple[Measurement, ...], ...]
    left_out: tuple[str, ...]

    @property
    def contacts(self) -> NDArray[np.int64]:
        """Number of contacts of each problem."""
        return np.array([row[0].nc for row in self.rows], dtype=np.int64)

    @property
    def limits(self) -> FloatArray:
        """(problems, solvers) The time limit [s] of each measurement."""
        return np.array([[m.time_limit for m in row] for row in self.rows], dtype=float).reshape(self.times.shape)

    def outcomes(self, solver: str) -> Counter[str]:
        """How often each status (without its text) came up with a solver; "SOLVED" counts the solved ones only."""
        column = self.solvers.index(solver)
        return Counter("SOLVED" if row[column].solved else row[column].outcome for row in self.rows)


def tolerance_name(tol: float) -> str:
    """1e-4, 2.5e-3: short, and fit for a file name."""
    mantissa, _, exponent = f"{tol:.6e}".partition("e")
    return f"{mantissa.rstrip('0').rstrip('.')}e{int(exponent)}"


def tolerances(measurements: Sequence[Measurement], wanted: Sequence[float] | None = None) -> list[float]:
    """The tolerances of a results table, loosest first, or the wanted ones of them; InputError for one that is not there."""
    if not measurements:
        raise InputError("results: expected at least one measurement, the table is empty")
    known = sorted({m.tol for m in measurements}, reverse=True)
    if wanted is None:
        return known
    chosen = []
    for tol in wanted:
        found = [k for k in known if math.isclose(k, tol, rel_tol=1e-9)]
        if not found:
            raise InputError(f"--tols {tol:g}: expected tolerances among {', '.join(map(tolerance_name, known))}")
        chosen += [k for k in found if k not in chosen]
    return chosen


def solver_names(measurements: Sequence[Measurement], wanted: Sequence[str] | None = None) -> list[str]:
    """The solvers of a results table in the order of their first row, or the wanted ones; InputError for one that is not there."""
    known = list(dict.fromkeys(m.solver for m in measurements))
    if wanted is None:
        return known
    for name in wanted:
        if name not in known:
            raise InputError(f"--solvers {name}: expected solvers among {', '.join(known)}")
    return list(dict.fromkeys(wanted))


def time_table(measurements: Sequence[Measurement], tol: float, solvers: Sequence[str] | None = None, clock: str = "wall") -> TimeTable:
    """Return the table of times at one tolerance.

    A problem is a file: the global and the local form of one are two. A problem without a measurement of one of the solvers is left
    out, since what was not tried is not unsolved. Raises InputError where nothing is left, and where a solved row has no time by the clock.
    """
    if clock not in CLOCKS:
        raise InputError(f"--clock {clock}: expected one of {', '.join(CLOCKS)}")
    column = CLOCKS[clock][0]
    names = solver_names(measurements, solvers)
    measured: dict[tuple[str, str], dict[str, Measurement]] = {}
    for m in measurements:
        if m.tol == tol and m.solver in names:
            measured.setdefault((m.problem, m.form), {})[m.solver] = m
    whole = {key: of for key, of in measured.items() if len(of) == len(names)}
    if not whole:
        counts = ", ".join(f"{name} {sum(name in of for of in measured.values())}" for name in names)
        raise InputError(
            f"tolerance {tolerance_name(tol)}: no problem was measured with every solver (problems measured: {counts}); choose by --solvers"
        )
    several = len({form for _, form in measured}) > 1
    called = {key: f"{key[0]} ({key[1]})" if several else key[0] for key in measured}
    rows = tuple(tuple(of[name] for name in names) for of in whole.values())
    times = np.array([[time_of(m, column) for m in row] for row in rows])
    left_out = tuple(called[key] for key in measured if key not in whole)
    return TimeTable(tol, clock, tuple(called[key] for key in whole), tuple(names), times, rows, left_out)


def time_of(measurement: Measurement, column: str) -> float:
    """[s] By the clock of that column, infinity where unsolved. InputError where a solved row has no time."""
    if not measurement.solved:
        return math.inf
    value: float | None = getattr(measurement, column)
    if value is None or not 0 <= value < math.inf:
        raise InputError(
            f"results, {measurement.problem} by {measurement.solver} at {tolerance_name(measurement.tol)}: solved, expected a time in "
            f"column {column}, got {'none' if value is None else value}"
        )
    return value
