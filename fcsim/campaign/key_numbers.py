"""The numbers by which the runs of a sweep are compared, from their folders."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.running.folder import read_columns
from fcsim.running.step_table import COLUMNS

type Number = float | int | None

_OF_COLUMNS: dict[str, tuple[str, Callable[[FloatArray], float]]] = {
    "most_contacts": ("nc", lambda values: values.max()),
    "iterations": ("iterations", lambda values: values.sum()),
    "largest_error": ("error", lambda values: values.max()),
    "steps_cut": ("substeps", lambda values: float(np.count_nonzero(values > 1))),
    "largest_penetration": ("penetration", lambda values: values.max()),
    "largest_overlap": ("overlap", lambda values: values.max()),
    "friction_dissipation": ("friction_dissipation", lambda values: values.sum()),
    "energy_created": ("energy_created", lambda values: values[-1]),
    "largest_energy_residual": ("energy_residual", lambda values: np.abs(values).max()),
}
"""Name of a number: the column of steps.csv that it is made of, over all its steps, and how."""
_WHOLE = ("steps_done", "most_contacts", "iterations", "steps_cut")
NUMBERS = ("steps_done", "t", "seconds_of_steps", *_OF_COLUMNS)
"""Names of the numbers that every run has."""


def key_numbers(directory: Path) -> dict[str, Number]:
    """Steps, time reached, seconds of all steps, sums and extremes of steps.csv, and of every sensor the last, least and largest value;
    none of a run without steps. Entries that are no numbers, as an overlap that was not measured, count for nothing."""
    path = directory / "steps.csv"
    if not path.is_file():
        return {}
    try:
        columns = read_columns(path)
    except InputError:  # killed as it was made
        return {}
    numbers = {name: values for name, values in columns.items() if values.size and values.dtype.kind == "f"}
    if "step" not in numbers:
        return {}
    found: dict[str, Number] = {"steps_done": numbers["step"][-1], "t": _of(numbers.get("t"), lambda values: values[-1])}
    found["seconds_of_steps"] = round(sum(float(np.nansum(v)) for name, v in numbers.items() if name.startswith("seconds_")), 3)
    for name, (column, of) in _OF_COLUMNS.items():
        found[name] = _of(numbers.get(column), of)
    for name in columns:
        if name not in COLUMNS and not name.startswith("seconds_"):
            values = numbers.get(name)
            found[name] = _of(values, lambda given: given[-1])
            found[f"{name}_min"], found[f"{name}_max"] = _of(values, np.min), _of(values, np.max)
    return {name: None if value is None else int(value) if name in _WHOLE else float(value) for name, value in found.items()}


def _of(values: FloatArray | None, of: Callable[[FloatArray], float]) -> float | None:
    finite = values[np.isfinite(values)] if values is not None else None
    return float(of(finite)) if finite is not None and finite.size else None
