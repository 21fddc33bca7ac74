"""The interactive section of a bench's page, as HTML: its style, its script and plotly's stand within."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template

from fcsim.bench.reporting.comparison import Comparison
from fcsim.bench.reporting.explorer.content import content
from fcsim.bench.results import read_results
from fcsim.errors import InputError
from fcsim.view.page.write import as_json, library


def explorer_section(comparison: Comparison, results: Path, collections: Sequence[Path] = (), against: Path | None = None) -> list[str]:
    """Return the section's HTML. against: the results of another bench, set beside this one.

    Raises InputError for results or convergence tables that cannot be read and benches that share no measurement, MissingDependency
    without plotly.
    """
    other = None
    if against is not None:
        measured = read_results(against)
        keys = {m.key for m in comparison.measurements}
        if not any(m.key in keys for m in measured):
            raise InputError(f"--against {against}: expected results that share a problem, solver and tolerance, found none in common")
        other = (against.resolve().name if against.is_dir() else against.resolve().parent.name, measured)
    here = files("fcsim.bench.reporting.explorer")
    html = Template(here.joinpath("explorer.html").read_text(encoding="utf-8")).substitute(
        solvers="".join(f"<option>{escape(name)}</option>" for name in comparison.solvers),
        style=here.joinpath("explorer.css").read_text(encoding="utf-8"),
        content=as_json(content(comparison, collections, results, other)),
        library=library(),
        script=here.joinpath("explorer.js").read_text(encoding="utf-8"),
    )
    return [html]
