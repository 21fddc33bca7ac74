"""A bench: every problem by every solver to every tolerance, each measured once, whatever becomes of it.

What is in the table is not measured again, except what was stopped by a limit that is looser now: by time where the time limit is
larger, by memory where the memory limit is. Machine and version are noted with each measurement and not compared; other threads than
the table's are refused.
"""

from __future__ import annotations

import fcntl
from collections import defaultdict, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from statistics import mean
from time import monotonic

from fcsim.bench.problems import Entry
from fcsim.bench.results import FILE, NOT_TRIED, Measurement, append, read_results, take_over
from fcsim.bench.workers.launch import Launcher
from fcsim.bench.workers.siconos_worker import GLOBAL_3D, LOCAL_2D, LOCAL_3D
from fcsim.bench.workers.worker import SICONOS, Request, Settings, blank, grace
from fcsim.errors import InputError
from fcsim.solvers import method
from fcsim.solvers.plugins import plugin_of

BY_TIME = ("TIME_LIMIT", "KILLED_TIME")


@dataclass(frozen=True)
class Limits:
    """Of one measurement: seconds, and MiB beyond the problem (None: no limit)."""

    time: float
    memory: float | None = None
    skip_hopeless: bool = True
    """Tighter tolerances than one that was not met in time are recorded as TIME_LIMIT without a try."""


@dataclass(frozen=True)
class Plan:
    """What a bench measures: each of the solvers on each problem that it is made for, to each tolerance, within limits."""

    entries: Sequence[Entry]
    solvers: Sequence[str]
    tols: Sequence[float]
    limits: Limits
    settings: Settings


def solves(solver: str, entry: Entry) -> bool:
    """Whether a solver is for problems of that form and dimension."""
    if not solver.startswith(SICONOS):
        return entry.dimension in method(solver).dimensions
    name = solver.removeprefix(SICONOS).partition("/")[0]
    if entry.dimension == 2:
        return name in LOCAL_2D
    return name in LOCAL_3D or (entry.form == "global" and name in GLOBAL_3D)


def stands(known: Measurement, limits: Limits) -> bool:
    """Whether a measurement need not be made again under these limits."""
    if known.outcome in BY_TIME:
        if NOT_TRIED in known.status and not limits.skip_hopeless:
            return False
        return known.time_limit >= limits.time
    if known.outcome == "KILLED_MEMORY":
        looser = known.memory_limit is not None and (limits.memory is None or limits.memory > known.memory_limit)
        return not looser
    return True


@dataclass
class Chain:
    """A problem and a solver: tolerances from loose to tight, one after the other."""

    entry: Entry
    solver: str
    tols: Sequence[float]
    known: dict[float, Measurement]

    def missing(self, limits: Limits) -> list[float]:
        return [tol for tol in self.tols if tol not in self.known or not stands(self.known[tol], limits)]

    def hopeless(self, tol: float, limits: Limits) -> float | None:
        """A looser tolerance that was not met within at least this time, if that is to be taken as the answer."""
        late = [m.tol for t, m in self.known.items() if t > tol and m.outcome in BY_TIME and m.time_limit >= limits.time]
        return max(late, default=None) if limits.skip_hopeless else None

    def request(self, tol: float, limits: Limits) -> Request:
        e = self.entry
        return Request(str(e.path.resolve()), e.name, e.form, e.dimension, e.nc, e.n, self.solver, tol, limits.time, limits.memory)


@dataclass
class Progress:
    """How far a bench is; `watch` sees it after each measurement."""

    total: int
    done: int
    """In the table, those of earlier runs included."""
    measured: int = 0
    """By this run."""
    notes: list[str] = field(default_factory=list)
    left: float | None = None
    """[s] Expected, from the last measurements of the same solver and tolerance: problems come in the order of their size."""
    at_most: float = float("inf")
    """[s]"""


Watch = Callable[[Progress, Measurement | None], None]


class Estimate:
    """Remaining time from the durations of the last measurements."""

    LAST = 5

    def __init__(self, places: int, limits: Limits) -> None:
        self.places, self.limits = places, limits
        self.durations: dict[tuple[str, float], deque[float]] = defaultdict(lambda: deque(maxlen=self.LAST))
        self.waiting: dict[tuple[str, float], int] = defaultdict(int)

    def of(self, key: tuple[str, float]) -> float | None:
        if self.durations.get(key):
            return mean(self.durations[key])
        same = [mean(d) for (solver, _), d in self.durations.items() if solver == key[0] and d]
        every = [mean(d) for d in self.durations.values() if d]
        return mean(same) if same else mean(every) if every else None

    def update(self, progress: Progress) -> None:
        expected = [(count, self.of(key)) for key, count in self.waiting.items() if count]
        progress.left = sum(count * (seconds or 0.0) for count, seconds in expected) / self.places
        latest = self.limits.time + grace(self.limits.time)
        progress.at_most = max(progress.left, sum(self.waiting.values()) * latest / self.places)


@contextmanager
def _alone(directory: Path) -> Iterator[None]:
    """Keep other benches out of the folder; the lock goes with the process, however it ends."""
    with (directory / FILE).open("ab") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise InputError(f"{directory}: another fcsim bench is writing there; choose another --out") from None
        yield


