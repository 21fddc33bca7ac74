"""The process that measures: it reads a problem, forks one child a measurement, ends it at its limits, and judges the answer.

    python -m fcsim.bench.workers.worker

settings come as the first line on stdin, then a request a line; a reply a line goes to stdout; all JSON

It is a process of its own, without MPI, threads or a terminal, so that the children it forks are alike whoever asks: a local bench or
an MPI rank. What a solver needs compiled is compiled here, on small problems in the form and storage of the problem, before the first
fork that needs it; children inherit it. In a child an unmeasured run precedes the measured ones (`solves.warm_up`), so that these
measure the method and not how code is loaded or what a fork costs. What is compiled in a child all the same, since only problems like
this one need it, does not count into its limit on time. Siconos is compiled before it is installed: it is measured within
its own process after that has started and read the problem, without such a run, since it keeps factors in the problem from run to run.
"""

from __future__ import annotations

import json
import os
import platform
import signal
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO

from fcsim.bench.fclib_problem import FclibProblem, read_problem
from fcsim.bench.results import SLACK, Measurement
from fcsim.bench.workers.compiling import watch
from fcsim.bench.workers.flops import counting
from fcsim.bench.workers.killable import FINISHED, MEMORY_LIMIT, TIME_LIMIT, Row, Task, die_with_parent, leave_copies, run_killable
from fcsim.bench.workers.siconos_client import solve_by_siconos
from fcsim.bench.workers.solves import chain_like, run, small_problem_like, warm_on, warm_up
from fcsim.errors import InputError
from fcsim.linear.joints import FRONTS_FROM
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.runtime import release_freed_memory
from fcsim.solvers.plugins import load_plugins, plugin_of
from fcsim.version import __version__

SICONOS = "Siconos:"
REPEAT_WITHIN = 0.5
"""[s] A shorter solve is repeated within this time, and the median counts."""
KEPT = 2
"""Problems a worker keeps in memory."""
STARTING = 120.0
"""[s] that Siconos may take to start and read a problem."""
LEAVE_AGAIN = 0.5
"""[s] after which a worker that was told to end and still works is told again."""


@dataclass(frozen=True)
class Settings:
    """What all measurements of a bench share."""

    threads: int = 1
    plugins: Sequence[str] = ()
    """Python files that add methods to fcsim.solvers.SOLVERS."""
    siconos_python: str = ""
    siconos_version: str = ""


@dataclass(frozen=True)
class Request:
    """A measurement to make; the problem's sizes are known from its file."""

    file: str
    problem: str
    form: str
    dimension: int
    nc: int
    n: int
    solver: str
    tol: float
    time_limit: float
    memory_limit: float | None


def grace(time_limit: float) -> float:
    """[s] Solvers test their time limit between iterations; so much later they are killed. What is solved late does not count."""
    return max(1.0, 0.1 * time_limit)


