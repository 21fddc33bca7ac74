"""What fcsim bench and fcsim leaderboard share: options, solvers and tolerances by their names, and the bench itself under a bar."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from fcsim.command_line.assignments import LAUNCHERS, add_launcher, add_plugin_option, cluster_of, positive
from fcsim.command_line.terminal import Bar, say
from fcsim.errors import EXIT_INTERRUPTED, InputError
from fcsim.files import replacing
from fcsim.interrupts import ended_by
from fcsim.version import __version__

if TYPE_CHECKING:
    from fcsim.bench.results import Measurement
    from fcsim.bench.run import Plan, Progress
    from fcsim.bench.workers.launch import Launcher
    from fcsim.bench.workers.worker import Settings

SICONOS_BEST = ("NSGS", "NSN_AC", "ADMM", "PROX NSN_AC", "PROX regularisation", "2D NSGS")
"""Different methods, among those of Siconos that solve most problems of the FCLIB collection."""
SICONOS_PYTHON = Path("/usr/bin/python3")


def add_measuring(parser: argparse.ArgumentParser, *, time_limit: float, launchers: Sequence[str] = LAUNCHERS) -> None:
    """Add the limits of each measurement, how many are made at a time and where, and whose Python has Siconos."""
    parser.add_argument("--time-limit", type=float, default=time_limit, metavar="SECONDS", help=f"of one solve (default {time_limit:g})")
    parser.add_argument("--memory-limit", type=float, metavar="MIB", help="of one solve, beyond the problem (default: none)")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="measurements at a time (default 1; --launcher local)")
    parser.add_argument("--threads", type=int, default=1, metavar="N", help="of each measurement (default 1)")
    ranks = ", of MPI ranks" if "mpi" in launchers else ""
    add_launcher(parser, f"processes of this machine{ranks}, or in jobs: of Slurm, or of submitit on this machine", launchers)
    parser.add_argument("--job-time", type=float, default=7200.0, metavar="SECONDS", help="that a job serves (default 7200; slurm, jobs)")
    parser.add_argument(
        "--siconos-python",
        type=Path,
        default=SICONOS_PYTHON,
        metavar="PYTHON",
        help=f"that has siconos.numerics (default {SICONOS_PYTHON})",
    )
    add_plugin_option(parser)


def check_measuring(options: argparse.Namespace) -> None:
    """Raises InputError for limits and counts that are not above 0, and for plugins that cannot be loaded."""
    from fcsim.solvers.plugins import load_plugins

    for option in ("time_limit", "memory_limit", "jobs", "threads", "job_time"):
        if getattr(options, option) is not None:
            positive("--" + option.replace("_", "-"), getattr(options, option))
    load_plugins(options.plugin)


def names_in(text: str) -> list[str]:
    """What stands between the commas, each once."""
    return list(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))


def tolerances_of(text: str) -> list[float]:
    """The numbers of --tols. InputError for one that is none, or not between 0 and 1."""
    try:
        tols = [float(part) for part in text.split(",") if part.strip()]
    except ValueError:
        raise InputError(f"--tols: expected numbers with commas between, got {text!r}") from None
    for tol in tols:
        positive("--tols", tol)
        if tol >= 1:
            raise InputError(f"--tols: expected numbers < 1, got {tol:g}, which r = 0 meets")
    if not tols:
        raise InputError("--tols: expected at least one tolerance, got none")
    return tols


def solvers_of(solvers: str, siconos: str) -> list[str]:
    """The names of --solvers and --siconos, Siconos' with their prefix. InputError for one that is not known."""
    from fcsim.bench.workers.siconos_worker import CONFIGURATIONS, GLOBAL_3D
    from fcsim.bench.workers.worker import SICONOS
    from fcsim.solvers import method

    names = names_in(solvers)
    if siconos != "none":
        names += [SICONOS + name.removeprefix(SICONOS) for name in (SICONOS_BEST if siconos == "best" else names_in(siconos))]
    for name in names:
        if not name.startswith(SICONOS):
            method(name)
            continue
        configuration, _, storage = name.removeprefix(SICONOS).partition("/")
        if configuration not in CONFIGURATIONS:
            raise InputError(f"solver {name!r}: expected {SICONOS} and one of {', '.join(CONFIGURATIONS)}")
        storages = ("global",) if configuration in GLOBAL_3D else CONFIGURATIONS[configuration]["storages"]
        if storage and storage not in storages:
            raise InputError(f"solver {name!r}: expected the storage {' or '.join(storages)}, got {storage!r}")
    if not names:
        raise InputError("--solvers: expected at least one solver, got none")
    return list(dict.fromkeys(names))


