"""A sweep: the runs of a plan that are not made yet, several at a time, and the table of what came of all.

    DIR/sweep.json                case, digest of its script, parameters, the runs
    DIR/runs/NAME/                the folder of a run, as `fcsim run` writes it
    DIR/records/NAME.json         how its last process ended; DIR/logs/NAME.txt: what it said
    DIR/results.csv, results.json parameters, status and key numbers of every run

Everything that says how far the sweep has come is in these files, each written whole, so that the same command goes on after an end of any
kind: what finished is not made again, what was interrupted goes on from its checkpoint.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic

from fcsim.campaign.key_numbers import key_numbers
from fcsim.campaign.plan import Plan, Planned, joined, write_plan
from fcsim.campaign.process import Task, make_run
from fcsim.campaign.record import FAILED, NOT_CONVERGED, REFUSED, Limits, Place, Record, stands
from fcsim.campaign.results import Row, write_results
from fcsim.errors import InputError
from fcsim.files import alone_in
from fcsim.running.outputs import RunOptions

WRITTEN_EVERY = 2.0
"""[s] between two writings of the table while runs end."""


@dataclass(frozen=True, kw_only=True)
class SweepOptions:
    """How the runs of a sweep are made: processes at a time and threads of each, limits, what each writes, plugins; accept_changes: of the
    case's script and of what its runs read; retry: also those that did not converge, failed or were refused are made anew."""

    jobs: int = 1
    threads: int = 1
    limits: Limits = field(default_factory=Limits)
    run: RunOptions = field(default_factory=RunOptions)
    plugins: Sequence[Path] = ()
    accept_changes: bool = False
    retry: bool = False

    def __post_init__(self) -> None:
        for name in ("jobs", "threads"):
            if getattr(self, name) < 1:
                raise InputError(f"{name}: expected a whole number >= 1, got {getattr(self, name)}")
        for name, value in (("time limit", self.limits.time), ("memory limit", self.limits.memory)):
            if value is not None and not value > 0:
                raise InputError(f"{name}: expected a number > 0, got {value:g}")


@dataclass(frozen=True)
class Progress:
    """How far a sweep has come: runs of this command that have ended, of how many, and which are being made."""

    ended: int
    total: int
    running: tuple[Place, ...]


Watch = Callable[[Progress, Row | None], None]
"""Told each run that ends, and every half second None."""


@dataclass(frozen=True)
class News:
    """Of a launch: a task that has ended, None where none has for half a second, and those that are being made."""

    ended: Task | None
    running: tuple[Task, ...]


Launch = Callable[[Sequence[Task]], Generator[News]]
"""Makes tasks, each by `make_run`, and yields the news."""


@dataclass
class _Table:
    """The rows of all runs of a plan, written when they have changed, but not too often."""

    directory: Path
    plan: Plan
    rows: dict[str, Row]
    written: float = float("-inf")

    @classmethod
    def of(cls, directory: Path, plan: Plan) -> _Table:
        return cls(directory, plan, {run.name: row_of(directory, run) for run in plan.runs})

    def take(self, row: Row) -> None:
        self.rows[row.run.name] = row
        if monotonic() > self.written + WRITTEN_EVERY:
            self.write()

    def write(self) -> None:
        write_results(self.directory, self.plan, [self.rows[run.name] for run in self.plan.runs])
        self.written = monotonic()


def row_of(directory: Path, run: Planned) -> Row:
    """What is known of a run."""
    place = Place(directory, run.name)
    return Row(run, place.known(), key_numbers(place.run))


def sweep(
    plan: Plan, directory: str | Path, options: SweepOptions | None = None, *, launch: Launch | None = None, watch: Watch | None = None
) -> list[Row]:
    """Make the runs of a plan that the folder lacks and return the rows of all of them, in the plan's order.

    launch: where the runs are made; processes of this machine where it is None. Raises InputError where the folder holds something
    else, or another sweep is at it; KeyboardInterrupt once the running ones have written their checkpoints and the table is written.
    """
    options, directory = options or SweepOptions(), Path(directory)
    whole = joined(directory, plan, options.accept_changes)
    directory.mkdir(parents=True, exist_ok=True)
    with alone_in(directory, "fcsim sweep"):
        whole = joined(directory, plan, options.accept_changes)  # another may have begun meanwhile
        for left in directory.glob(".*.partial*"):  # by a sweep that was killed as it wrote
            left.unlink(missing_ok=True)
        write_plan(directory, whole)
        table = _Table.of(directory, whole)
        table.write()
        asked = {run.name for run in plan.runs}
        waiting = [run for run in whole.runs if run.name in asked and not _stands(table.rows[run.name].record, options)]
        try:
            _make(waiting, whole, directory, options, launch or processes(options.jobs), table, watch)
        finally:
            for run in waiting:  # those that were interrupted, too
                table.rows[run.name] = row_of(directory, run)
            table.write()
        return [table.rows[run.name] for run in whole.runs if run.name in asked]


def _stands(record: Record, options: SweepOptions) -> bool:
    """See `stands`; what was refused since something has changed goes on where changes are accepted."""
    return stands(record, options.limits, options.retry or (options.accept_changes and record.status == REFUSED))


def _make(
    waiting: Sequence[Planned], plan: Plan, directory: Path, options: SweepOptions, launch: Launch, table: _Table, watch: Watch | None
) -> None:
    runs = {run.name: run for run in waiting}
    tasks = [_task(run, plan, directory, options, table.rows[run.name].record) for run in waiting]
    ended = 0
    with closing(launch(tasks)) as made:  # whatever ends this block ends the processes
        for news in made:
            row = None
            if news.ended is not None:
                ended += 1
                row = row_of(directory, runs[news.ended.name])
                table.take(row)
            if watch is not None:
                watch(Progress(ended, len(tasks), tuple(task.place for task in news.running)), row)


def _task(run: Planned, plan: Plan, directory: Path, options: SweepOptions, record: Record) -> Task:
    return Task(
        sweep=str(directory.resolve()),
        name=run.name,
        script=plan.script,
        assignments=plan.of_run(run),
        limits=options.limits,
        options=options.run,
        plugins=tuple(str(path.resolve()) for path in options.plugins),
        threads=options.threads,
        accept_changes=options.accept_changes,
        anew=options.retry and record.status in (NOT_CONVERGED, FAILED, REFUSED),
    )


def processes(jobs: int) -> Launch:
    """Runs in processes of this machine, `jobs` at a time."""

    def launch(tasks: Sequence[Task]) -> Generator[News]:
        stop = threading.Event()
        queue = list(reversed(tasks))
        with ThreadPoolExecutor(jobs) as executor, _stopping(stop):
            running: dict[Future[Record], Task] = {}
            while queue or running:
                while queue and len(running) < jobs:
                    task = queue.pop()
                    running[executor.submit(make_run, task, stop)] = task
                done, _ = wait(running, timeout=0.5, return_when=FIRST_COMPLETED)  # so that signals are seen
                for future in done:
                    task = running.pop(future)
                    future.result()
                    yield News(task, tuple(running.values()))
                if not done:
                    yield News(None, tuple(running.values()))

    return launch


@contextmanager
def _stopping(stop: threading.Event) -> Iterator[None]:
    """Tell the threads that wait for processes to end these, however the block ends."""
    try:
        yield
    finally:
        stop.set()
