"""fcsim collection build | compose | select | check."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fcsim.brief import counted
from fcsim.command_line.answers import answer
from fcsim.command_line.assignments import add_launcher, checked_tolerance, cluster_of, positive, read_assignments
from fcsim.command_line.terminal import Bar, print_table, say
from fcsim.errors import EXIT_NOT_CONVERGED, EXIT_OK

if TYPE_CHECKING:
    from fcsim.collection.select import Selection


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `collection` and its commands to the command line."""
    collection = commands.add_parser(
        "collection",
        help="make, select and check collections of FCLIB problems",
        description="Collections of FCLIB problems: made from a case or a run, or from several cases by a recipe, graded selections, "
        "verification.",
    )
    actions = collection.add_subparsers(dest="action", required=True, metavar="ACTION")

    build = actions.add_parser("build", help="write the problems of a run, or of a case that is run, as a collection")
    build.add_argument(
        "source",
        type=Path,
        metavar="RUN_DIR|CASE",
        help="folder of a run with FCLIB files, or a case: its folder or script, a name of `fcsim cases`",
    )
    build.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the collection")
    build.add_argument("--every", type=int, default=1, metavar="K", help="keep every K-th step (default 1)")
    build.add_argument("--steps", type=int, help="number of steps of the case")
    build.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE", dest="assignments", help="change a parameter of the case"
    )
    build.add_argument("--authors", default="", help="for the README (default: none)")
    add_launcher(build, "here, or in a job: of Slurm, or of submitit on this machine (slurm, jobs: --time-limit needed)")
    build.add_argument("--time-limit", type=float, metavar="SECONDS", help="of the job")
    build.add_argument("--memory-limit", type=float, metavar="MIB", help="of the job")
    _add_iterations(build)
    _add_common(build)
    build.set_defaults(act=_build)

    compose = actions.add_parser("compose", help="run the cases of a recipe and choose problems of graded difficulty from all of them")
    compose.add_argument("recipe", type=Path, metavar="RECIPE", help="a JSON file, as cases/nonlinear.json")
    compose.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the collection")
    compose.add_argument("--count", type=int, help="number of problems (default: the recipe's)")
    _add_iterations(compose)
    _add_common(compose)
    compose.set_defaults(act=_compose)

    select = actions.add_parser("select", help="copy problems of graded difficulty from a folder of FCLIB files")
    select.add_argument("directory", type=Path, metavar="DIR", help="a collection, or any folder of *.hdf5")
    select.add_argument("--out", type=Path, required=True, metavar="DIR2", help="folder of the selection")
    select.add_argument("--count", type=int, default=50, help="number of problems (default 50)")
    select.add_argument(
        "--by", choices=("iterations",), default="iterations", help="difficulty: iterations of the solver from r = 0 (default iterations)"
    )
    select.add_argument("--solver", default="NSN-AC", help="whose iterations (default NSN-AC; those of auto are of several methods)")
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
        "--spectrum-up-to",
        type=int,
        default=3000,
        metavar="M",
        help="contact unknowns up to which W's rank and condition are computed (default 3000)",
    )
    parser.add_argument("--overwrite", action="store_true", help="replace an earlier collection")


def _add_iterations(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--iterations", action="store_true", help="also the linearised problems that led to the last one of steps with nonlinear bodies"
    )


def _progress(bar: Bar) -> Callable[[str, int, int], None]:
    return lambda what, done, total: bar.update(done, total, what=what)


