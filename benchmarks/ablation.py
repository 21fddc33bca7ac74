"""`auto` with each of its stages left out, and beside named methods, on FCLIB files and on the families of synthetic problems.

    python benchmarks/ablation.py --out ablation.csv [--fclib FOLDER] [--sizes 60 240] [--seeds 0] [--limit 5]
    python benchmarks/ablation.py --out beside.csv --beside 5 [...]

Writes a row a solve (processor time, the least of three) and prints two Markdown tables, those of docs/measures/auto_beside_named.md.
A stage that no problem needs has no place in `auto`: without it as many are solved, in no more time. With `--beside` no stage is left out,
and a named method gets so many times the seconds that `auto` took, 0.1 at least: enough to see who is faster, on more problems.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from fcsim.bench.families import FAMILIES, problems
from fcsim.export_fclib import read_fclib
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.problem.reduction import reduce
from fcsim.solvers import solve
from fcsim.solvers.automatic.stages import STAGES

NAMED = ("NSGS-AC", "NNCG", "NSGS-AA", "NSN-AC", "PROX-NEWTON", "PPA-NSN-AC", "ADMM")
RACE = "the race alone"
"""`auto` without the compiled front door of small problems, which no option passes: what stages are measured against."""
VARIANTS = {RACE: (), **{f"without {stage.name}": (stage.name,) for stage in STAGES}}
ALL = ("auto", *NAMED, *VARIANTS)
TWICE_BELOW, LOADING = 0.2, 5.0
"""Seconds below which a solve is measured three times, up to which twice: the first may have to load or compile code."""


def sets(arguments: argparse.Namespace) -> Iterator[tuple[str, str, LocalProblem]]:
    """(family, name, problem in local form)."""
    for path in sorted(arguments.fclib.glob("*.hdf5")) if arguments.fclib else ():
        problem = read_fclib(path).problem
        if isinstance(problem, GlobalProblem | LocalProblem) and problem.nc:
            yield "FCLIB files", path.stem, problem if isinstance(problem, LocalProblem) else reduce(problem).local
    for family in FAMILIES:
        for size in arguments.sizes:
            for seed in arguments.seeds:
                problem = problems(family, size, seed)
                yield family, f"{family}:{size}:{seed}", problem if isinstance(problem, LocalProblem) else reduce(problem).local


def measured(problem: LocalProblem, variant: str, limit: float) -> tuple[str, float]:
    """Status and processor time [s]; a problem proven to have no solution counts as answered."""
    seconds = float("inf")
    for attempt in range(3):
        begun = time.process_time()
        if variant in VARIANTS:
            result = solve(problem, "auto", time_limit=limit, without=VARIANTS[variant])
        else:
            result = solve(problem, variant, time_limit=limit)
        seconds = min(seconds, time.process_time() - begun)
        if seconds > LOADING or (attempt and seconds > TWICE_BELOW):
            break
    return result.status.name, seconds


def tables(rows: list[dict[str, str]]) -> str:
    """Two Markdown tables from the rows: stages left out, and auto beside the best named method of each problem."""
    by_problem: dict[tuple[str, str], dict[str, tuple[bool, float]]] = defaultdict(dict)
    for row in rows:
        answered = row["status"] in ("SOLVED", "INFEASIBLE")
        by_problem[row["family"], row["problem"]][row["variant"]] = answered, float(row["seconds"])
    lines = ["| | answered | seconds | slowest against the race |", "|---|---|---|---|"]
    for variant in ("auto", *VARIANTS):
        found = [problem for problem in by_problem.values() if variant in problem and RACE in problem]
        count = sum(problem[variant][0] for problem in found)
        ratios = [problem[variant][1] / problem[RACE][1] for problem in found if problem[variant][0] and problem[RACE][1] > 1e-2]
        total = sum(problem[variant][1] for problem in found)
        lines.append(f"| {variant} | {count} of {len(found)} | {total:.1f} | {max(ratios, default=1.0):.1f} |")
    if not any(RACE in problem for problem in by_problem.values()):
        lines = []
    head = [
        "family",
        "problems",
        "auto",
        "s",
        *NAMED,
        "auto over best named, sum",
        "worst above 10 ms",
        "above 5",
        "over the best single method",
    ]
    lines += ["", "| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for family in dict.fromkeys(family for family, _ in by_problem):
        found = [problem for (name, _), problem in by_problem.items() if name == family]
        solved = [str(sum(problem[name][0] for problem in found)) for name in ("auto", *NAMED)]
        both = []
        for problem in found:
            best = min((problem[name][1] for name in NAMED if problem[name][0]), default=None)
            if best is not None and problem["auto"][0]:
                both.append((problem["auto"][1], best))
        ratio = f"{sum(a for a, _ in both) / sum(b for _, b in both):.1f}" if both else "-"
        worst = max((a / b for a, b in both if max(a, b) > 1e-2), default=None)
        far = sum(a > 5 * b for a, b in both if max(a, b) > 1e-2)
        spent = sum(problem["auto"][1] for problem in found)
        answered_by_auto = [problem for problem in found if problem["auto"][0]]
        single = min(
            (
                (sum(problem[name][1] for problem in answered_by_auto), name)
                for name in NAMED
                if answered_by_auto and all(problem[name][0] for problem in answered_by_auto)
            ),
            default=None,
        )
        over = "-" if single is None else f"{sum(problem['auto'][1] for problem in answered_by_auto) / single[0]:.1f} ({single[1]})"
        worst_ratio = "-" if worst is None else f"{worst:.1f}"
        cells = [family, str(len(found)), solved[0], f"{spent:.2f}", *solved[1:], ratio, worst_ratio, str(far), over]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="CSV file, gone on with where it exists")
    parser.add_argument("--fclib", type=Path, help="folder of FCLIB files")
    parser.add_argument("--sizes", type=int, nargs="+", default=[60, 240])
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--limit", type=float, default=5.0, help="seconds a solve")
    parser.add_argument("--beside", type=float, help="no stage left out; named methods get so many times what auto took")
    arguments = parser.parse_args()
    fields = ("family", "problem", "nc", "variant", "status", "seconds")
    rows: list[dict[str, str]] = []
    if arguments.out.exists():
        with arguments.out.open(encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    done = {(row["problem"], row["variant"]) for row in rows}
    with arguments.out.open("a", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, fields)
        if not rows:
            writer.writeheader()
        variants, loaded = ALL if arguments.beside is None else ("auto", *NAMED), False
        for family, name, problem in sets(arguments):
            limit = arguments.limit
            missing = [variant for variant in variants if (name, variant) not in done]
            for variant in missing if not loaded else ():  # once, so that no measured solve compiles code for longer than LOADING
                measured(problem, variant, 60.0)
                loaded = True
            for variant in missing:
                status, seconds = measured(problem, variant, limit)
                if variant == "auto" and arguments.beside is not None:
                    limit = min(limit, max(0.1, arguments.beside * seconds))
                row = dict(zip(fields, (family, name, str(problem.nc), variant, status, f"{seconds:.5f}"), strict=True))
                rows.append(row)
                writer.writerow(row)
                file.flush()
    print(tables(rows))


if __name__ == "__main__":
    main()
