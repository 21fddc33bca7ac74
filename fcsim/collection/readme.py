"""README.md of a collection, with the table that FCLIB's sets have."""

from __future__ import annotations

import datetime
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from fcsim.collection.manifest import Entry
from fcsim.collection.properties import Properties
from fcsim.files import replacing

MANIFEST_TEXT = (
    "`manifest.csv` has one row a file: its name and form, step and time [s], nc, n, m, contact density m/n, symmetry, rank and condition "
    "of W (largest over smallest nonzero singular value), solver with its iterations, status and tolerance, the error of the stored "
    "solution, SHA-256, the share of W's entries that are not zero, dimension, the file that it was copied from, and the parameters of "
    "the case. The error is "
    "||r - P_K(r - (u + g(u)))|| / ||q||, recomputed from r alone. `fcsim collection check DIR` verifies every file."
)


def one_a_problem(entries: Iterable[Entry]) -> list[Entry]:
    """One row for the forms of a problem, the global one where it is there."""
    rows: dict[str, Entry] = {}
    for entry in sorted(entries, key=lambda entry: (entry.form, entry.name)):
        rows.setdefault(entry.name, entry)
    return sorted(rows.values(), key=lambda entry: (entry.step is None, entry.step or 0, entry.name))


def facts(entries: Sequence[Entry], described: Sequence[Properties]) -> dict[str, str]:
    """The table's rows that the problems themselves tell."""
    rows = one_a_problem(entries)
    mu = [coefficient for properties in described if properties.nc for coefficient in properties.friction]
    symmetric = [row.symmetric for row in rows if row.nc]
    full = [row.rank == row.m for row in rows if row.nc and row.rank is not None]
    W = ["symmetric" if all(symmetric) else f"unsymmetric in {symmetric.count(False)}"] if symmetric else []
    if full:
        deficit = [row.m - row.rank for row in rows if row.rank is not None]
        W += ["full rank" if all(full) else f"rank deficient by {_range(deficit)}", f"condition {_range([row.condition for row in rows])}"]
    solvers = ", ".join(sorted({row.solver for row in rows}))
    unsolved = [row for row in rows if row.status not in ("SOLVED", "AT_REST")]
    told = {
        "date": datetime.date.today().isoformat(),
        "number of problems": str(len(rows)),
        "forms": ", ".join(f"{sum(entry.form == form for entry in entries)} {form}" for form in sorted({entry.form for entry in entries})),
        "dimension": _range([row.dimension for row in rows]),
        "coefficient of friction": _range(mu),
        "degrees of freedom": _range([row.n for row in rows]),
        "contacts": _range([row.nc for row in rows]),
        "contact density m/n": _range([row.density for row in rows]),
        "W": ", ".join(W),
        f"iterations of {solvers}": _range([row.iterations for row in rows]) + (f", {len(unsolved)} unsolved" if unsolved else ""),
        "error of the stored solutions": _range([row.error for row in rows if row.status != "AT_REST"]),
    }
    return {name: text for name, text in told.items() if text}


def _range(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    if not known:
        return ""
    low, high = (f"{value}" if isinstance(value, int) else f"{value:.4g}" for value in (min(known), max(known)))
    return low if low == high else f"[{low}:{high}]"


def write_readme(
    path: Path, title: str, *, facts: Mapping[str, str], text: str, pictures: Mapping[str, str], notes: Sequence[str] = ()
) -> Path:
    """Write title, picture, table, text, plots (file names with what they show) and notes as Markdown."""
    images = [f"![{shown}]({name})\n\n" for name, shown in pictures.items()]
    first = images.pop(0) if "picture.png" in pictures else ""
    table = "| | |\n|:---|:---|\n" + "".join(f"| {name} | {value} |\n" for name, value in facts.items())
    said = "## Notes\n\n" + "".join(f"* {note}\n" for note in notes) + "\n" if notes else ""
    content = f"# {title}\n\n{first}{table}\n## How it was made\n\n{text}\n\n{''.join(images)}## Files\n\n{MANIFEST_TEXT}\n\n{said}"
    with replacing(path) as temporary:
        temporary.write_text(content.rstrip() + "\n", encoding="utf-8", errors="backslashreplace")
    return path
