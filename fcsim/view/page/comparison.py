"""Runs side by side: what differs between their parameters, key numbers, curves over each other in one HTML file."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.files import replacing
from fcsim.running.folder import RunFolder
from fcsim.view.page.curves import Graph, graphs, plain, shown_rows
from fcsim.view.page.write import as_json, library
from fcsim.view.style import prefixed

Row = tuple[str, tuple[str, ...]]  # what, and of each run


@dataclass(frozen=True, eq=False)
class Comparison:
    """names of the runs; differences: parameters and settings that are not the same in all; numbers: status, steps, seconds, iterations,
    errors, overlap, energy and the largest and last values of the reactions, as texts."""

    names: tuple[str, ...]
    differences: tuple[Row, ...]
    numbers: tuple[Row, ...]
    runs: tuple[RunFolder, ...]


def compare(runs: Sequence[RunFolder]) -> Comparison:
    """Set runs side by side; InputError for fewer than two, or one that is given twice."""
    if len(runs) < 2:
        raise InputError(f"compare: expected the folders of two runs or more, got {len(runs)}")
    places = [run.directory.resolve() for run in runs]
    if len(set(places)) < len(places):
        raise InputError(f"compare: expected different folders, got {next(str(p) for p in places if places.count(p) > 1)} twice")
    settings = [_settings(run) for run in runs]
    names = dict.fromkeys(name for of_run in settings for name in of_run)
    rows = [(name, tuple(of_run.get(name, "–") for of_run in settings)) for name in names]
    return Comparison(_names(places), tuple(row for row in rows if len(set(row[1])) > 1), _numbers(runs), tuple(runs))


def write_comparison(compared: Comparison, path: Path) -> Path:
    """Write the comparison as one HTML file without network; MissingDependency without plotly."""
    content = {"names": compared.names, "graphs": _over_each_other(compared)}
    here = files("fcsim.view.page")
    text = Template(here.joinpath("comparison.html").read_text(encoding="utf-8")).substitute(
        title=escape("Runs side by side: " + ", ".join(compared.names)),
        style=here.joinpath("page.css").read_text(encoding="utf-8"),
        numbers=_table(compared.names, compared.numbers),
        differences=_table(compared.names, compared.differences) if compared.differences else "<p>None.</p>",
        script=here.joinpath("comparison.js").read_text(encoding="utf-8"),
        library=library(),
        content=as_json(content),
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def _names(places: Sequence[Path]) -> tuple[str, ...]:
    """The folders' names, with as many of their parents as tell them apart."""
    for depth in range(1, max(len(place.parts) for place in places)):
        names = tuple("/".join(place.parts[-depth:]) for place in places)
        if len(set(names)) == len(names):
            return names
    return tuple(map(str, places))


def _settings(run: RunFolder) -> dict[str, str]:
    about = run.description
    own = {"case": about.case, "scheme": about.scheme, "solver": about.solver, "tol": "" if about.tol is None else f"{about.tol:g}"}
    versions: Mapping[str, str] = {f"version of {name}": value for name, value in about.versions.items()}
    return {**{name: json.dumps(value) for name, value in about.parameters.items()}, **own, **versions}


def _numbers(runs: Sequence[RunFolder]) -> tuple[Row, ...]:
    rows: list[Row] = [
        ("status", tuple(run.description.status for run in runs)),
        ("steps", tuple(f"{len(next(iter(run.columns.values()), ()))} of {run.description.steps}" for run in runs)),
        ("seconds a step, median", tuple(_seconds(run) for run in runs)),
    ]
    for name, label, unit, of in (
        ("iterations", "iterations, all steps", "", np.nansum),
        ("error", "largest error", "", np.nanmax),
        ("nc", "most contacts", "", np.nanmax),
        ("overlap", "largest overlap", "m", np.nanmax),
        ("energy_created", "energy created by contact", "J", lambda values: values[-1]),
    ):
        rows.append((label, tuple(_of(run, name, unit, of) for run in runs)))
    for entry in dict.fromkeys(entry for run in runs for entry in run.plots.reaction):
        label, unit = entry.label or entry.column, entry.unit or "N"
        rows.append((f"{label}, largest", tuple(_of(run, entry.column, unit, _largest) for run in runs)))
        rows.append((f"{label}, last", tuple(_of(run, entry.column, unit, lambda values: values[-1]) for run in runs)))
    return tuple(row for row in rows if set(row[1]) != {"–"})


def _largest(values: np.ndarray) -> float:
    """The value of the largest magnitude, with its sign."""
    return float(values[np.nanargmax(np.abs(values))])


def _seconds(run: RunFolder) -> str:
    phases = [values for name in run.columns if name.startswith("seconds_") and (values := run.numbers(name)) is not None]
    return f"{np.median(np.sum(phases, axis=0)):.3g}" if phases else "–"


def _of(run: RunFolder, column: str, unit: str, of: Callable[[FloatArray], float]) -> str:
    values = run.numbers(column)
    if values is None or not np.isfinite(values).any():
        return "–"
    value = float(of(values[np.isfinite(values)]))
    scale, unit = prefixed(unit, value)
    return f"{value / scale:.5g} {unit}".strip()


def _over_each_other(compared: Comparison) -> list[dict[str, object]]:
    """The graphs of all runs, those of the same title and unit as one; each curve with its own x."""
    of_title: dict[tuple[str, str, str], list[tuple[str, Graph]]] = {}
    for name, run in zip(compared.names, compared.runs, strict=True):
        for graph in graphs(run, shown_rows(run)):
            of_title.setdefault((graph.title, graph.unit, graph.x_unit), []).append((name, graph))
    found = []
    for (title, given, x_given), own in of_title.items():
        scale, unit = prefixed(given, *(curve.values for _, graph in own for curve in graph.curves))
        x_scale, x_unit = prefixed(x_given, *(graph.x.values for _, graph in own))
        curves = [
            {
                "run": compared.names.index(name),
                "label": curve.label,
                "x": plain((graph.x.values / x_scale).tolist()),
                "y": plain((curve.values / scale).tolist()),
            }
            for name, graph in own
            for curve in graph.curves
        ]
        x = {"title": own[0][1].x.label, "unit": x_unit}
        found.append({"title": title, "unit": unit, "logarithmic": own[0][1].logarithmic, "x": x, "curves": curves})
    return found


def _table(names: Sequence[str], rows: Sequence[Row]) -> str:
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in names)
    lines = [f'<th scope="row">{escape(what)}</th>' + "".join(f"<td>{escape(value)}</td>" for value in values) for what, values in rows]
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    return f'<div class="wide"><table><thead><tr><td></td>{head}</tr></thead><tbody>{body}</tbody></table></div>'
