"""The report of a bench: one self-contained HTML page, whose first section answers to the mouse and whose others need no script."""

from __future__ import annotations

import json
import shlex
from collections import Counter
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

from fcsim.bench.reporting.comparison import Comparison, ToleranceComparison
from fcsim.bench.reporting.explorer import explorer_section
from fcsim.bench.reporting.page import KINDS, data_uri, drawn, facts, markdown_text, page, picture, table
from fcsim.bench.reporting.profile_plots import panels_figure, profile_figure
from fcsim.bench.reporting.summary import AT_TIME_LIMIT, notes, number, tables
from fcsim.bench.reporting.time_table import CLOCKS, tolerance_name
from fcsim.bench.results import NOT_TRIED, SLACK, Measurement, results_file
from fcsim.errors import InputError
from fcsim.files import inside, replacing
from fcsim.tables import read_rows
from fcsim.view.style import STYLE, matplotlib

Sections = list[tuple[str, str, list[str]]]
"""(anchor, heading, HTML) of each section."""


def write_report(
    comparison: Comparison,
    path: Path,
    *,
    results: Path,
    collections: Sequence[Path] = (),
    title: str | None = None,
    against: Path | None = None,
) -> Path:
    """Write the page `path`, whole or not at all, and return it.

    results      the folder or file that the comparison was read from: the table itself and convergence plots in the folder are embedded
    collections  folders of problems with manifest.csv, README.md and pictures, as far as they are there
    against      results of another bench, which the section "Problem by problem" sets beside this one
    Raises InputError for a collection that is not a folder or holds no problems, see also `explorer_section`.
    """
    for folder in collections:
        if not folder.is_dir():
            raise InputError(f"--collection {folder}: expected a folder, found {'a file' if folder.exists() else 'nothing'}")
        if not any((folder / name).is_file() for name in ("README.md", "manifest.csv")) and next(folder.rglob("*.hdf5"), None) is None:
            raise InputError(f"--collection {folder}: expected problems (FCLIB files, or README.md and manifest.csv of some), found none")
    heading = title or _title(comparison)
    with matplotlib().rc_context(STYLE):
        profiles = _profiles(comparison)
    sections: Sections = [
        ("explore", "Problem by problem", explorer_section(comparison, results, collections, against)),
        ("measured", "What was measured", _measured(comparison)),
        ("limits", "Limits and what they hide", _limits(comparison)),
        ("profiles", "Performance profiles", profiles),
        ("tables", "Tables", _tables(comparison)),
    ]
    if plots := _convergence(results if results.is_dir() else results.parent):
        sections.append(("convergence", "Convergence", plots))
    for place, folder in enumerate(collections, 1):
        sections.append((f"collection-{place}", f"Collection {folder.resolve().name}", _collection(folder)))
    sections.append(("reproduce", "How to reproduce", _reproduce(comparison, results, collections)))
    body = [f"<h1>{escape(heading)}</h1>", f'<p class="lead">{escape(_counts(comparison))}</p>']
    body.append("<nav><ul>" + "".join(f'<li><a href="#{anchor}">{escape(name)}</a></li>' for anchor, name, _ in sections) + "</ul></nav>")
    for anchor, name, html in sections:
        body += [f'<section id="{anchor}">', f"<h2>{escape(name)}</h2>", *html, "</section>"]
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary:
        temporary.write_text(page(heading, body), encoding="utf-8")
    return path


def _title(comparison: Comparison) -> str:
    sets = {m.problem.partition("-i")[0] for m in comparison.measurements}
    about = f" on {', '.join(sorted(sets))}" if len(sets) <= 3 else ""
    return f"Comparison of {len(comparison.solvers)} solver{'s' * (len(comparison.solvers) != 1)}{about}"


def _counts(comparison: Comparison) -> str:
    problems = len({(m.problem, m.form) for m in comparison.measurements})
    tols = ", ".join(tolerance_name(part.table.tol) for part in comparison.parts)
    kinds = ((problems, "problem"), (len(comparison.solvers), "solver"), (len(comparison.measurements), "measurement"))
    counts = ", ".join(f"{count} {kind}{'s' * (count != 1)}" for count, kind in kinds)
    return f"{counts}; tolerance{'s' * (len(comparison.parts) != 1)} {tols}."


def _range(values: Iterable[float]) -> str:
    known = sorted(values)
    low, high = f"{known[0]:g}", f"{known[-1]:g}"
    return low if low == high else f"{low} to {high}"


def _listed(values: Iterable[object]) -> str:
    return ", ".join(dict.fromkeys(str(value) for value in values))


