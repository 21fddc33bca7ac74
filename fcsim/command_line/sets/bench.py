"""fcsim bench: measure solvers on a folder of FCLIB problems."""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from fcsim.command_line.assignments import LAUNCHERS, add_launcher, add_plugin_option, cluster_of, positive
from fcsim.command_line.terminal import Bar, print_table, say
from fcsim.errors import EXIT_BAD_INPUT, EXIT_INTERRUPTED, EXIT_OK, InputError
from fcsim.files import replacing
from fcsim.interrupts import ended_by, ended_politely
from fcsim.version import __version__

if TYPE_CHECKING:
    from fcsim.bench.results import Measurement
    from fcsim.bench.run import Progress
    from fcsim.bench.workers.launch import Launcher
    from fcsim.bench.workers.worker import Settings

SOLVERS = "NSN-AC-NLS,NSN-JM-NLS,NSN-NM-NLS,NSN-AC-NLS-HYBRID,NSGS-AC,NSGS-FP-VI-UPK"
"""Those of the comparison of Acary, Brémond, Huber 2018 that the masonry wall is measured by."""
TOLERANCES = "1e-2,1e-3,1e-4,1e-6"
SICONOS_BEST = ("NSGS", "NSN_AC", "ADMM", "PROX NSN_AC", "PROX regularisation", "2D NSGS")
"""Different methods, among those of Siconos that solve most problems of the FCLIB collection."""