@cache
def machine() -> str:
    """Host and processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
        model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")
    except OSError:
        model = ""
    return f"{platform.node()} ({model or platform.processor() or platform.machine()})"


def blank(request: Request, settings: Settings, status: str) -> Measurement:
    """A measurement that gave nothing but a status."""
    siconos = request.solver.startswith(SICONOS)
    about = {key: value for key, value in asdict(request).items() if key != "file"}
    return Measurement(
        **about,
        program="siconos" if siconos else "fcsim",
        status=status,
        solved=False,
        seconds=None,
        cpu_seconds=None,
        iterations=None,
        error=None,
        flops=None,
        machine=machine(),
        threads=settings.threads,
        version=settings.siconos_version if siconos else __version__,
        started=datetime.now(UTC).isoformat(timespec="seconds"),
        plugin=plugin_of(request.solver),
    )


def killed(how: str, limit: float) -> str:
    """The status of a child that did not finish."""
    if how == TIME_LIMIT:
        return f"KILLED_TIME: did not stop by itself within {limit:g} s"
    return "KILLED_MEMORY" if how == MEMORY_LIMIT else f"CRASHED: {how}"


def judged(measurement: Measurement) -> Measurement:
    """Confirm a claim to have solved, or not: by the error computed here, and within the time limit."""
    m = measurement
    if m.outcome != "SOLVED":
        return m
    if m.error is None or not m.error <= SLACK * m.tol:
        return replace(m, status=f"WRONG: said to be solved, the error is {m.error:.3g}")
    if m.seconds is not None and m.seconds > m.time_limit:
        return replace(m, status=f"TIME_LIMIT: solved after {m.seconds:.4g} s")
    return replace(m, solved=True)


class Worker:
    """Measures on request, keeping the last problems, and what has been compiled."""

    def __init__(self, settings: Settings, folder: Path) -> None:
        self.settings, self.folder = settings, folder
        self.problems: dict[str, FclibProblem] = {}
        self.compiled: set[object] = set()
        self.process = os.getpid()
        load_plugins(settings.plugins)

    def problem(self, file: str) -> FclibProblem:
        """The problem of a file, its factor computed."""
        if file not in self.problems:
            while len(self.problems) >= KEPT:
                oldest = next(iter(self.problems))
                del self.problems[oldest]
                for written in self.folder.glob(f"{self.for_siconos(oldest).stem}.*"):
                    written.unlink()
            problem = read_problem(Path(file))
            try:
                _ = problem.scale  # the judge's factor, inherited by children and no part of their time or memory
            except (ArithmeticError, RuntimeError, ValueError, MemoryError) as error:  # SingularMatrix is the first
                raise InputError(f"{file}: its equations of motion cannot be solved: {error}") from error
            self.problems[file] = problem
        return self.problems[file]

    def for_siconos(self, file: str) -> Path:
        return self.folder / f"{abs(hash(file))}.npz"

    def measure(self, request: Request) -> Measurement:
        problem = self.problem(request.file)
        if request.solver.startswith(SICONOS):
            return judged(self._siconos(problem, request))
        return judged(self._own(problem, request))

    def _own(self, problem: FclibProblem, request: Request) -> Measurement:
        self._compile(request.solver, problem.problem)
        result = blank(request, self.settings, "")
        seconds = request.time_limit + grace(request.time_limit)

        def items() -> Iterator[Row]:
            for _ in warm_up(problem.problem, request.solver, request.tol, request.time_limit):
                yield {}  # the limit on time begins anew
            with counting() as counters:
                row = run(problem.problem, request.solver, request.tol, request.time_limit, REPEAT_WITHIN)
                total = counters.total()
            yield row | {"flops": None if total is None else total / row["repeats"]}

        release_freed_memory()
        ended = next(run_killable([Task(None, items, seconds, request.memory_limit, watch)], quiet=True))
        if ended.how != FINISHED:
            return replace(result, status=killed(ended.how, seconds))
        row = ended.items[-1]
        error = problem.error(row["r"])
        kept = {key: row[key] for key in ("status", "seconds", "cpu_seconds", "iterations", "flops")}
        return replace(result, **kept, error=error)

    def _compile(self, solver: str, problem: GlobalProblem | LocalProblem) -> None:
        local = isinstance(problem, LocalProblem)
        matrix, constraints = (problem.W, problem.V) if isinstance(problem, LocalProblem) else (problem.M, problem.G)
        kind = (solver, local, problem.dimension, type(matrix), constraints is not None)
        for like in (small_problem_like, chain_like)[: 1 if problem.m < FRONTS_FROM else 2]:
            if (*kind, like) not in self.compiled:
                self.compiled.add((*kind, like))
                warm_on({(solver, like): like(problem)})
                leave_copies(self.process)  # two that serve would read each other's requests

    def _siconos(self, problem: FclibProblem, request: Request) -> Measurement:
        result = blank(request, self.settings, "")
        written = self.for_siconos(request.file)

        def items() -> Iterator[Row]:
            yield from solve_by_siconos(
                problem,
                request.solver.removeprefix(SICONOS),
                request.tol,
                request.time_limit,
                request.memory_limit,
                Path(self.settings.siconos_python),
                written,
            )

        # the process that drives Siconos keeps the limits of each run; this one guards against its own hanging
        patience = STARTING + request.time_limit + grace(request.time_limit)
        ended = next(run_killable([Task(None, items, patience)], quiet=True))
        if ended.how != FINISHED:
            return replace(result, status=f"CRASHED: {ended.how}")
        row = ended.items[-1]
        if row["how"] != FINISHED:
            return replace(result, status=killed(row["how"], request.time_limit))
        kept = {key: row[key] for key in ("status", "seconds", "cpu_seconds", "iterations", "error")}
        return replace(result, **kept)


def _leave(*_: object) -> None:
    """End by unwinding, which ends the child and removes the temporary folder; again where the exception was forgotten: Python drops what
    is raised in hooks of a fork and in callbacks of weak references."""
    signal.setitimer(signal.ITIMER_REAL, LEAVE_AGAIN)
    raise SystemExit(143)


def main() -> int:
    for told in (signal.SIGTERM, signal.SIGALRM):
        signal.signal(told, _leave)
    die_with_parent(signal.SIGTERM)
    replies = os.fdopen(os.dup(1), "w", buffering=1, encoding="utf-8")
    os.dup2(2, 1)  # what libraries print does not mix with the replies
    settings = json.loads(sys.stdin.readline() or "{}")
    cores = settings.pop("cores", ())
    if cores:
        os.sched_setaffinity(0, cores)
    with TemporaryDirectory(prefix="fcsim-bench-") as folder:
        try:
            return _serve(settings, Path(folder), replies)
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)


def _serve(settings: Row, folder: Path, replies: IO[str]) -> int:
    """Reply to each request until there are no more."""
    try:
        worker = Worker(Settings(**settings), folder)
    except InputError as error:
        print(json.dumps({"input_error": str(error)}), file=replies)
        return 2
    print(json.dumps({"folder": str(folder)}), file=replies)
    for line in sys.stdin:
        try:
            reply = asdict(worker.measure(Request(**json.loads(line))))
        except InputError as error:
            reply = {"input_error": str(error)}
        print(json.dumps(reply), file=replies)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