def _measured(comparison: Comparison) -> list[str]:
    measurements = comparison.measurements
    first = list({(m.problem, m.form): m for m in measurements}.values())
    programs = {m.program: m.version for m in measurements}
    pairs = [
        ("Problems", ", ".join(f"{count} in {form} form" for form, count in Counter(m.form for m in first).items())),
        ("Dimension", _listed(f"{d}D" for d in sorted({m.dimension for m in first}))),
        ("Contacts", _range(m.nc for m in first)),
        ("Unknowns n", _range(m.n for m in first) + " (degrees of freedom of a global problem, contact unknowns of a local one)"),
        ("Solvers", ", ".join(comparison.solvers)),
        ("Tolerances", _listed(tolerance_name(part.table.tol) for part in comparison.parts)),
        ("Time", f"{CLOCKS[comparison.parts[0].table.clock][1]} of the whole solve from r = 0, with the reduction of a global problem"),
        ("Error", "‖r − P_K(r − (u + g(u)))‖ / ‖q‖ with g(u) = (μ ‖u_T‖, 0), recomputed from r outside the solver"),
        ("Solved", f"the solver says so within the time limit, and the recomputed error is at most {SLACK:g} × tolerance"),
        ("Machine", "; ".join(sorted({m.machine for m in measurements}))),
        ("Threads", _listed(sorted({m.threads for m in measurements})) + " a solve"),
        ("Versions", ", ".join(f"{program} {version}" for program, version in programs.items())),
        ("Measured", _period(measurements)),
    ]
    return [facts(pairs), *_remarks(comparison)]


def _period(measurements: Sequence[Measurement]) -> str:
    started = sorted(m.started for m in measurements)
    return f"from {started[0]} to {started[-1]}" if started[0] != started[-1] else started[0]


def _remarks(comparison: Comparison) -> list[str]:
    return [f'<p class="note">{escape(remark[:1].upper() + remark[1:])}.</p>' for remark in comparison.remarks]


def _limits(comparison: Comparison) -> list[str]:
    measurements = comparison.measurements
    limits = _range(m.time_limit for m in measurements)
    memory = {m.memory_limit for m in measurements}
    skipped = sum(NOT_TRIED in m.status for m in measurements)
    bound = "no memory limit" if memory == {None} else f"a memory limit of {_range(m for m in memory if m is not None)} MiB"
    censored = sum(not m.solved and m.outcome in AT_TIME_LIMIT for m in measurements)
    text = (
        f"Each solve had a time limit of {limits} s and {bound}. {censored} of {len(measurements)} measurements ended at the time limit. "
        + (f"({skipped} of them without a try: the solver had not met a looser tolerance in time.) " if skipped else "")
        + "They are censored: their time is known to be above the limit, no more. They count as unsolved in profiles and tables, and no "
        "time enters a mean for them. With a longer limit, a curve could rise only from the ratio on that is given below (the least "
        "time limit / time of the fastest among them; a dotted line in the profiles, where they reach it); left of it, only the "
        "problems that no solver solved could change it."
    )
    felt = [
        [tolerance_name(s.tol), str(sum(r.at_time_limit for r in s.solvers)), number(s.censored_from), str(s.unsolved_by_all)]
        for s in comparison.summaries
    ]
    outcomes: dict[str, Counter[str]] = {}
    for m in measurements:
        outcomes.setdefault(m.solver, Counter())["SOLVED" if m.solved else m.outcome] += 1
    seen = [o for o in dict.fromkeys(outcome for of in outcomes.values() for outcome in of) if o != "SOLVED"]
    rows = [[solver, *(str(outcomes[solver][o]) for o in ("SOLVED", *seen))] for solver in comparison.solvers]
    return [
        f"<p>{escape(text)}</p>",
        table(["tolerance", "at the time limit", "felt from ratio", "problems solved by none"], felt, "Where the time limit is felt"),
        table(["solver", "SOLVED", *seen], rows, "How the measurements of all tolerances ended"),
    ]


def _profiles(comparison: Comparison) -> list[str]:
    text = (
        "ρ(τ) of a solver is the fraction of the problems that it solved within τ times the time of the fastest solver of the problem "
        "(Dolan and Moré 2002): at τ = 1 the fraction that it won, at the right the fraction that it solved, given beside its name. "
        "The labels follow the curves from top to bottom."
    )
    html = [f"<p>{escape(text)}</p>"]
    for part in comparison.parts:
        name = tolerance_name(part.table.tol)
        html += [f"<h3>Tolerance {name}</h3>", drawn(profile_figure(part), f"Performance profiles at tolerance {name}: {_words(part)}")]
    if len(comparison.parts) > 1:
        html += ["<h3>All tolerances</h3>", drawn(panels_figure(comparison.parts), "The same performance profiles as panels with one axis")]
    return html