def settings_of(options: argparse.Namespace, solvers: list[str]) -> Settings:
    """What all measurements share. InputError where Siconos is asked for and --siconos-python lacks it."""
    from fcsim.bench.workers.siconos_client import siconos_version
    from fcsim.bench.workers.worker import SICONOS, Settings

    version = ""
    if any(name.startswith(SICONOS) for name in solvers):
        version = siconos_version(options.siconos_python) or ""
        if not version:
            raise InputError(f"--siconos-python {options.siconos_python}: expected a Python that can import siconos.numerics, it cannot")
    plugins = [str(path.resolve()) for path in options.plugin]
    return Settings(options.threads, plugins, str(options.siconos_python), version)


def measured(options: argparse.Namespace, plan: Plan, directory: Path, about: Mapping[str, object]) -> Progress | None:
    """Make the measurements that the table of `directory` lacks, under a bar; `about` goes into its bench.json with the rest of how it was
    called. None on an MPI rank that only served. `tell_interrupted` says what KeyboardInterrupt leaves."""
    from fcsim.bench.run import bench
    from fcsim.bench.workers.jobs import by_jobs
    from fcsim.bench.workers.launch import local, over_mpi

    limits, settings = plan.limits, plan.settings
    # a job's own memory holds the problem and what has read it, too: the limit on each solve is the worker's
    cluster = cluster_of(options, seconds=options.job_time, at_once=options.jobs, threads=options.threads, memory=None)

    def launch() -> AbstractContextManager[Launcher | None]:
        if cluster is not None:
            return by_jobs(settings, cluster, directory / "jobs", options.time_limit)
        return over_mpi(settings) if options.launcher == "mpi" else local(settings, options.jobs)

    circumstances = {
        **about,
        "problems": len(plan.entries),
        "solvers": list(plan.solvers),
        "tols": list(plan.tols),
        "time_limit": limits.time,
        "memory_limit": limits.memory,
        "skip_hopeless": limits.skip_hopeless,
        "jobs": options.jobs,
        "launcher": options.launcher,
        **asdict(settings),
        "version": __version__,
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
    }

    def started() -> None:
        with replacing(directory / "bench.json") as temporary:
            temporary.write_text(json.dumps(circumstances, indent=1) + "\n", encoding="utf-8")

    with Bar("measured", lines=20, own_estimate=True) as bar:
        return bench(plan, directory, launch, Shown(bar).update, started)


def tell_interrupted(directory: Path, interrupt: KeyboardInterrupt) -> int:
    """Say how many measurements an interrupted bench leaves, and return the exit code."""
    from fcsim.bench.results import FILE, read_results

    made = len(read_results(directory)) if (directory / FILE).exists() else 0
    by = ended_by(interrupt)
    text = f"fcsim: interrupted by {by}; {directory / FILE} has {made} measurements, the same command goes on with the rest"
    say(text, to_stderr=True)
    return EXIT_INTERRUPTED


class Shown:
    """What the bar says: the time left and the last measurement."""

    def __init__(self, bar: Bar) -> None:
        self._bar, self._last = bar, ""

    def update(self, progress: Progress, measurement: Measurement | None) -> None:
        """Show a measurement that has just ended, or that none has for a while."""
        if measurement is not None:
            m = measurement
            seconds = "" if m.seconds is None else f" {m.seconds:.3g} s"
            self._last = f"{m.problem} {m.solver} {m.tol:g}: {m.outcome}{seconds}"
        left = "" if progress.left is None else f"about {_duration(progress.left)} left (at most {_duration(progress.at_most)})"
        self._bar.update(progress.done, progress.total, f"{left}; {self._last}" if self._last else "")


def _duration(seconds: float) -> str:
    """Hours, minutes and seconds."""
    return str(timedelta(seconds=round(seconds)))
