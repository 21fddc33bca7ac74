"""What is said of pulses of loads and motions that are about as short as a step: the steps see more or less of them than there is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model
from fcsim.assembly.time_functions import Table
from fcsim.timestep.remarks.over_time.undersampled import functions_of_time
from fcsim.timestep.scheme import Scheme

LOOKS, PLACES = 8000, 8
"""Evaluations in all, and in a step at most; tables, whose times are known, are looked at there besides."""
LONGEST = 1_000_000
"""Steps of a run that is looked at: the ends of more fill the memory before the first of them is made."""
OFF = 0.1
"""Of the integral without regard to signs: what the steps may leave or add. A load that is switched on for ten steps may be off by that."""


def lost_pulses(model: Model, scheme: Scheme, begin: float, steps: int) -> Iterator[str]:
    """The first load or motion, in dynamics, that comes and goes and whose integral over time the steps do not have.

    The schemes take the mean of both ends of a step; what rests at one value for more than half of the run, and at both its ends, and is
    another one between is compared with a finer rule.
    """
    if not scheme.timing.moving or not 2 <= steps <= LONGEST:
        return
    functions = list(functions_of_time(model))
    looks = min(LOOKS // (steps * max(len(functions), 1)), PLACES)
    ends = np.asarray(begin + scheme.h * np.arange(steps + 1), dtype=np.float64)
    between = (ends[:-1, None] + scheme.h * np.arange(1, looks) / max(looks, 1)).ravel()
    for what, function in functions:
        known = _times(function)
        inside = known[(known > ends[0]) & (known < ends[-1])]
        if not (between.size or inside.size):
            continue
        fine: FloatArray = np.unique(np.concatenate([ends, between, inside]))
        if (off := _off(function, ends, fine)) > OFF:
            yield (
                f"{what} comes and goes within few steps of h = {scheme.h:g}, which have its integral over time off by {off:.0%}: choose h "
                "below a tenth of its duration, or give what it is on average"
            )
            return


def _times(function: Callable[[float], ArrayLike]) -> FloatArray:
    """The times of the table that is behind a function: a load's factor, or what moves a support, a table itself or a method of one."""
    owner = function.args[0] if isinstance(function, partial) else getattr(function, "__self__", None)
    for name in ("factor", "velocity", "displacement", "angle", "rate"):
        given = getattr(owner, name, None)
        table = given if isinstance(given, Table) else getattr(given, "__self__", None)
        if isinstance(table, Table):
            return np.asarray(table.times, dtype=np.float64)
    return np.zeros(0)


def _off(function: Callable[[float], ArrayLike], ends: FloatArray, fine: FloatArray) -> float:
    """By which share of it the integral over time of what comes and goes is another one at the ends of the steps; 0 where nothing does."""
    values = np.array([np.asarray(function(float(t)), dtype=np.float64).ravel() for t in fine])
    at = np.searchsorted(fine, ends)
    base = np.median(values[at], axis=0)
    rests = np.all(np.isclose(values[[0, -1]], base, rtol=1e-9, atol=1e-9 * float(np.ptp(values, axis=0).max())), axis=0)
    moved = (values - base)[:, rests]
    whole = np.trapezoid(np.abs(moved), fine, axis=0)
    error = np.abs(np.trapezoid(moved[at], ends, axis=0) - np.trapezoid(moved, fine, axis=0))
    return float(np.max(error / np.where(whole > 0, whole, 1.0), initial=0.0))
