"""fcsim run: a case into a folder of results, with a bar while it runs and a table of its time at the end."""

from __future__ import annotations

import argparse
import inspect
import shlex
from contextlib import nullcontext
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING

from fcsim.command_line.answers import answer, current
from fcsim.command_line.assignments import add_plugin_option, checked_tolerance, given_by_options, read_assignments
from fcsim.command_line.compiling import saying_so
from fcsim.command_line.progress import show_step
from fcsim.command_line.terminal import Bar, print_table, say
from fcsim.errors import EXIT_INTERRUPTED, EXIT_NOT_CONVERGED, EXIT_OK
from fcsim.memory import any_size

if TYPE_CHECKING:
    from collections.abc import Mapping

    from fcsim.running.case import CaseScript
    from fcsim.running.run import Summary

_FORMS = {"global": ("global",), "local": ("local",), "both": ("global", "local")}


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command `run`."""
    run = commands.add_parser("run", help="run a case", description="Run a case script and write its results into a folder.")
    run.add_argument("case", help="a case: its folder or script, a name of `fcsim cases`, or a masonry problem in JSON")
    run.add_argument("--steps", type=int, help="number of steps (default: the case's)")
    run.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        dest="assignments",
        help="change a parameter; may be repeated",
    )
    run.add_argument("--out", type=Path, help="folder of the results (default: results/CASE)")
    run.add_argument("--solver", help="solver of every step (see fcsim solvers; default: the case's)")
    run.add_argument("--tol", type=float, help="tolerance on the error of every step, relative (default: the case's)")
    run.add_argument("--export-every", type=int, metavar="K", help="write an FCLIB file every K steps, 0 = none (default 10)")
    run.add_argument(
        "--export-iterations",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="of steps with nonlinear bodies write all problems of Newton's method, not the last alone",
    )
    run.add_argument("--export-form", choices=tuple(_FORMS), help="form of the FCLIB files (default global)")
    run.add_argument("--vtk-every", type=int, metavar="K", help="write VTK files every K steps, 0 = none (default 10)")
    run.add_argument("--checkpoint-every", type=int, metavar="K", help="steps between checkpoints (default 20)")
    run.add_argument(
        "--witness-every", type=int, metavar="K", help="measure the bodies' overlap every K steps, 0 = never (default: the case's)"
    )
    run.add_argument(
        "--witness-tolerance", type=float, metavar="SHARE", help="overlap borne, of the smaller body's size (default: the case's)"
    )
    run.add_argument("--resume", action="store_true", help="go on with the interrupted run in the folder of the results, by its options")
    run.add_argument("--accept-changes", action="store_true", help="resume also where script, meshes, tables or versions have changed")
    run.add_argument("--overwrite", action="store_true", help="replace an earlier run's results")
    run.add_argument("--any-size", action="store_true", help="begin also what the free memory does not seem to hold")
    run.add_argument("--parameters", action="store_true", help="list the case's parameters and stop")
    add_plugin_option(run)
    run.set_defaults(act=_run)


def _run(options: argparse.Namespace) -> int:
    from fcsim.campaign.named_case import named_case
    from fcsim.running.run import run_case
    from fcsim.solvers.plugins import load_plugins

    load_plugins(options.plugin)
    here = Path.cwd()  # a script may go elsewhere
    script = named_case(options.case)
    assignments = read_assignments(options.assignments)
    if options.tol is not None and options.tol >= 0:
        checked_tolerance(options.tol)
    assignments |= given_by_options(options, script)
    if options.parameters:
        _list_parameters(script, assignments)
        return EXIT_OK
    directory = options.out or Path("results") / script.name
    given = {
        "export_every": options.export_every,
        "export_forms": _FORMS.get(options.export_form),
        "export_iterations": options.export_iterations,
        "vtk_every": options.vtk_every,
        "checkpoint_every": options.checkpoint_every,
        "witness_every": options.witness_every,
        "witness_tolerance": options.witness_tolerance,
    }
    with any_size() if options.any_size else nullcontext(), Bar("step") as bar, saying_so(bar.say):
        summary = run_case(
            script,
            assignments,
            here / directory,
            {name: value for name, value in given.items() if value is not None},
            resume=options.resume,
            overwrite=options.overwrite,
            accept_changes=options.accept_changes,
            announce=bar.say,
            watch=lambda case, step: show_step(bar, case.simulation.steps, step),
        )
    _print_summary(summary, directory, here)
    return {"finished": EXIT_OK, "not converged": EXIT_NOT_CONVERGED, "failed": EXIT_NOT_CONVERGED}.get(summary.status, EXIT_INTERRUPTED)


def _list_parameters(script: CaseScript, assignments: Mapping[str, str]) -> None:
    """Print each parameter with its value: the case's, or what --set, --steps, --solver and --tol make of it."""
    from fcsim.running.parameters import parse_parameters

    values = parse_parameters(script, assignments)
    about = inspect.getdoc(script.parameters) or ""
    if about.startswith(f"{script.parameters.__name__}("):  # what dataclasses say of themselves
        about = ""
    if answer({"case": script.name, "about": about, "parameters": asdict(values)}):
        return
    for parameter in fields(script.parameters):
        say(f"{parameter.name:20s} {getattr(values, parameter.name)}")
    if about:
        say(f"\n{about}")


def _print_summary(summary: Summary, directory: Path, here: Path) -> None:
    """Print how the run ended, the seconds by phase and where the results are, as seen from `here`."""
    if current().quiet and not summary.converged:
        say(f"{summary.status}: {summary.message}", to_stderr=True)
    if answer({"results": directory, "status": summary.status, "message": summary.message, "steps": summary.steps, **asdict(summary)}):
        return
    phases = sum(summary.seconds.values())
    rows = [
        (phase, f"{seconds:.2f}", f"{seconds / max(summary.computed, 1):.4f}", f"{100 * seconds / phases:.0f} %" if phases else "-")
        for phase, seconds in [*summary.seconds.items(), ("sum", phases)]
    ]
    title = f"{summary.status}: {summary.computed} steps computed, {summary.wall_time:.1f} s"
    print_table(("phase", "seconds", "seconds a step", "share"), rows, title=title)
    say(f"iterations {summary.iterations}, largest error {summary.largest_error:.1e}")
    say(f"steps: {summary.fallbacks} needed the fallback chain, {summary.led} were led by one that answered before, {summary.cut} cut")
    say(f"energy: largest residual of a step's balance {summary.energy_residual:.1e} J, created by contacts {summary.energy_created:.1e} J")
    if summary.overlap.depth:
        seen = summary.overlap
        say(f"largest overlap {seen.depth:.2e} m, {100 * seen.share:.2g} % of a body's extent, between {seen.between}")
    for note in summary.notes:
        say(note)
    if summary.message:
        say(summary.message)
    written = {"run.json": "", "steps.csv": "", "vtk/run.pvd": " for ParaView", "fclib/": ""}
    there = [name + use for name, use in written.items() if (here / directory / name).exists()]
    say(f"results: {directory} ({', '.join(there)})")
    if summary.converged and summary.steps:  # of no step there is nothing to draw
        say(f"pictures, film and plots: fcsim render {shlex.quote(str(directory))}")
