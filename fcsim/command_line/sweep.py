"""fcsim sweep: a case over all combinations of some parameters' values, into one folder with one table."""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fcsim.command_line.answers import answer
from fcsim.command_line.assignments import (
    add_launcher,
    add_plugin_option,
    checked_tolerance,
    cluster_of,
    given_by_options,
    positive,
    read_assignments,
)
from fcsim.command_line.terminal import Bar, print_table, say
from fcsim.errors import EXIT_INTERRUPTED, EXIT_NOT_CONVERGED, EXIT_OK, InputError
from fcsim.interrupts import ended_by
from fcsim.tables import cell

if TYPE_CHECKING:
    from fcsim.campaign.plan import Plan
    from fcsim.campaign.record import Limits, Place
    from fcsim.campaign.results import Row
    from fcsim.campaign.sweep import Launch, Progress, SweepOptions

SHOWN_ROWS, SHOWN_FAILURES = 40, 30
DESCRIPTION = """\
Run a case for every combination of some parameters' values. Every combination is a run in a folder of its own, in a process of its own
with its own limits; what came of each stands in results.csv and results.json: parameters, status, key numbers, of those that failed too.

A sweep that was ended by whatever goes on when the same command is given again: what finished is not made again, what was interrupted goes
on from its checkpoint, what was stopped by a limit goes on where that is looser now, what did not converge, failed or was refused is
made again with --retry. Further combinations of the same parameters may be added to a folder.

  --over mu=0.3,0.5,0.7               these values
  --over E=1e9..4e9/4                 four values with equal distances, both ends included
  --over E=1e6..1e9/4log              four values with equal ratios
  --over "divisions=8,4,4;16,8,8"     values that hold commas
  --table FILE.csv                    one combination a row; the header names the parameters
"""


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command `sweep`."""
    sweep = commands.add_parser(
        "sweep",
        help="run a case over values of its parameters",
        description=DESCRIPTION,
        epilog="Exit codes: 0 all finished; 1 some did not, the table says which; 2 bad input; 130 interrupted, the same command goes on.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    sweep.add_argument("case", help="a case: its folder or script, a name of `fcsim cases`, or a masonry problem in JSON")
    sweep.add_argument("--over", action="append", default=[], metavar="NAME=VALUES", help="a parameter and its values; may be given again")
    sweep.add_argument("--table", type=Path, metavar="FILE", help="CSV file of combinations, each taken with all values of --over")
    sweep.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", dest="assignments", help="a parameter of all runs")
    sweep.add_argument("--steps", type=int, help="number of steps of all runs")
    sweep.add_argument("--solver", help="solver of all runs")
    sweep.add_argument("--tol", type=float, help="tolerance of all runs")
    sweep.add_argument("--out", type=Path, metavar="DIR", help="folder of the sweep (default: results/sweep/CASE)")
    sweep.add_argument("--jobs", type=int, metavar="N", help="runs at a time (default: the cores that may be used, by --threads)")
    sweep.add_argument("--threads", type=int, default=1, metavar="N", help="of each run (default 1)")
    sweep.add_argument("--time-limit", type=float, metavar="SECONDS", help="of each run's process (default: none)")
    sweep.add_argument("--memory-limit", type=float, metavar="MIB", help="of each run's process (default: none)")
    for what, default in (("export", 0), ("vtk", 0), ("checkpoint", 20)):
        text = f"as of fcsim run (default {default})"
        sweep.add_argument(f"--{what}-every", type=int, default=default, metavar="K", help=text)
    sweep.add_argument("--retry", action="store_true", help="make also those anew that did not converge, failed or were refused")
    sweep.add_argument("--accept-changes", action="store_true", help="go on also where the case, its files or versions have changed")
    add_launcher(sweep, LAUNCHER)
    add_plugin_option(sweep)
    sweep.set_defaults(act=_sweep)


LAUNCHER = "processes of this machine, an array of Slurm, or submitit's jobs on this machine (slurm, jobs: --time-limit needed)"


def _sweep(options: argparse.Namespace) -> int:
    from fcsim.campaign.combinations import combinations, read_over, read_table_of_values
    from fcsim.campaign.named_case import named_case
    from fcsim.campaign.plan import make_plan
    from fcsim.campaign.sweep import sweep
    from fcsim.solvers import method
    from fcsim.solvers.plugins import load_plugins

    load_plugins(options.plugin)
    script = named_case(options.case)
    assignments = read_assignments(options.assignments)
    if options.tol is not None:
        checked_tolerance(options.tol)
    if options.solver is not None:
        method(options.solver)
    if options.steps is not None and options.steps < 0:  # here, not run by run in the table
        raise InputError(f"--steps: expected a whole number >= 0, got {options.steps}")
    assignments |= given_by_options(options, script)
    rows = read_table_of_values(options.table) if options.table is not None else []
    chosen = combinations([read_over(text) for text in options.over], rows)
    plan = make_plan(script, assignments, chosen, options.plugin)
    directory = options.out or Path("results") / "sweep" / script.name
    settings = _settings(options)
    twins = len(chosen) - len(plan.runs)
    if twins:
        say(f"combinations that have the values of others are made once: {len(chosen)} given, {len(plan.runs)} to be made", to_stderr=True)
    try:
        with Bar("runs", lines=0) as bar:
            made = sweep(plan, directory, settings, launch=_launch(options, settings, directory), watch=_Shown(bar).update)
    except KeyboardInterrupt as interrupt:
        say(f"fcsim: interrupted by {ended_by(interrupt)}; the same command goes on ({directory / 'results.csv'})", to_stderr=True)
        return EXIT_INTERRUPTED
    _print_results(plan, made, directory, settings.limits)
    return EXIT_OK if all(row.record.status == "finished" for row in made) else EXIT_NOT_CONVERGED


def _settings(options: argparse.Namespace) -> SweepOptions:
    from fcsim.campaign.record import Limits
    from fcsim.campaign.sweep import SweepOptions
    from fcsim.running.outputs import RunOptions

    for name in ("time_limit", "memory_limit", "jobs", "threads"):
        if getattr(options, name) is not None:
            positive("--" + name.replace("_", "-"), getattr(options, name))
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return SweepOptions(
        jobs=max(1, cores // options.threads) if options.jobs is None else options.jobs,
        threads=options.threads,
        limits=Limits(options.time_limit, options.memory_limit),
        run=RunOptions(export_every=options.export_every, vtk_every=options.vtk_every, checkpoint_every=options.checkpoint_every),
        plugins=tuple(options.plugin),
        accept_changes=options.accept_changes,
        retry=options.retry,
    )


def _launch(options: argparse.Namespace, settings: SweepOptions, directory: Path) -> Launch | None:
    """Where the runs are made, None for processes of this machine."""
    from fcsim.campaign.jobs import on_cluster

    limits = settings.limits
    cluster = cluster_of(options, seconds=limits.time, at_once=settings.jobs, threads=settings.threads, memory=limits.memory)
    return None if cluster is None else on_cluster(directory, cluster)


class _Shown:
    """What the bar says: each run that ends, and how far those are that are being made."""

    MOST = 3

    def __init__(self, bar: Bar) -> None:
        self._bar = bar

    def update(self, progress: Progress, row: Row | None) -> None:
        if row is not None:
            seconds = "" if row.record.seconds is None else f", {row.record.seconds:.1f} s"
            message = f": {row.record.message}" if row.record.message else ""
            self._bar.say(f"{_texts(row.run.values)}: {row.record.status}{seconds}{message}")
        making = [text for place in progress.running[:100] if (text := _how_far(place))][: self.MOST]
        self._bar.update(progress.ended, progress.total, "; ".join(making))


def _texts(values: Mapping[str, str]) -> str:
    return ", ".join(f"{name}={cell(value)}" for name, value in values.items())


def _how_far(place: Place) -> str:
    """The run and the step that it has made, by the end of its table; empty where it has none yet."""
    try:
        with (place.run / "steps.csv").open("rb") as file:
            file.seek(max(file.seek(0, os.SEEK_END) - 4000, 0))
            last = file.read().decode(errors="replace").splitlines()[-1]
    except (OSError, IndexError):
        return ""
    step = last.partition(",")[0]
    return f"{place.name} step {step}" if step.isdecimal() else ""


def _print_results(plan: Plan, rows: Sequence[Row], directory: Path, limits: Limits) -> None:
    """The table of the runs of this command, what failed by name and whether it stays so, and where all is."""
    from fcsim.campaign.record import stands
    from fcsim.campaign.results import results_of

    if answer(results_of(plan, rows)):
        return
    own = ("status", "steps", "iterations", "largest error", "seconds")
    header = ("run", *(f"{name} (set)" if name in own else name for name in plan.varied), *own)  # as in results.csv
    table = [
        (
            str(number),
            *(cell(row.run.values.get(name, "")) for name in plan.varied),
            row.record.status,
            *(_short(row.numbers.get(name)) for name in ("steps_done", "iterations", "largest_error", "seconds_of_steps")),
        )
        for number, row in enumerate(rows, 1)
    ]
    print_table(header, table[:SHOWN_ROWS], title=f"{plan.case}: {len(rows)} {'run' if len(rows) == 1 else 'runs'}")
    if len(table) > SHOWN_ROWS:
        say(f"... and {len(table) - SHOWN_ROWS} more")
    failed = [row for row in rows if row.record.status != "finished"]
    for row in failed[:SHOWN_FAILURES]:
        told = ": ".join(filter(None, (_texts(row.run.values), row.record.status, row.record.message)))
        say(f"{told} (logs/{row.run.name}.txt)")
    if len(failed) > SHOWN_FAILURES:
        say(f"... and {len(failed) - SHOWN_FAILURES} more that did not finish")
    if left := sum(stands(row.record, limits) for row in failed):
        say(f"{left} of these stay{'s' * (left == 1)} so when the same command is given again; --retry makes them anew")
    say(f"{len(rows) - len(failed)} of {len(rows)} finished; {directory / 'results.csv'}, results.json, runs/")


def _short(value: float | None) -> str:
    return f"{value:.3g}" if isinstance(value, float) else cell(value)