DESCRIPTION = """\
Measure each solver on each problem to each tolerance, every measurement in a process of its own with limits on time and memory: a
hang, a crash, a leak or a false claim is a result. Rows go to results.csv in --out as they are made, and a bench that was ended
by whatever goes on where it was when the same command is given again.

What results.csv has is not measured again, except what was stopped by a time or memory limit that is looser now, and what came of a plugin
that has changed. Machine and version are
noted with each row and not compared; delete rows, or choose another --out, to measure anew.

Time is that of the whole solve, a global problem's reduction included, reading not. What is measured is warm: an unmeasured run of about 2
s at most comes first in each process, since compiled code is loaded in it. Every run starts from r = 0 with nothing known of the problem;
solves shorter than 0.5 s are repeated and the median taken. Siconos needs no loading: its runs are measured within its own process after
that has started and read the problem. A solution found after the time limit is recorded as TIME_LIMIT. The memory limit is on what a solve
adds to the process that has read the problem (its resident memory is watched). The error is recomputed outside the solver; a solver that
says to be solved above 1.01 times the tolerance is recorded as WRONG. flops are counted where the processor's counters may be read (Linux
on x86-64, /proc/sys/kernel/perf_event_paranoid <= 2, rarely in virtual machines), for fcsim's own solvers; the column is empty elsewhere.

In jobs of a cluster (pip install 'fcsim[cluster]'): --launcher slurm --jobs N; each job serves measurements one after the other, with the
same limits on each; --out must be on a file system that all machines share.

Over MPI: mpiexec -n N python -m mpi4py.futures -m fcsim bench ... --launcher mpi; rank 0 hands out, the others measure.
"""


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command `bench`."""
    bench = commands.add_parser(
        "bench",
        help="measure solvers on a folder of problems",
        description=DESCRIPTION,
        epilog="Exit codes: 0 all measurements are made, whatever they say; 2 bad input; 130 interrupted, the same command goes on.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    bench.add_argument("paths", type=Path, nargs="+", metavar="DIR", help="folders of FCLIB files, or such files")
    bench.add_argument("--solvers", default=SOLVERS, metavar="NAME,...", help=f"see fcsim solvers; Siconos:NAME; default {SOLVERS}")
    bench.add_argument("--tols", default=TOLERANCES, metavar="TOL,...", help=f"default {TOLERANCES}")
    bench.add_argument("--time-limit", type=float, default=100.0, metavar="SECONDS", help="of one solve (default 100)")
    bench.add_argument("--memory-limit", type=float, metavar="MIB", help="of one solve, beyond the problem (default: none)")
    bench.add_argument("--jobs", type=int, default=1, metavar="N", help="measurements at a time (default 1; --launcher local)")
    bench.add_argument("--threads", type=int, default=1, metavar="N", help="of each measurement (default 1)")
    add_launcher(
        bench,
        "processes of this machine, of MPI ranks, or in jobs: of Slurm, or of submitit on this machine",
        (*LAUNCHERS, "mpi"),
    )
    bench.add_argument("--job-time", type=float, default=7200.0, metavar="SECONDS", help="that a job serves (default 7200; slurm, jobs)")
    bench.add_argument("--form", choices=("global", "local", "all"), default="all", help="problems in this form only (default all)")
    bench.add_argument("--dimension", type=int, choices=(2, 3), help="problems of this dimension only (default both)")
    bench.add_argument(
        "--siconos",
        default="none",
        metavar="none|best|NAME,...",
        help=f"configurations of Siconos as further solvers, as NSGS or NSGS/dense; best: {', '.join(SICONOS_BEST)}",
    )
    bench.add_argument("--siconos-python", type=Path, default=Path("/usr/bin/python3"), metavar="PYTHON", help="that has siconos.numerics")
    add_plugin_option(bench)
    bench.add_argument(
        "--skip-hopeless",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="record tolerances tighter than one not met in time as TIME_LIMIT without a try (default on)",
    )
    bench.add_argument("--out", type=Path, metavar="DIR", help="folder of the results (default: results/bench/NAME of the first DIR)")
    bench.set_defaults(act=_bench)


def _tolerances(text: str) -> list[float]:
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


def _solvers(options: argparse.Namespace) -> list[str]:
    from fcsim.bench.workers.siconos_worker import CONFIGURATIONS, GLOBAL_3D
    from fcsim.bench.workers.worker import SICONOS
    from fcsim.solvers import method

    names = [name.strip() for name in options.solvers.split(",") if name.strip()]
    if options.siconos != "none":
        theirs = SICONOS_BEST if options.siconos == "best" else [name.strip() for name in options.siconos.split(",") if name.strip()]
        names += [SICONOS + name.removeprefix(SICONOS) for name in theirs]
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


def _settings(options: argparse.Namespace, solvers: list[str]) -> Settings:
    from fcsim.bench.workers.siconos_client import siconos_version
    from fcsim.bench.workers.worker import SICONOS, Settings

    version = ""
    if any(name.startswith(SICONOS) for name in solvers):
        version = siconos_version(options.siconos_python) or ""
        if not version:
            raise InputError(f"--siconos-python {options.siconos_python}: expected a Python that can import siconos.numerics, it cannot")
    plugins = [str(path.resolve()) for path in options.plugin]
    return Settings(options.threads, plugins, str(options.siconos_python), version)


def _circumstances(options: argparse.Namespace, solvers: list[str], tols: list[float], settings: Settings, problems: int) -> str:
    """How the bench was called, for those who repeat it."""
    about = {
        "command": shlex.join(["fcsim", *sys.argv[1:]]),
        "paths": list(map(str, options.paths)),
        "form": options.form,
        "dimension": options.dimension,
        "problems": problems,
        "solvers": solvers,
        "tols": tols,
        "time_limit": options.time_limit,
        "memory_limit": options.memory_limit,
        "skip_hopeless": options.skip_hopeless,
        "jobs": options.jobs,
        "launcher": options.launcher,
        **asdict(settings),
        "version": __version__,
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    return json.dumps(about, indent=1)


def _bench(options: argparse.Namespace) -> int:
    from fcsim.bench.problems import entries
    from fcsim.bench.results import FILE, read_results
    from fcsim.bench.run import Limits, bench
    from fcsim.bench.workers.jobs import by_jobs
    from fcsim.bench.workers.launch import local, over_mpi
    from fcsim.solvers.plugins import load_plugins

    for option in ("time_limit", "memory_limit", "jobs", "threads", "job_time"):
        if getattr(options, option) is not None:
            positive("--" + option.replace("_", "-"), getattr(options, option))
    load_plugins(options.plugin)
    tols, solvers = _tolerances(options.tols), _solvers(options)
    settings = _settings(options, solvers)
    problems, notes = entries(options.paths, options.form, options.dimension)
    directory = options.out or Path("results") / "bench" / options.paths[0].resolve().stem
    limits = Limits(options.time_limit, options.memory_limit, options.skip_hopeless)

    # a job's own memory holds the problem and what has read it, too: the limit on each solve is the worker's
    cluster = cluster_of(options, seconds=options.job_time, at_once=options.jobs, threads=options.threads, memory=None)

    def launch() -> AbstractContextManager[Launcher | None]:
        if cluster is not None:
            return by_jobs(settings, cluster, directory / "jobs", options.time_limit)
        return over_mpi(settings) if options.launcher == "mpi" else local(settings, options.jobs)

    try:
        with ended_politely(), Bar("measured", lines=20, own_estimate=True) as bar:
            text = _circumstances(options, solvers, tols, settings, len(problems))

            def started() -> None:
                with replacing(directory / "bench.json") as temporary:
                    temporary.write_text(text + "\n", encoding="utf-8")

            progress = bench(problems, solvers, tols, limits, settings, directory, launch, Shown(bar).update, started)
    except KeyboardInterrupt as interrupt:
        made = len(read_results(directory)) if (directory / FILE).exists() else 0
        by = ended_by(interrupt)
        text = f"fcsim: interrupted by {by}; {directory / FILE} has {made} measurements, the same command goes on with the rest"
        say(text, to_stderr=True)
        return EXIT_INTERRUPTED
    if progress is None:  # an MPI rank that served
        return EXIT_OK
    names = {problem.name for problem in problems}
    _print_summary([m for m in read_results(directory) if m.problem in names and m.solver in solvers and m.tol in tols])
    for note in [*notes, *progress.notes]:
        say(note, to_stderr=True)
    say(f"{progress.measured} measurements made, {progress.done} of {progress.total} in {directory / FILE}")
    say(f"profiles: fcsim profile {directory}")
    return EXIT_BAD_INPUT if progress.notes else EXIT_OK


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


def _print_summary(measurements: Sequence[Measurement]) -> None:
    """A table of the problems solved by solver and tolerance."""
    tols = sorted({m.tol for m in measurements}, reverse=True)
    kinds = (("TIME_LIMIT", "KILLED_TIME"), ("KILLED_MEMORY", "CRASHED"), ("WRONG",))
    rows = []
    for solver in dict.fromkeys(m.solver for m in measurements):
        own = [m for m in measurements if m.solver == solver]
        solved = [[m.solved for m in own if m.tol == tol] for tol in tols]
        counts = [sum(m.outcome in kind for m in own) for kind in kinds]
        cells = [f"{sum(here)} of {len(here)}" if here else "" for here in solved]
        rows.append((solver, *cells, *(str(count) if count else "" for count in counts)))
    header = ("solver", *(f"{tol:g}" for tol in tols), "late", "killed, crashed", "wrong")
    print_table(header, rows, title="problems solved of those measured")
    if any(m.outcome == "WRONG" for m in measurements):
        say("wrong: said to be solved, above the tolerance when recomputed")
