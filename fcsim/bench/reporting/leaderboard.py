"""The leaderboard: one self-contained HTML page, and the same tables as Markdown, of standings and profiles by family and over all."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from fcsim.bench.reporting.comparison import Selection, compare
from fcsim.bench.reporting.page import data_uri, drawn, facts, page, table
from fcsim.bench.reporting.profile_plots import profile_figure
from fcsim.bench.reporting.standings import ALL, Group, Refusal, Standing, refusals, standings
from fcsim.bench.reporting.summary import duration, markdown_table, number
from fcsim.bench.reporting.time_table import CLOCKS, solver_names, tolerance_name
from fcsim.bench.results import SLACK
from fcsim.files import replacing
from fcsim.view.style import STYLE, matplotlib

STANDING = ("solver", "solved", "median", "sum", "sum / least", "mean ratio", "largest ratio")
REFUSAL = ("solver", "says infeasible", "gives up", "at the limit", "wrong or broken", "error below tolerance", "median")
COLUMNS = (
    "Solved: of the problems of the group that the solver is made for (dimension, form); the error is recomputed outside the solver.",
    "Median: of the time over those problems; a dash where half of them or more are unsolved.",
    "Sum: of the times over the problems that some solver solved; what this solver did not solve counts with the time limit, and the sum "
    "is marked ≥.",
    "Sum / least: that sum over the least sum of a solver on the same problems.",
    "Mean ratio, largest ratio: of the time over that of the fastest solver of the problem, over the problems that this solver solved: the "
    "geometric mean and the largest.",
    "Every solver: solved problems of each group, and in brackets its mean ratio on them; how many a group has is in the header.",
    "Leads: the solver that stands first in the group's table: by what it solved, then by its sum; or by how often it says infeasible.",
    "Problems without a solution: the right answer is INFEASIBLE with its proof. A published error below the tolerance is possible all the "
    "same, since it is relative to the velocity without reactions. Median: of the time until the answer, the time limit where none came.",
)


@dataclass(frozen=True)
class Circumstances:
    """What a reader needs to trust and repeat the figures.

    command  that makes the same page; pairs: (name, what it is) of machine, versions, problems, limits; notes: what is missing or left out
    first    the solver that the overview follows
    """

    command: str
    pairs: Sequence[tuple[str, str]]
    notes: Sequence[str]
    first: str
    clock: str = "wall"


def standing_cells(row: Standing) -> list[str]:
    """The texts of a row under `STANDING`."""
    total = "–" if math.isnan(row.total) else f"{'≥ ' if row.bound else ''}{duration(row.total)}"
    median = duration(row.median) if math.isfinite(row.median) else "–"
    return [row.solver, f"{row.solved} of {row.measured}", median, total, number(row.to_best), number(row.ratio), number(row.worst)]


def refusal_cells(row: Refusal) -> list[str]:
    """The texts of a row under `REFUSAL`."""
    counts = [f"{row.infeasible} of {row.measured}", *map(str, (row.gave_up, row.late, row.failed, row.solved))]
    return [row.solver, *counts, duration(row.median)]


def group_table(group: Group, clock: str) -> tuple[Sequence[str], list[list[str]]]:
    """Header and rows of a group's table."""
    if group.solvable is False:
        return REFUSAL, [refusal_cells(row) for row in refusals(group, clock)]
    return STANDING, [standing_cells(row) for row in standings(group, clock)]


def overview(groups: Sequence[Group], first: str, clock: str) -> tuple[Sequence[str], list[list[str]]]:
    """Header and rows of a table of all groups: who leads, and where the solver `first` stands."""
    header = ("group", "problems", "solved by some", "leads", first, "its sum", "sum / least", "largest ratio")
    rows = []
    for group in groups:
        about = [
            f"{group.name}, {group.dimension}D",
            str(len(group.problems)),
            str(len({(m.problem, m.form) for m in group.measurements if m.solved})),
        ]
        if group.solvable is False:
            says = refusals(group, clock)
            own = next((f"{row.infeasible} infeasible" for row in says if row.solver == first), "–")
            rows.append([*about, says[0].solver if says[0].infeasible else "–", own, "–", "–", "–"])
            continue
        standing = standings(group, clock)
        cells = next((standing_cells(row) for row in standing if row.solver == first), ["–"] * len(STANDING))
        rows.append([*about, standing[0].solver, cells[1], cells[3], cells[4], cells[6]])
    return header, rows