def _chains(plan: Plan, directory: Path) -> list[Chain]:
    """The plan's chains with what the table of `directory` has of them. InputError for a table that cannot go on."""
    known: dict[tuple[str, str, str], dict[float, Measurement]] = defaultdict(dict)
    sizes = {(entry.name, entry.form): (entry.dimension, entry.nc, entry.n) for entry in plan.entries}
    for m in read_results(directory):
        there = (m.dimension, m.nc, m.n)
        if sizes.get((m.problem, m.form), there) != there:
            raise InputError(f"{directory / FILE}: its {m.form} problem {m.problem} has other sizes than the file; choose another --out")
        if m.threads != (threads := plan.settings.threads):
            raise InputError(f"{directory / FILE}: measured with {m.threads} threads, expected {threads}; choose another --out")
        if m.plugin == plugin_of(m.solver):  # what a plugin did before it was changed is measured anew
            known[m.problem, m.form, m.solver][m.tol] = m
    ordered = sorted(set(plan.tols), reverse=True)
    return [Chain(e, s, ordered, known[e.name, e.form, s]) for e in plan.entries for s in plan.solvers if solves(s, e)]


def bench(
    plan: Plan,
    directory: Path,
    launch: Callable[[], AbstractContextManager[Launcher | None]],
    watch: Watch = lambda progress, measurement: None,
    started: Callable[[], None] = lambda: None,
) -> Progress | None:
    """Make the measurements that the table of `directory` lacks, and append each as it ends.

    watch sees each measurement, and every half second None; started is called once the folder and its table are fit to go on.

    Returns how far it came, with a note for each problem that could not be read; None on an MPI rank that only served.
    Raises InputError for a table that cannot go on.
    """
    with launch() as launcher:
        if launcher is None:
            return None
        directory.mkdir(parents=True, exist_ok=True)
        take_over(directory)
        with _alone(directory):
            chains = _chains(plan, directory)
            started()
            return _measure(_Turns(chains, plan, directory, launcher, watch))


class _Turns:
    """The chains of a bench while their measurements are made: what runs, what was measured, what cannot be read."""

    def __init__(self, chains: Sequence[Chain], plan: Plan, directory: Path, launcher: Launcher, watch: Watch) -> None:
        self.limits, self.settings, self.directory, self.launcher, self.watch = plan.limits, plan.settings, directory, launcher, watch
        limits = plan.limits
        self.waiting = deque(chain for chain in chains if chain.missing(limits))
        self.estimate = Estimate(launcher.places, limits)
        for chain in self.waiting:
            for tol in chain.missing(limits):
                self.estimate.waiting[chain.solver, tol] += 1
        total = sum(len(chain.tols) for chain in chains)
        self.progress = Progress(total, total - sum(self.estimate.waiting.values()))
        self.running: dict[Future[Measurement], tuple[Chain, float]] = {}
        self.unreadable: set[str] = set()

    def keep(self, chain: Chain, measurement: Measurement, seconds: float | None) -> None:
        """Append a measurement to the table; seconds: None where it was not made."""
        append(self.directory, measurement)
        key = chain.solver, measurement.tol
        chain.known[measurement.tol] = measurement
        self.estimate.waiting[key] -= 1
        if seconds is not None:
            self.estimate.durations[key].append(seconds)
            self.progress.measured += 1
        self.progress.done += 1
        self.estimate.update(self.progress)
        self.watch(self.progress, measurement)

    def advance(self, chain: Chain) -> None:
        """Ask for a chain's next measurement, if it has one."""
        if chain.entry.path.as_posix() in self.unreadable:
            return
        for tol in chain.missing(self.limits):
            late = chain.hopeless(tol, self.limits)
            request = chain.request(tol, self.limits)
            if late is None:
                self.running[self.launcher.submit(request)] = chain, monotonic()
                return
            self.keep(chain, blank(request, self.settings, f"TIME_LIMIT: {NOT_TRIED}: {late:g} not met in time"), None)

    def take(self, future: Future[Measurement]) -> None:
        """Keep what has ended and go on with its chain."""
        chain, started = self.running.pop(future)
        try:
            measurement = future.result()
        except InputError as error:  # the problem cannot be read: no solver is to blame
            if chain.entry.path.as_posix() not in self.unreadable:
                self.unreadable.add(chain.entry.path.as_posix())
                self.progress.notes.append(str(error))
            return
        self.keep(chain, measurement, monotonic() - started)
        self.advance(chain)


def _measure(turns: _Turns) -> Progress:
    """Make all measurements, as many at a time as the launcher has places."""
    turns.watch(turns.progress, None)
    while turns.waiting or turns.running:
        while turns.waiting and len(turns.running) < turns.launcher.places:
            turns.advance(turns.waiting.popleft())
        # a timeout, so that signals are seen
        finished, _ = wait(turns.running, timeout=0.5, return_when=FIRST_COMPLETED)
        for future in finished:
            turns.take(future)
        if not finished:
            turns.watch(turns.progress, None)
    return turns.progress