def _build(options: argparse.Namespace) -> int:
    from fcsim.collection.jobs import Build, build_by_job
    from fcsim.collection.readme import one_a_problem
    from fcsim.running.known_cases import case_place

    assignments = read_assignments(options.assignments)
    if options.steps is not None:
        assignments["steps"] = str(options.steps)
    for name in ("time_limit", "memory_limit"):
        if getattr(options, name) is not None:
            positive("--" + name.replace("_", "-"), getattr(options, name))
    cluster = cluster_of(options, seconds=options.time_limit, at_once=1, threads=1, memory=options.memory_limit)
    build = Build(
        source=str(options.source if cluster is None else case_place(options.source).resolve()),
        out=str(options.out if cluster is None else options.out.resolve()),
        time_limit=options.time_limit,
        memory_limit=options.memory_limit,
        every=options.every,
        assignments=assignments,
        iterations=options.iterations,
        authors=options.authors,
        spectrum_up_to=options.spectrum_up_to,
        overwrite=options.overwrite,
    )
    with Bar("problems", lines=0) as bar:
        if cluster is not None:
            built = build_by_job(build, cluster)
        else:
            built = build.here(
                progress=_progress(bar), watch=lambda case, step: bar.update(step.number, case.simulation.steps, what="steps")
            )
    problems, files = len(one_a_problem(built.entries)), len(built.entries)
    if not answer({"collection": built.directory, "problems": problems, "files": files, "complete": built.complete, "notes": built.notes}):
        _tell(built.notes)
        say(f"{counted(problems, 'problem')}, {counted(files, 'file')}: {built.directory} (README.md, manifest.csv)")
    return EXIT_OK if built.complete else EXIT_NOT_CONVERGED


def _select(options: argparse.Namespace) -> int:
    from fcsim.collection.select import select_problems

    checked_tolerance(options.tol)
    with Bar("problems", lines=0) as bar:
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
            progress=_progress(bar),
        )
    _say_of(selection, options.solver)
    return EXIT_OK


def _compose(options: argparse.Namespace) -> int:
    from fcsim.collection.compose import compose_collection, read_recipe

    with Bar("problems", lines=0) as bar:
        selection, complete = compose_collection(
            options.recipe,
            options.out,
            count=options.count,
            iterations=options.iterations,
            spectrum_up_to=options.spectrum_up_to,
            overwrite=options.overwrite,
            progress=_progress(bar),
            watch=lambda case, step: bar.update(step.number, case.simulation.steps, what=case.name),
        )
    _say_of(selection, read_recipe(options.recipe).solver)
    return EXIT_OK if complete else EXIT_NOT_CONVERGED


def _say_of(selection: Selection, solver: str) -> None:
    """What a selection holds, on the terminal or in the answer in JSON."""
    from fcsim.collection.readme import one_a_problem

    rows = one_a_problem(selection.entries)
    unsolved = sum(row.status != "SOLVED" for row in rows)
    low, high = min(row.iterations for row in rows), max(row.iterations for row in rows)
    sizes = {"problems": len(rows), "of": len(selection.graded), "unsolved": unsolved, "solver": solver, "iterations": [low, high]}
    if answer({"collection": selection.directory, **sizes, "notes": selection.notes}):
        return
    _tell(selection.notes)
    say(
        f"{len(rows)} of {counted(len(selection.graded), 'problem')}, {low} to {high} iterations of {solver} from r = 0, "
        f"{unsolved} unsolved: {selection.directory} (README.md, manifest.csv)"
    )


def _check(options: argparse.Namespace) -> int:
    from fcsim.collection.check import check_collection

    with Bar("problems", lines=0) as bar:
        rows = check_collection(options.directory, _progress(bar))
    failed = [row for row in rows if row.failures]
    if answer({"collection": options.directory, "files": rows, "failed": len(failed)}):
        return EXIT_NOT_CONVERGED if failed else EXIT_OK
    header = ("file", "nc", "n", "m", "error", "stated", "cone", "equations", "verdict")
    table = [
        (
            row.place,
            *("-" if size is None else str(size) for size in (row.nc, row.n, row.m)),
            *("-" if value is None else f"{value:.1e}" for value in (row.error, row.stated, row.cone, row.equations)),
            "FAILED" if row.failures else row.note or "ok",
        )
        for row in rows
    ]
    print_table(header, table)
    for row in failed:
        say(f"FAILED {row.place}: {'; '.join(row.failures)}")
    say(f"{counted(len(rows), 'file')}, {len(failed)} failed")
    return EXIT_NOT_CONVERGED if failed else EXIT_OK


def _tell(notes: Sequence[str]) -> None:
    for note in notes:
        say(f"note: {note}")
