"""fcsim bench: measure solvers on a folder of FCLIB problems."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fcsim.command_line.assignments import LAUNCHERS
from fcsim.command_line.sets.measuring import (
    SICONOS_BEST,
    add_measuring,
    check_measuring,
    measured,
    settings_of,
    solvers_of,
    tell_interrupted,
    tolerances_of,
)
from fcsim.command_line.terminal import print_table, say
from fcsim.errors import EXIT_BAD_INPUT, EXIT_OK

if TYPE_CHECKING:
    from fcsim.bench.results import Measurement

SOLVERS = "NSN-AC-NLS,NSN-JM-NLS,NSN-NM-NLS,NSN-AC-NLS-HYBRID,NSGS-AC,NSGS-FP-VI-UPK"
"""Those of the comparison of Acary, Brémond, Huber 2018 that the masonry wall is measured by."""
TOLERANCES = "1e-2,1e-3,1e-4,1e-6"
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
        epilog="Exit codes: 0 all measurements are made, whatever they say; 2 bad input, or files of a folder that cannot be "
        "read; 130 interrupted, the same command goes on.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    bench.add_argument("paths", type=Path, nargs="+", metavar="DIR", help="folders of FCLIB files, or such files")
    bench.add_argument("--solvers", default=SOLVERS, metavar="NAME,...", help=f"see fcsim solvers; Siconos:NAME; default {SOLVERS}")
    bench.add_argument("--tols", default=TOLERANCES, metavar="TOL,...", help=f"default {TOLERANCES}")
    add_measuring(bench, time_limit=100.0, launchers=(*LAUNCHERS, "mpi"))
    bench.add_argument("--form", choices=("global", "local", "all"), default="all", help="problems in this form only (default all)")
    bench.add_argument("--dimension", type=int, choices=(2, 3), help="problems of this dimension only (default both)")
    bench.add_argument(
        "--siconos",
        default="none",
        metavar="none|best|NAME,...",
        help=f"configurations of Siconos as further solvers, as NSGS or NSGS/dense; best: {', '.join(SICONOS_BEST)} (default none)",
    )
    bench.add_argument(
        "--skip-hopeless",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="record tolerances tighter than one not met in time as TIME_LIMIT without a try (default on)",
    )
    bench.add_argument("--out", type=Path, metavar="DIR", help="folder of the results (default: results/bench/NAME of the first DIR)")
    bench.set_defaults(act=_bench)


def _bench(options: argparse.Namespace) -> int:
    from fcsim.bench.problems import entries
    from fcsim.bench.results import FILE, read_results
    from fcsim.bench.run import Limits, Plan

    check_measuring(options)
    tols, solvers = tolerances_of(options.tols), solvers_of(options.solvers, options.siconos)
    settings = settings_of(options, solvers)
    unreadable: list[str] = []
    problems, notes = entries(options.paths, options.form, options.dimension, unreadable)
    directory = options.out or Path("results") / "bench" / options.paths[0].resolve().stem
    limits = Limits(options.time_limit, options.memory_limit, options.skip_hopeless)
    about = {
        "command": shlex.join(["fcsim", *sys.argv[1:]]),
        "paths": list(map(str, options.paths)),
        "form": options.form,
        "dimension": options.dimension,
        "unreadable": unreadable,
    }
    try:
        progress = measured(options, Plan(problems, solvers, tols, limits, settings), directory, about)
    except KeyboardInterrupt as interrupt:
        return tell_interrupted(directory, interrupt)
    if progress is None:  # an MPI rank that served
        return EXIT_OK
    names = {problem.name for problem in problems}
    _print_summary([m for m in read_results(directory) if m.problem in names and m.solver in solvers and m.tol in tols])
    lost = [*unreadable, *progress.notes]
    if lost:
        print_table(("file", "state", "why"), [_file_and_reason(error) for error in lost], title="files that were left out")
    for note in [*notes, *lost]:
        say(note, to_stderr=True)
    say(f"{progress.measured} measurements made, {progress.done} of {progress.total} in {directory / FILE}")
    say(f"profiles: fcsim profile {shlex.quote(str(directory))}")
    return EXIT_BAD_INPUT if lost else EXIT_OK


def _file_and_reason(error: str) -> tuple[str, str, str]:
    file, _, reason = error.partition(": ")
    return file, "unreadable", reason


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
