"""The curves and the table of steps that stand beside the bodies on a run's page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.running.description import Column
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
    return {name: plain(values[rows].tolist()) for name, values in run.columns.items()}


def units(run: RunFolder) -> dict[str, str]:
    """Unit of each column whose unit is known."""
    known = {name: unit for name, (unit, _) in COLUMNS.items()}
    plots = run.plots
    entries = [*plots.reaction, *([plots.imposed] if plots.imposed else []), *(c for h in plots.histories for c in (h.against, *h.curves))]
    return known | {entry.column: entry.unit for entry in entries} | {name: "s" for name in run.columns if name.startswith("seconds_")}


@dataclass(frozen=True, eq=False)
class Line:
    """Values (n,) with a label, in the unit of SI that their graph or axis names."""

    label: str
    values: FloatArray


@dataclass(frozen=True, eq=False)
class Graph:
    """Curves over one axis; each has as many values as x."""

    title: str
    unit: str
    logarithmic: bool
    x: Line
    x_unit: str
    curves: tuple[Line, ...]


def graphs(run: RunFolder, rows: IntArray) -> list[Graph]:
    """The graphs of a run in their order: reactions, the case's histories, energies, contacts, iterations, error, overlap; those alone
    whose columns are there and not all zero."""
    t = run.numbers("t")
    if t is None:
        return []
    time = Line("time", t[rows])
    found: list[Graph | None] = []
    plots = run.plots
    if plots.reaction:
        series = [_series(entry) for entry in plots.reaction]
        unit = plots.reaction[0].unit or "N"
        found.append(_graph(run, rows, "Reactions", unit, False, series, time, "s"))
        if plots.imposed is not None and (x := run.numbers(plots.imposed.column)) is not None:
            along = Line(plots.imposed.label or plots.imposed.column, x[rows])
            found.append(_graph(run, rows, "Reactions against the imposed motion", unit, False, series, along, plots.imposed.unit or "m"))
    for history in plots.histories:
        if (x := run.numbers(history.against.column)) is not None and history.curves:
            along, series = Line(history.against.label or history.against.column, x[rows]), [_series(entry) for entry in history.curves]
            title = history.name.replace("_", " ")
            found.append(_graph(run, rows, title, history.curves[0].unit, False, series, along, history.against.unit))
    found += [_graph(run, rows, title, unit, logarithmic, series, time, "s") for title, unit, logarithmic, series in _GROUPS]
    return [graph for graph in found if graph is not None]


def drawn(graph: Graph) -> dict[str, object]:
    """A graph as the page's script takes it, in units with prefixes that suit it."""
    scale, unit = prefixed(graph.unit, *(curve.values for curve in graph.curves))
    x_scale, x_unit = prefixed(graph.x_unit, graph.x.values)
    return {
        "title": graph.title,
        "unit": unit,
        "logarithmic": graph.logarithmic,
        "x": {"title": graph.x.label, "unit": x_unit, "values": plain((graph.x.values / x_scale).tolist())},
        "curves": [{"label": curve.label, "values": plain((curve.values / scale).tolist())} for curve in graph.curves],
    }


def plain(values: list[object]) -> list[object]:
    """JSON has no nan: None."""
    return [None if isinstance(value, float) and not np.isfinite(value) else value for value in values]


def _series(entry: Column) -> Series:
    return entry.column, entry.label or entry.column, False


def _graph(
    run: RunFolder, rows: IntArray, title: str, unit: str, logarithmic: bool, series: Sequence[Series], x: Line, x_unit: str
) -> Graph | None:
    found = [(label, values, add) for column, label, add in series if (values := run.numbers(column)) is not None]
    curves = [Line(label, (np.cumsum(np.nan_to_num(values)) if add else values)[rows]) for label, values, add in found]
    shown = tuple(curve for curve in curves if np.any(np.nan_to_num(curve.values)))
    return Graph(title, unit, logarithmic, x, x_unit, shown) if shown else None