def every_solver(groups: Sequence[Group], clock: str) -> tuple[Sequence[str], list[list[str]]]:
    """Header and rows of a table of all solvers by groups, those of the most solved first: how many of its problems it solved, and the
    geometric mean of its time over the fastest's on these; problems without a solution and groups of all are left out."""
    own = [group for group in groups if group.name != ALL and group.solvable is not False]
    found: dict[str, dict[int, Standing]] = defaultdict(dict)
    for place, group in enumerate(own):
        for row in standings(group, clock):
            found[row.solver][place] = row
    rows = []
    for solver, by_group in found.items():
        solved, measured = (sum(getattr(row, name) for row in by_group.values()) for name in ("solved", "measured"))
        powers = [row.solved * math.log(row.ratio) for row in by_group.values() if row.solved]
        ratio = math.exp(math.fsum(powers) / solved) if solved else math.nan
        cells = [_of_group(by_group[place]) if place in by_group else "" for place in range(len(own))]
        rows.append((-solved / measured, ratio, [solver, f"{solved} of {measured} ({number(ratio)})", *cells]))
    return ("solver", "all", *(f"{group.name}, {len(group.problems)}" for group in own)), [row for *_, row in sorted(rows)]


def _of_group(row: Standing) -> str:
    return f"{row.solved} ({number(row.ratio)})" if row.solved else "0"


def heading(group: Group) -> str:
    """Name, dimension and size of a group."""
    count, low, high = len(group.problems), group.contacts[0], group.contacts[-1]
    size = f"{low}" if low == high else f"{low} to {high}"
    return f"{group.name}, {group.dimension}D: {count} problem{'s' * (count != 1)} of {size} contact{'s' * (high != 1)}"


def _said(group: Group) -> str:
    known = {True: "", None: "", False: " They are known to have no solution."}[group.solvable]
    return f"{group.about.rstrip('.')}.{known}"


def failures(groups: Sequence[Group]) -> list[tuple[str, str]]:
    """(who, on what and how) of problems that were not solved: first those of none, then of each solver those that another one solved.

    Problems known to have no solution are left out.
    """
    own = [m for group in groups if group.solvable is not False and group.name != ALL for m in group.measurements]
    solved = {(m.problem, m.form) for m in own if m.solved}
    none = list(dict.fromkeys(m.problem for m in own if (m.problem, m.form) not in solved))
    rows = [("no solver", f"{len(none)}: {', '.join(none)}")] if none else []
    for solver in solver_names(own) if own else ():
        ends: dict[str, list[str]] = defaultdict(list)
        for m in own:
            if m.solver == solver and not m.solved and (m.problem, m.form) in solved:
                ends[m.outcome].append(m.problem)
        if ends:
            count = sum(map(len, ends.values()))
            rows.append((solver, f"{count}: " + "; ".join(f"{how}: {', '.join(names)}" for how, names in ends.items())))
    return rows


def write_leaderboard(groups: Mapping[float, Sequence[Group]], about: Circumstances, path: Path, table_file: Path) -> list[Path]:
    """Write the page `path` and, beside it, its tables as Markdown; each whole or not at all. Return the files.

    groups      by tolerance, those of all problems last (`fcsim.bench.reporting.standings.groups`)
    table_file  results.csv, which is embedded
    """
    files = ((path, _html(groups, about, table_file)), (path.with_suffix(".md"), markdown(groups, about)))
    for file, text in files:
        with replacing(file) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return [file for file, _ in files]


def _lead(groups: Mapping[float, Sequence[Group]]) -> str:
    own = [m for parts in groups.values() for group in parts if group.name != ALL for m in group.measurements]
    problems, solvers = len({(m.problem, m.form) for m in own}), len({m.solver for m in own})
    return f"{problems} problems, {solvers} solvers, {len(own)} measurements; tolerances {', '.join(map(tolerance_name, groups))}."


def _definitions(clock: str) -> list[str]:
    return [
        f"Time: {CLOCKS[clock][1]} of the whole solve from r = 0, with the reduction of a global problem.",
        "Error: the published one, ‖r − P_K(r − (u + g(u)))‖ / ‖q‖ with g(u) = (μ ‖u_T‖, 0); solved: the solver says so within the time "
        f"limit, and that error, recomputed, is at most {SLACK:g} × tolerance.",
        *COLUMNS,
    ]