def _words(part: ToleranceComparison) -> str:
    """The figure in words: what each solver won and solved, from its top to its bottom."""
    profile, end = part.profile, part.profile.largest
    won, solved = profile.rho(1.0), profile.solved
    return "; ".join(f"{part.table.solvers[s]} won {won[s]:.0%}, solved {solved[s]:.0%}" for s in profile.order(end))


def _tables(comparison: Comparison) -> list[str]:
    html = []
    for title, header, rows in tables(comparison.summaries):
        html += [f"<h3>{escape(title)}</h3>", table(header, rows)]
    return [*html, "<ul>" + "".join(f"<li>{escape(note)}</li>" for note in notes(comparison.summaries)) + "</ul>"]


def _convergence(folder: Path) -> list[str]:
    """The convergence plots in a results folder."""
    html = []
    for path in _own_files(folder, folder.rglob("convergence-*.png")):
        name = path.stem.removeprefix("convergence-")
        html.append(picture(path.read_bytes(), KINDS[".png"], f"Error against time and iterations on {name}", name))
    return html


def _own_files(folder: Path, paths: Iterable[Path]) -> list[Path]:
    """The files among the paths that are in the folder: a page is passed on, and a link would take what lies elsewhere along."""
    return [path for path in sorted(paths) if path.is_file() and path.resolve().is_relative_to(folder.resolve())]


def _collection(folder: Path) -> list[str]:
    html: list[str] = []
    embedded: set[str] = set()
    readme, manifest = folder / "README.md", folder / "manifest.csv"
    if readme.is_file():
        text, embedded = markdown_text(inside(folder, readme).read_text(encoding="utf-8", errors="replace"), folder)
        html.append(text)
    for path in _own_files(folder, folder.iterdir()):
        if path.suffix.lower() in KINDS and path.name not in embedded:
            alt = f"{path.stem} of the collection {folder.resolve().name}"
            html.append(picture(path.read_bytes(), KINDS[path.suffix.lower()], alt, path.stem))
    if manifest.is_file():
        rows = read_rows(inside(folder, manifest))
        if rows:
            shown = [row for row in rows[1:] if len(row) == len(rows[0])]
            kept = [k for k, name in enumerate(rows[0]) if name not in ("sha256", "source") and any(row[k] for row in shown)]
            cells = [[_short(row[k]) for k in kept] for row in shown]
            listing = table([rows[0][k] for k in kept], cells)
            html.append(f"<details><summary>The {len(shown)} files of manifest.csv</summary>{listing}</details>")
    if not html:
        files = len(list(folder.rglob("*.hdf5")))
        html.append(f"<p>{files} FCLIB files, without README.md, manifest.csv and pictures.</p>")
    return html


def _short(text: str) -> str:
    """A number with four digits; another text as it is."""
    try:
        return text if text.isdigit() else f"{float(text):.4g}"
    except ValueError:
        return text


def _reproduce(comparison: Comparison, results: Path, collections: Sequence[Path]) -> list[str]:
    table_file = results_file(results)
    uri, name = data_uri("text/csv", table_file.read_bytes()), escape(table_file.name)
    place = _shown(results)
    given = [word for folder in collections for word in ("--collection", _shown(folder))]
    commands = [
        _bench_command(comparison, results, collections),
        shlex.join(["fcsim", "profile", place, *comparison.selection.arguments()]),
        shlex.join(["fcsim", "report", place, *comparison.selection.arguments(), *given]),
    ]
    return [
        f"<pre><code>{escape(chr(10).join(commands))}</code></pre>",
        "<p>Measurements that are in the folder of the results already are not made again. Ratios of times carry over to another machine "
        "roughly, times do not, nor which solves end at the time limit.</p>",
        f'<p class="screen">The table behind this page: <a download="{name}" href="{uri}">{name}</a>.</p>',
    ]


def _shown(path: Path) -> str:
    return path.name or str(path) if path.is_absolute() else str(path)


def _bench_command(comparison: Comparison, results: Path, collections: Sequence[Path]) -> str:
    """The call that the bench noted last; where there is no note, one that measures what is compared."""
    note = results_file(results).with_name("bench.json")
    if note.is_file():
        try:
            return str(json.loads(note.read_text(encoding="utf-8"))["command"])
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(f'{note}: expected the note of fcsim bench, JSON with a "command" ({error})') from None
    measurements = comparison.measurements
    words = ["fcsim", "bench", *(map(_shown, collections) if collections else ["PROBLEMS"])]
    words += ["--solvers", ",".join(comparison.solvers)]
    words += ["--tols", ",".join(tolerance_name(part.table.tol) for part in comparison.parts)]
    words += ["--time-limit", f"{max(m.time_limit for m in measurements):g}"]
    memory = [m.memory_limit for m in measurements if m.memory_limit is not None]
    words += ["--memory-limit", f"{max(memory):g}"] if memory else []
    return shlex.join([*words, "--out", _shown(results)])
