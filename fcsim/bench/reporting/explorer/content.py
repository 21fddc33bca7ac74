"""What the page's script draws, as plain values for JSON: profiles, measurements problem by problem, convergence, pictures."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from fcsim.bench.reporting.comparison import Comparison, ToleranceComparison
from fcsim.bench.reporting.page import KINDS, data_uri
from fcsim.bench.reporting.time_table import CLOCKS, tolerance_name
from fcsim.bench.results import SLACK, Measurement
from fcsim.errors import InputError

Value = object
"""Of JSON: numbers, texts, lists and dictionaries of these, None."""

MOST_POINTS = 400
"""Of a curve of convergence on the page: more are thinned to every k-th, first and last kept."""
LARGEST_PICTURE = 2_000_000
"""[bytes] Larger pictures of problems are left out of the page."""


def content(
    comparison: Comparison, folders: Sequence[Path], results: Path, other: tuple[str, Sequence[Measurement]] | None
) -> dict[str, Value]:
    """All of it; folders: collections whose pictures may be problems'; other: name and measurements of a second bench."""
    names = {m.problem for m in comparison.measurements}
    return {
        "solvers": list(comparison.solvers),
        "clock": CLOCKS[comparison.selection.clock][1],
        "resolution": comparison.selection.resolution,
        "slack": SLACK,
        "tolerances": [_tolerance(comparison, part, other) for part in comparison.parts],
        "curves": _curves(results, names),
        "pictures": _pictures(folders, names),
        "other": None if other is None else other[0],
    }


def _tolerance(comparison: Comparison, part: ToleranceComparison, other: tuple[str, Sequence[Measurement]] | None) -> dict[str, Value]:
    profile, solvers = part.profile, part.table.solvers
    largest = max(profile.largest, 1.1)
    column = CLOCKS[part.table.clock][0]
    curves = {}
    for k, solver in enumerate(solvers):
        tau, rho = profile.steps(k, largest)
        curves[solver] = {"tau": tau.tolist(), "rho": rho.tolist()}
    rows: dict[tuple[str, str], dict[str, Measurement]] = {}
    for m in comparison.measurements:
        if m.tol == part.table.tol:
            rows.setdefault((m.problem, m.form), {})[m.solver] = m
    there = (
        {} if other is None else {(m.problem, m.form, m.solver): m for m in other[1] if math.isclose(m.tol, part.table.tol, rel_tol=1e-9)}
    )
    return {
        "name": tolerance_name(part.table.tol),
        "largest": largest,
        "count": profile.problems,
        "profiles": curves,
        "problems": [_problem(key, of, solvers, column, there) for key, of in rows.items()],
    }


def _problem(
    key: tuple[str, str],
    of: Mapping[str, Measurement],
    solvers: Sequence[str],
    column: str,
    there: Mapping[tuple[str, str, str], Measurement],
) -> dict[str, Value]:
    """One row: `missing` names the solvers that were not measured on it, for which the comparison leaves it out."""
    first = next(iter(of.values()))
    return {
        "problem": key[0],
        "form": key[1],
        "dimension": first.dimension,
        "contacts": first.nc,
        "unknowns": first.n,
        "missing": [solver for solver in solvers if solver not in of],
        "cells": {solver: _cell(m, column) for solver, m in of.items()},
        "other": {solver: _cell(there[*key, solver], column) for solver in solvers if (*key, solver) in there},
    }


def _cell(m: Measurement, column: str) -> dict[str, Value]:
    return {
        "solved": m.solved,
        "seconds": _finite(getattr(m, column)),
        "status": m.status,
        "iterations": m.iterations,
        "error": _finite(m.error),
        "limit": m.time_limit,
    }


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _curves(results: Path, names: set[str]) -> dict[str, Value]:
    """Convergence of problems, from the convergence-PROBLEM.csv files in the folder of the results; others' problems are left out."""
    folder = results if results.is_dir() else results.parent
    found: dict[str, Value] = {}
    for path in sorted(folder.rglob("convergence-*.csv")):
        problem = path.stem.removeprefix("convergence-")
        if problem in names and path.is_file() and path.resolve().is_relative_to(folder.resolve()):
            found[problem] = _read_curves(path)
    return found


def _read_curves(path: Path) -> list[Value]:
    """[{solver, iteration, seconds, error}] of one file of `write_convergence`."""
    curves: dict[str, tuple[list[float], list[float], list[float]]] = {}
    try:
        with path.open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                values = [float(row[name]) for name in ("iteration", "seconds", "error")]
                for values_so_far, value in zip(curves.setdefault(row["solver"], ([], [], [])), values, strict=True):
                    values_so_far.append(value)
    except (KeyError, TypeError, ValueError, csv.Error) as error:
        raise InputError(
            f"{path}: expected the columns solver, iteration, seconds, error of numbers, as fcsim profile --convergence writes ({error})"
        ) from None
    result: list[Value] = []
    for solver, (iteration, seconds, errors) in curves.items():
        step = -(-len(errors) // MOST_POINTS)
        kept = [k for k in range(len(errors)) if (k % step == 0 or k == len(errors) - 1) and math.isfinite(errors[k])]
        result.append(
            {
                "solver": solver,
                **{name: [of[k] for k in kept] for name, of in (("iteration", iteration), ("seconds", seconds), ("error", errors))},
            }
        )
    return result


def _pictures(folders: Sequence[Path], names: set[str]) -> dict[str, Value]:
    """{problem: picture as an address}: of a problem's own name, else of what its name begins with (its run's), else of its collection."""
    found: dict[str, Value] = {}
    for folder in folders:
        own = {m.stem for m in folder.rglob("*.hdf5")}
        pictures = {
            path.stem: path
            for path in sorted(folder.rglob("*"))
            if path.suffix.lower() in KINDS
            and path.is_file()
            and path.resolve().is_relative_to(folder.resolve())
            and path.stat().st_size <= LARGEST_PICTURE
        }
        for name in sorted(names - found.keys()):
            alike = [stem for stem in pictures if name == stem or name.startswith(f"{stem}-")]
            if not alike and name in own:
                alike = [stem for stem in ("bodies", "stress", "picture") if stem in pictures]
            if alike:
                path = pictures[max(alike, key=lambda stem: (stem == name, len(stem)))]
                found[name] = data_uri(KINDS[path.suffix.lower()], path.read_bytes())
    return found