def _html(groups: Mapping[float, Sequence[Group]], about: Circumstances, table_file: Path) -> str:
    body = ["<h1>Leaderboard</h1>", f'<p class="lead">{escape(_lead(groups))}</p>']
    sections: list[tuple[str, str, list[str]]] = [("measured", "What was measured", [facts(about.pairs), *_notes(about.notes)])]
    for tol, parts in groups.items():
        at = f" at {tolerance_name(tol)}" if len(groups) > 1 else ""
        last = {name: [g for g in parts if (g.name == ALL) == (name == ALL)] for name in (ALL, "")}
        unsolvable = [g for g in last[""] if g.solvable is False]
        sections.append((f"overview-{tolerance_name(tol)}", "Overview" + at, [table(*overview(parts, about.first, about.clock))]))
        sections.append((f"every-{tolerance_name(tol)}", "Every solver" + at, [table(*every_solver(parts, about.clock))]))
        for anchor, title, chosen in (
            ("all", "All problems", last[ALL]),
            ("groups", "By family and folder", [g for g in last[""] if g.solvable is not False]),
            ("none", "Problems without a solution", unsolvable),
        ):
            html = [piece for group in chosen for piece in _group(group, about.clock)]
            if html:
                sections.append((f"{anchor}-{tolerance_name(tol)}", title + at, html))
        missed = failures(parts)
        html = [facts(missed)] if missed else ["<p>Every solver solved every problem that has a solution.</p>"]
        sections.append((f"fails-{tolerance_name(tol)}", "Who fails" + at, html))
    uri = data_uri("text/csv", table_file.read_bytes())
    listed = "".join(f"<li>{escape(text)}</li>" for text in _definitions(about.clock))
    sections += [
        ("columns", "What the columns say", [f"<ul>{listed}</ul>"]),
        (
            "repeat",
            "How to repeat",
            [
                f"<pre><code>{escape(about.command)}</code></pre>",
                "<p>What is in the folder already is not measured again. Ratios of times carry over to another machine roughly, times do "
                "not, nor which solves end at the time limit.</p>",
                f'<p class="screen">The table behind this page: <a download="{table_file.name}" href="{uri}">{table_file.name}</a>.</p>',
            ],
        ),
    ]
    body.append("<nav><ul>" + "".join(f'<li><a href="#{anchor}">{escape(name)}</a></li>' for anchor, name, _ in sections) + "</ul></nav>")
    for anchor, name, html in sections:
        body += [f'<section id="{anchor}">', f"<h2>{escape(name)}</h2>", *html, "</section>"]
    return page("Leaderboard", body)


def _notes(notes: Iterable[str]) -> list[str]:
    return [f'<p class="note">{escape(note)}</p>' for note in notes]


def _group(group: Group, clock: str) -> list[str]:
    header, rows = group_table(group, clock)
    html = [f"<h3>{escape(heading(group))}</h3>", f"<p>{escape(_said(group))}</p>", table(header, rows)]
    names = group.solvers_of_all
    if group.solvable is False or len(group.problems) < 2 or not names:
        return html  # one problem has no profile that says more than its table
    comparison = compare(group.measurements, Selection(tols=[group.tol], solvers=names, clock=clock))
    with matplotlib().rc_context(STYLE):
        drawing = profile_figure(comparison.parts[0])
    words = f"Performance profiles on {group.name}, {group.dimension}D, at {tolerance_name(group.tol)}: the figures of the table above"
    return [*html, drawn(drawing, words)]


def markdown(groups: Mapping[float, Sequence[Group]], about: Circumstances) -> str:
    """All tables as Markdown: those of all problems first."""
    lines = [f"    {about.command}", "", *(f"* {name}: {text}" for name, text in about.pairs), *(f"* {note}" for note in about.notes), ""]
    for tol, parts in groups.items():
        at = f" at {tolerance_name(tol)}" if len(groups) > 1 else ""
        lines += [f"## Overview{at}", "", *markdown_table(*overview(parts, about.first, about.clock)), ""]
        lines += [f"## Every solver{at}", "", *markdown_table(*every_solver(parts, about.clock)), ""]
        for group in sorted(parts, key=lambda g: (g.name != ALL, g.solvable is False)):
            header, rows = group_table(group, about.clock)
            lines += [f"## {heading(group)}{at}", "", _said(group), "", *markdown_table(header, rows), ""]
        lines += [f"## Who fails{at}", "", *(f"* {who}: {what}" for who, what in failures(parts)), ""]
    return "\n".join([*lines, *(f"* {text}" for text in _definitions(about.clock))]) + "\n"
