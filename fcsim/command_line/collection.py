"""fcsim collection build | select | check."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

EXIT_OK, EXIT_FAILED = 0, 1

Progress = Callable[[str, int, int], None]


def add_parsers(commands: Any) -> None:
    """Add `collection` and its three commands to the command line."""
    collection = commands.add_parser(
        "collection",
        help="make, select and check collections of FCLIB problems",
        description="Collections of FCLIB problems: made from a case or a run, graded selections, verification.",
    )
    actions = collection.add_subparsers(dest="action", required=True, metavar="ACTION")

    build = actions.add_parser("build", help="write the problems of a run, or of a case that is run, as a collection")
    build.add_argument(
        "source", type=Path, metavar="RUN_DIR|CASE", help="folder of a run with FCLIB files, or a case: its folder or script"
    )
    build.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the collection")
    build.add_argument("--every", type=int, default=1, metavar="K", help="keep every K-th step (default 1)")
    build.add_argument("--steps", type=int, help="number of steps of the case")
    build.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE", dest="assignments", help="change a parameter of the case"
    )
    build.add_argument("--authors", default="", help="for the README")
    _add_common(build)
    build.set_defaults(act=_build)

    select = actions.add_parser("select", help="copy problems of graded difficulty from a folder of FCLIB files")
    select.add_argument("directory", type=Path, metavar="DIR", help="a collection, or any folder of *.hdf5")
    select.add_argument("--out", type=Path, required=True, metavar="DIR2", help="folder of the selection")
    select.add_argument("--count", type=int, default=50, help="number of problems (default 50)")
    select.add_argument("--by", choices=("iterations",), default="iterations", help="difficulty: iterations of the solver from r = 0")
    select.add_argument("--solver", default="NSN-AC", help="whose iterations (default NSN-AC; see fcsim solvers)")
    select.add_argument("--tol", type=float, default=1e-8, help="to this error (default 1e-8)")
    select.add_argument("--time-limit", type=float, default=100.0, metavar="SECONDS", help="of each solve (default 100)")
    select.add_argument("--seed", type=int, default=0, help="of the choice among equals (default 0)")
    _add_common(select)
    select.set_defaults(act=_select)

    check = actions.add_parser("check", help="read every file again and verify it; exit code 1 where one fails")
    check.add_argument("directory", type=Path, metavar="DIR", help="a collection, or any folder of *.hdf5")
    check.set_defaults(act=_check)


def _add_common(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--spectrum-up-to", type=int, default=3000, metavar="M", help="contact unknowns up to which W's rank and condition are computed"
    )
    parser.add_argument("--overwrite", action="store_true", help="replace an earlier collection")


@contextmanager
def _bar() -> Iterator[Progress | None]:
    """A progress bar on the terminal, where there is one and rich is installed."""
    try:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    except ImportError:
        yield None
        return
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        MofNCompleteColumn(),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as bar:
        tasks: dict[str, Any] = {}

        def report(what: str, done: int, total: int) -> None:
            if what not in tasks:
                tasks[what] = bar.add_task(what, total=total)
            bar.update(tasks[what], completed=done)

        yield report


def _build(options: argparse.Namespace) -> int:
    from fcsim.collection.build import build_collection
    from fcsim.collection.readme import one_a_problem
    from fcsim.command_line.main import _assignments

    assignments = _assignments(options.assignments)
    if options.steps is not None:
        assignments["steps"] = str(options.steps)
    with _bar() as progress:
        built = build_collection(
            options.source,
            options.out,
            every=options.every,
            assignments=assignments,
            authors=options.authors,
            spectrum_up_to=options.spectrum_up_to,
            overwrite=options.overwrite,
            progress=progress,
            watch=None if progress is None else lambda case, step: progress("steps", step.number, case.simulation.steps),
        )
    _tell(built.notes)
    print(f"{len(one_a_problem(built.entries))} problems, {len(built.entries)} files: {built.directory} (README.md, manifest.csv)")
    return EXIT_OK if built.complete else EXIT_FAILED


def _select(options: argparse.Namespace) -> int:
    from fcsim.collection.readme import one_a_problem
    from fcsim.collection.select import select_problems

    with _bar() as progress:
        selection = select_problems(
            options.directory,
            options.out,
            count=options.count,
            solver=options.solver,
            tol=options.tol,
            time_limit=options.time_limit,
            seed=options.seed,
            spectrum_up_to=options.spectrum_up_to,
            overwrite=options.overwrite,
            progress=progress,
        )
    _tell(selection.notes)
    rows = one_a_problem(selection.entries)
    unsolved = sum(row.status != "SOLVED" for row in rows)
    low, high = min(row.iterations for row in rows), max(row.iterations for row in rows)
    print(
        f"{len(rows)} of {len(selection.graded)} problems, {low} to {high} iterations of {options.solver} from r = 0, {unsolved} unsolved: "
        f"{selection.directory} (README.md, manifest.csv)"
    )
    return EXIT_OK


def _check(options: argparse.Namespace) -> int:
    from fcsim.collection.check import check_collection

    with _bar() as progress:
        rows = check_collection(options.directory, progress)
    header = ("file", "nc", "n", "m", "error", "stated", "cone", "equations", "")
    table = [
        (
            row.place,
            *("-" if size is None else str(size) for size in (row.nc, row.n, row.m)),
            *("-" if value is None else f"{value:.1e}" for value in (row.error, row.stated, row.cone, row.equations)),
            "FAILED" if row.failures else row.note or "ok",
        )
        for row in rows
    ]
    widths = [max(len(line[k]) for line in (header, *table)) for k in range(len(header))]
    for line in (header, *table):
        print("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip())
    failed = [row for row in rows if row.failures]
    for row in failed:
        print(f"FAILED {row.place}: {'; '.join(row.failures)}")
    print(f"{len(rows)} files, {len(failed)} failed")
    return EXIT_FAILED if failed else EXIT_OK


def _tell(notes: Sequence[str]) -> None:
    for note in notes:
        print(f"note: {note}")
