"""The curves and the table of steps that stand beside the bodies on a run's page."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.running.folder import RunFolder
from fcsim.running.step_table import COLUMNS
from fcsim.view.style import prefixed

MOST_ROWS = 2000
"""Of steps.csv on a page: a longer run's are spread evenly."""

Series = tuple[str, str, bool]  # column, label, whether it is added up from step to step

_GROUPS: tuple[tuple[str, str, bool, tuple[Series, ...]], ...] = (
    (
        "Energies",
        "J",
        False,
        (
            ("kinetic_energy", "kinetic", False),
            ("elastic_energy", "elastic", False),
            ("load_work", "work of loads", True),
            ("support_work", "work of supports", True),
            ("damping_dissipation", "dissipated by damping", True),
            ("numerical_dissipation", "by the time scheme", True),
            ("material_dissipation", "by materials", True),
            ("normal_dissipation", "by impacts", True),
            ("tangential_dissipation", "by friction", True),
            ("fracture_dissipation", "by fracture", True),
            ("energy_created", "created by contact", False),
        ),
    ),
    (
        "Contacts",
        "",
        False,
        (("nc", "candidates", False), ("active", "closed", False), ("sticking", "sticking", False), ("sliding", "sliding", False)),
    ),
    ("Iterations", "", False, (("iterations", "iterations", False),)),
    ("Error of the solve", "", True, (("error", "error", False),)),
    ("Overlap", "m", False, (("overlap", "seen by the witness", False), ("penetration", "largest penetration of a contact", False))),
)


def shown_rows(run: RunFolder) -> IntArray:
    """Rows of steps.csv that the page has: all, or MOST_ROWS of them with the first and the last."""
    n = len(next(iter(run.columns.values()), ()))
    return np.unique(np.linspace(0, max(n - 1, 0), min(n, MOST_ROWS)).round().astype(np.int64))


def table(run: RunFolder, rows: IntArray) -> dict[str, list[object]]:
    """The columns of steps.csv at `rows`: numbers as they stand there, texts, None for what is not a number."""
    return {name: _plain(values[rows].tolist()) for name, values in run.columns.items()}


def units(run: RunFolder) -> dict[str, str]:
    """Unit of each column whose unit is known."""
    known = {name: unit for name, (unit, _) in COLUMNS.items()}
    plots = run.plots
    entries = [*plots.reaction, *([plots.imposed] if plots.imposed else []), *(c for h in plots.histories for c in (h.against, *h.curves))]
    return known | {entry.column: entry.unit for entry in entries} | {name: "s" for name in run.columns if name.startswith("seconds_")}


def groups(run: RunFolder, rows: IntArray) -> list[dict[str, object]]:
    """The graphs in their order: title, unit, whether logarithmic, x (title, unit, values), curves (label, values)."""
    t = run.numbers("t")
    if t is None:
        return []
    time = _axis("time", "s", t[rows])
    found: list[dict[str, object]] = []
    plots = run.plots
    if plots.reaction:
        curves = [(entry.column, entry.label or entry.column, False) for entry in plots.reaction]
        found += _group(run, rows, "Reactions", plots.reaction[0].unit or "N", False, curves, time)
        if plots.imposed is not None and (x := run.numbers(plots.imposed.column)) is not None:
            along = _axis(plots.imposed.label or plots.imposed.column, plots.imposed.unit or "m", x[rows])
            found += _group(run, rows, "Reactions against the imposed motion", plots.reaction[0].unit or "N", False, curves, along)
    for history in plots.histories:
        if (x := run.numbers(history.against.column)) is not None and history.curves:
            along = _axis(history.against.label or history.against.column, history.against.unit, x[rows])
            curves = [(entry.column, entry.label or entry.column, False) for entry in history.curves]
            found += _group(run, rows, history.name.replace("_", " "), history.curves[0].unit, False, curves, along)
    for title, unit, logarithmic, series in _GROUPS:
        found += _group(run, rows, title, unit, logarithmic, series, time)
    return found


def _axis(title: str, unit: str, values: FloatArray) -> dict[str, object]:
    scale, unit = prefixed(unit, values)
    return {"title": title, "unit": unit, "values": _plain((values / scale).tolist())}


def _group(
    run: RunFolder, rows: IntArray, title: str, unit: str, logarithmic: bool, series: Sequence[Series], x: dict[str, object]
) -> list[dict[str, object]]:
    """One graph, or none where its columns are absent or all are zero."""
    found = [(label, values, add) for column, label, add in series if (values := run.numbers(column)) is not None]
    curves = [(label, (np.cumsum(np.nan_to_num(values)) if add else values)[rows]) for label, values, add in found]
    curves = [(label, values) for label, values in curves if np.any(np.nan_to_num(values))]
    scale, unit = prefixed(unit, *(values for _, values in curves))
    shown = [{"label": label, "values": _plain((values / scale).tolist())} for label, values in curves]
    return [{"title": title, "unit": unit, "logarithmic": logarithmic, "x": x, "curves": shown}] if shown else []


def _plain(values: list[object]) -> list[object]:
    """JSON has no nan: None."""
    return [None if isinstance(value, float) and not np.isfinite(value) else value for value in values]
