"""`auto` beside named methods on families of made problems and on FCLIB files: the judgement of docs/measures/auto_beside_named.md.

    python benchmarks/auto.py --out judged.jsonl --seeds 1551 1552 --sizes 300 600 --tols 1e-4 1e-8
    python benchmarks/auto.py --out judged.jsonl --seeds 1553 --sizes 2000 --tols 1e-4 --families rocks boxes
    python benchmarks/auto.py --out files.jsonl --files FOLDER --tols 1e-8
    python benchmarks/auto.py --out judged.jsonl --print          the tables of what is there, nothing is solved

Each solve begins from a problem that nothing has been derived from yet, with code that is loaded, and is measured and stopped by processor
time: `auto` after `--limit`, a named method after three times what `auto` took, 2 s at the most (1.2 s where `auto` did not arrive). Short
solves are the least of up to three. One line of JSON a solve: a run that was cut goes on where it was.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy is loaded

import argparse
import copy
import json
import math
import time
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table, box

from fcsim.bench.families import FAMILIES, problems
from fcsim.export_fclib import read_fclib
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.solvers import solve
from fcsim.solvers.base import Monitor

NAMED = (*("NSGS-AC", "NNCG", "NSN-AC", "NSN-AC-HYBRID", "PROX-NEWTON", "PROX-PATH", "PPA-NSN-AC", "ADMM", "ADMM-SPECTRAL", "IPM-COULOMB"),)
SOLVABLE = [name for name, family in FAMILIES.items() if family.solvable is not False]
TIMES, LONGEST, WHERE_UNSOLVED, SHORTEST = 3.0, 2.0, 1.2, 0.005
"""Times what `auto` took that a named method gets, its seconds at the most, those where `auto` did not arrive, and at the least."""
SHORT, MIDDLING = 0.1, 0.4
"""Seconds below which a solve is measured three times, and twice."""
ABOVE = 0.01
"""Seconds that `auto` takes from which single ratios count."""


class Budget:
    """Processor time of the solve at hand, in the place of the clock that monitors look at: beside other work the clock says little."""

    end = float("inf")

    @classmethod
    def used_up(cls) -> bool:
        return time.process_time() > cls.end


@dataclass(frozen=True)
class Case:
    """family, name: of the problem; path: of an FCLIB file, or None; size, seed: of a made problem."""

    family: str
    name: str
    path: Path | None = None
    size: int = 0
    seed: int = 0

    def made(self) -> GlobalProblem | LocalProblem | None:
        """The problem; None where the file holds one with rolling friction, which no named method of these solves."""
        problem = problems(self.family, self.size, self.seed) if self.path is None else read_fclib(self.path).problem
        return problem if isinstance(problem, GlobalProblem | LocalProblem) else None


def cases(arguments: argparse.Namespace) -> Iterator[Case]:
    """The problems that are asked for, family by family."""
    for folder in arguments.files or ():
        for path in sorted(folder.rglob("*.hdf5")):
            yield Case(folder.name, str(path.relative_to(folder).with_suffix("")), path)
    for family in arguments.families if arguments.seeds else ():
        for size in arguments.sizes:
            for seed in arguments.seeds:
                yield Case(family, f"{family}:{size}:{seed}", size=size, seed=seed)


def once(problem: GlobalProblem | LocalProblem, method: str, tol: float, limit: float) -> tuple[str, float, int]:
    """Status, processor time [s] and iterations of one solve, stopped between iterations after `limit` seconds of the processor."""
    problem = copy.deepcopy(problem)
    begun = time.process_time()
    Budget.end = begun + limit
    result = solve(problem, method, tol=tol)
    return result.status.name, time.process_time() - begun, result.iterations


def measured(problem: GlobalProblem | LocalProblem, method: str, tol: float, limit: float) -> tuple[str, float, int]:
    """The least of up to three solves that arrive. `auto` is asked twice at least: the first may have loaded code of a stage that no other
    problem needed, half a second of it."""
    best = once(problem, method, tol, limit)
    for below in (math.inf if method == "auto" else MIDDLING, SHORT):
        if best[1] < below and (best[0] == "SOLVED" or method == "auto"):
            again = once(problem, method, tol, limit)
            best = min(best, again, key=lambda run: (run[0] != "SOLVED", run[1]))
    return best


def loaded(case: Case, problem: GlobalProblem | LocalProblem, methods: tuple[str, ...], tol: float, ready: set[tuple[object, ...]]) -> None:
    """Every method once, so that its code is compiled and loaded: on a problem of the same family that is not judged; a folder's files are
    of many kinds, so each file is solved by `auto`, whose stages depend on the problem, and the first of each kind by the others."""
    kind = (case.family, tol, type(problem), problem.dimension)
    if case.path is not None:
        todo = [method for method in methods if method == "auto" or kind not in ready]
    else:
        todo = [] if kind in ready else list(methods)
        problem = Case(case.family, "", size=min(case.size, 150), seed=0).made() or problem
    for method in todo:
        once(problem, method, tol, LONGEST)
    ready.add(kind)


def judge(arguments: argparse.Namespace, rows: list[dict[str, object]]) -> None:
    """Solve what is missing in `rows` and write a line each."""
    done = {(row["problem"], row["tol"], row["method"]): row for row in rows}
    ready: set[tuple[object, ...]] = set()
    with arguments.out.open("a", encoding="utf-8") as file:
        for case in cases(arguments):
            for tol in arguments.tols:
                methods = [method for method in ("auto", *arguments.methods) if (case.name, tol, method) not in done]
                if not methods:
                    continue
                problem = case.made()
                if problem is None or not problem.nc:
                    continue
                loaded(case, problem, ("auto", *arguments.methods), tol, ready)
                for method in methods:
                    limit = arguments.limit if method == "auto" else _limit(done[case.name, tol, "auto"])
                    status, seconds, iterations = measured(problem, method, tol, limit)
                    row: dict[str, object] = {"family": case.family, "problem": case.name, "contacts": problem.nc, "tol": tol}
                    row |= {"method": method, "status": status, "seconds": round(seconds, 6), "iterations": iterations}
                    done[case.name, tol, method] = row
                    rows.append(row)
                    file.write(json.dumps(row) + "\n")
                    file.flush()


def _limit(auto: dict[str, object]) -> float:
    """Seconds that a named method gets beside this row of `auto`."""
    if auto["status"] != "SOLVED":
        return WHERE_UNSOLVED
    return min(max(TIMES * float(str(auto["seconds"])), SHORTEST), LONGEST)


@dataclass(frozen=True)
class Judged:
    """A family at one tolerance. problems: {problem: {method: seconds, where it arrived}}."""

    problems: dict[str, dict[str, float]]

    def solved(self) -> dict[str, dict[str, float]]:
        """Those that `auto` solved."""
        return {name: found for name, found in self.problems.items() if "auto" in found}

    def family(self) -> tuple[float, str] | None:
        """Sum of `auto` over that of the one named method with the least among those that solved all that it solved."""
        solved = self.solved().values()
        sums = [(sum(found[name] for found in solved), name) for name in NAMED if solved and all(name in found for found in solved)]
        if not sums:
            return None
        least, name = min(sums)
        return sum(found["auto"] for found in solved) / least, name

    def each(self) -> list[tuple[float, float, str, str]]:
        """(seconds of `auto`, least seconds of a named method, its name, the problem) of those that both solved."""
        pairs = []
        for problem, found in self.solved().items():
            named = [(seconds, name) for name, seconds in found.items() if name != "auto"]
            if named:
                pairs.append((found["auto"], *min(named), problem))
        return pairs

    def cells(self) -> list[str]:
        """solved, ms, family, each, worst, as in docs/measures/auto_beside_named.md."""
        family, each = self.family(), self.each()
        long = [(auto / least, name, problem) for auto, least, name, problem in each if auto > ABOVE]
        ratio, name, problem = max(long, default=(0.0, "", ""))
        return [
            f"{len(self.solved())} of {len(self.problems)}",
            f"{1e3 * sum(found['auto'] for found in self.solved().values()):.0f}",
            "-" if family is None else f"{family[0]:.1f} ({family[1]})",
            f"{sum(pair[0] for pair in each) / sum(pair[1] for pair in each):.1f}" if each else "-",
            f"{ratio:.1f} ({name}, {problem})" if long else "-",
        ]

    def missed(self) -> list[str]:
        """Problems that a named method solved and `auto` did not, and those that nobody solved."""
        lines = []
        for problem, found in self.problems.items():
            if "auto" not in found:
                who = ", ".join(f"{name} {1e3 * seconds:.0f} ms" for name, seconds in sorted(found.items(), key=lambda item: item[1]))
                lines.append(f"{problem}: not solved by auto; {who or 'by no named method either'}")
        return lines


def tables(rows: list[dict[str, object]], console: Console, markdown: bool) -> None:
    """One table a tolerance and size, and what `auto` did not solve."""
    groups: dict[tuple[str, str], dict[str, dict[str, dict[str, float]]]] = defaultdict(lambda: defaultdict(dict))
    for row in rows:
        size = "2000 contacts and more" if int(str(row["contacts"])) > 1000 else "up to 1000 contacts"
        found = groups[f"{row['tol']:g}", size][str(row["family"])].setdefault(str(row["problem"]), {})
        if row["status"] == "SOLVED":
            found[str(row["method"])] = float(str(row["seconds"]))
    for (tol, size), families in sorted(groups.items()):
        table = Table(title=f"{tol}, {size}", box=box.MARKDOWN if markdown else box.SIMPLE)
        for column in ("family", "solved", "ms", "family", "each", "worst"):
            table.add_column(column, no_wrap=True)
        judged = {family: Judged(found) for family, found in families.items()}
        for family, one in judged.items():
            table.add_row(family, *one.cells())
        console.print(table)
        for one in judged.values():
            for line in one.missed():
                console.print(line, highlight=False)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="file of JSON lines, gone on with where it exists")
    parser.add_argument("--families", nargs="+", default=SOLVABLE, choices=SOLVABLE, metavar="FAMILY")
    parser.add_argument("--sizes", type=int, nargs="+", default=[300, 600], help="contacts, about")
    parser.add_argument("--seeds", type=int, nargs="+", default=[], help="of the made problems; none: only files")
    parser.add_argument("--tols", type=float, nargs="+", default=[1e-4, 1e-8])
    parser.add_argument("--files", type=Path, nargs="+", help="folders of FCLIB files, each a family of its own")
    parser.add_argument("--methods", nargs="*", default=NAMED, metavar="METHOD", help="named methods beside auto; nothing after it: none")
    parser.add_argument("--limit", type=float, default=3.0, help="seconds of the processor that auto gets")
    parser.add_argument("--print", action="store_true", dest="only_print", help="no solve, the tables of what is there")
    parser.add_argument("--markdown", action="store_true", help="tables in Markdown")
    arguments = parser.parse_args()
    if unknown := [name for name in arguments.methods if name not in NAMED]:
        parser.error(f"--methods: expected some of {', '.join(NAMED)}, got {' '.join(unknown)}")
    Monitor.out_of_time = lambda monitor: Budget.used_up()  # type: ignore[method-assign]
    rows: list[dict[str, object]] = []
    if arguments.out.exists():
        rows = [json.loads(line) for line in arguments.out.read_text(encoding="utf-8").splitlines() if line.endswith("}")]
    if not arguments.only_print:
        judge(arguments, rows)
    tables(rows, Console(width=140), arguments.markdown)


if __name__ == "__main__":
    main()
