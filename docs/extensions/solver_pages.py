"""The catalogue of solvers, from `fcsim.solvers.SOLVERS` and the measurements that docs/solver_table.md holds."""

import re
from collections import defaultdict
from pathlib import Path

from solver_formulas import formulas, in_words

TABLE = Path(__file__).resolve().parents[1] / "solver_table.md"
UNITS = {"s": 1.0, "ms": 1e-3, "µs": 1e-6}
WITHIN = 1.1
"""Times the fastest: as fast, for a clock on a shared machine."""


def _cells(line):
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def measured(text):
    """({method: {tolerance: (solved, of)}}, {tolerance: {(problem, form, contacts): {method: seconds}}}) of the table's Markdown."""
    counts, times, tolerance, header = defaultdict(dict), defaultdict(lambda: defaultdict(dict)), None, []
    for line in text.splitlines():
        if found := re.match(r"## Error at most (\S+)", line):
            tolerance = float(found[1])
        if not line.startswith("|"):
            header = []
            continue
        cells = _cells(line)
        if not header:
            header = cells
        elif header[0] == "method" and "solved" in line + " ".join(header) and " of " in cells[2]:
            for k, name in enumerate(header):
                if found := re.match(r"solved at (\S+)", name):
                    solved, of = cells[k].split(" of ")
                    counts[cells[0]][float(found[1])] = (int(solved), int(of))
        elif header[0] == "problem" and tolerance is not None and ":---" not in line:
            for name, cell in zip(header[3:], cells[3:], strict=True):
                if found := re.match(r"([\d.]+) (s|ms|µs) \(", cell):
                    times[tolerance][cells[0], cells[1], int(cells[2])][name] = float(found[1]) * UNITS[found[2]]
    return counts, times


def where_it_wins(name, times):
    """A sentence: the problems that a method solved as fast as any but `auto`, per tolerance."""
    said = []
    for tolerance, problems in sorted(times.items(), reverse=True):
        won = []
        for (problem, form, contacts), of in problems.items():
            rivals = [seconds for other, seconds in of.items() if other != "auto"]
            if name in of and rivals and of[name] <= WITHIN * min(rivals):
                won.append(f"{problem} ({form}, {contacts})")
        shown = ", ".join(won[:4]) + (", …" if len(won) > 4 else "")
        said.append(f"at {tolerance:g} {len(won)} of {len(problems)}" + (f": {shown}" if won else ""))
    return "; ".join(said)


def page():
    """The page as Markdown."""
    from fcsim.command_line.solvers import _described
    from fcsim.solvers import ALIASES, SOLVERS

    counts, times = measured(TABLE.read_text(encoding="utf-8"))
    lines = [
        "# The catalogue of solvers", "",
        f"All {len(SOLVERS)} methods, generated from the table that `solve`, `fcsim solvers` and the conformance tests use (`fcsim/solvers/table.py`);",
        "symbols as in [the formulation](../theory/formulation.md). Which to take: [the guide](../guides/choose_a_solver.md). *Where it wins* counts the",
        "problems of [the measured table](../solver_table.md) on which a method took at most 1.1 times the time of the fastest (`auto`, which chooses",
        "among them, left out); the first four are named with form and contacts.", "",
    ]  # fmt: skip
    for family in dict.fromkeys(method.family for method in SOLVERS.values()):
        lines += [f"## {family[:1].upper() + family[1:]}", ""]
        for name, method in SOLVERS.items():
            if method.family != family:
                continue
            lines += [f"### {name}", ""]
            for formula in formulas(method):
                lines += ["$$", formula, "$$", ""]
            aliases = [alias for alias, meant in ALIASES.items() if meant == name]
            solved = ", ".join(f"{a} of {b} at {tol:g}" for tol, (a, b) in counts.get(name, {}).items())
            facts = [
                ("", in_words(method)),
                ("source", method.source),
                ("dimension", ", ".join({2: "2D", 3: "3D", 5: "rolling", 6: "rolling and spinning"}[d] for d in method.dimensions)),
                ("also called", ", ".join(aliases)),
                ("in Siconos", f"`{method.siconos}`" if method.siconos else ""),
                ("limits", method.limits),
                ("solved", solved or "not in the measured table"),
                ("where it wins", where_it_wins(name, times) if name in counts and name != "auto" else ""),
                ("options", f"`{_described(method.options)}`"),
            ]
            lines += [f"* {label}: {text}" if label else f"* {text}" for label, text in facts if text]
            lines += [""]
    return "\n".join(lines)
