"""A race of methods by counted costs: who works next, what each has spent, what each will need at the rate it shows.

No clock takes part: a method spends its iterations times their price (`costs`), so that runs repeat bit by bit. Whoever is on its way
(predicted to arrive for about what all have spent so far) goes on alone; else those in the race spend alike, so that the first to arrive
cannot have been held up by more than what the others spent: k methods that share cost at most k times the best of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.linear.joints import BlockRows
from fcsim.problem import LocalProblem
from fcsim.solvers.automatic.costs import Prices
from fcsim.solvers.base import Iterate, Monitor, Options, Status
from fcsim.solvers.memory import Memory
from fcsim.solvers.turns import Turns

SLICE = 0.1
"""Share of all that was spent that a method spends before the race is looked at again."""
ENDS = (Status.TIME_LIMIT, Status.INFEASIBLE)
"""What ends a race without a solution."""
SLOWING = 3.5
"""Times what the rate so far promises that a method needs in the end, where it needs long: rates fall."""
HOPE, LITTLE = 3.0, 0.25
"""Times all that was spent beyond which a steady method has little hope, and what it then spends of the others' share."""


class ShareOfMonitor(Monitor):
    """The monitor of one method in a race: counts its own iterations and its own best, and tells the race's monitor.

    speed: ||u + g(u)|| / ||q|| of the velocities that the method believes in, infinite where it says nothing of them; paths: of an
    interior point, the root of tau after each iteration along each of its central paths; taken_up: the error of another method's iterate
    from which it has just begun anew, infinite where it goes on from its own; beside: what it has spent beside its iterations, in
    seconds on the reference machine.
    """

    def __init__(self, whole: Monitor) -> None:
        self.whole, self._told = whole, 0
        super().__init__(
            *(np.empty(0), whole.mu, whole.dimension, whole.tol),
            compliance=whole.compliance,
            time_limit=whole.time_limit,
            start=whole.start,
            memory=whole.memory,
        )
        self.scale = whole.scale
        self.speed = self.taken_up = float("inf")
        self.paths: list[list[float]] = []
        self.beside = 0.0

    @property
    def memory(self) -> Memory | None:
        """The race's: what one method leaves there another one does not throw away."""
        return self.whole.memory

    @memory.setter
    def memory(self, memory: Memory | None) -> None:
        self.whole.memory = memory

    @property
    def checks(self) -> bool:
        """The race's, but where u of an answer is remembered, which is that of r then."""
        return self.whole.checks and self.memory is None

    def error(self, r: FloatArray, u: FloatArray) -> float:
        return self.whole.error(r, u)

    def record(self, r: FloatArray, u: FloatArray) -> float:
        self.tell()
        error = self.whole.record(r, u)
        if error < self.best:
            self.best, self.best_r = error, self.whole.best_r if error <= self.whole.best else r.copy()
        return error

    def tell(self) -> None:
        """Count the iterations done since the last time in the race's monitor too."""
        self.whole.iterations += self.iterations - self._told
        self._told = self.iterations


@dataclass(frozen=True, kw_only=True)
class RaceOptions(Options):
    """max_iterations counts sweeps and iterations of all methods alike.

    probe: Gauss-Seidel sweeps before anything else enters; splitting: ADMM iterations that must bring the error down tenfold for it to go
    on alone (0: no ADMM); patience: Newton iterations without a better iterate before it is given up (0: no Newton); without: names of
    stages that are left out.
    """

    max_iterations: int = 1_000_000
    probe: int = 20
    splitting: int = 30
    patience: int = 12
    without: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, least in (("probe", 1), ("splitting", 0), ("patience", 0)):
            if getattr(self, name) < least:
                raise InputError(f"option {name}: expected an integer >= {least}, got {getattr(self, name)}")


@dataclass(frozen=True)
class Stage:
    """One method of the race.

    name, about    for people: what it is and when it enters and is left
    enters         whether it begins now, asked between slices until it does
    turns          begins it: (race, its monitor) -> turns
    price          of one of its iterations
    alone          whether it goes on alone now, though nothing predicts its arrival
    left           whether it is given up now, beside what it decides itself
    steady         whether its rate so far says something about what comes: where it has little hope it spends little
    share          what it spends of the others' share at the most
    opens          whether nobody else is asked to enter now, since it is about to arrive for less than asking and setting up would cost
    """

    name: str
    about: str
    enters: Callable[[Race], bool]
    turns: Callable[[Race, ShareOfMonitor], Turns]
    price: Callable[[Race], float]
    alone: Callable[[Race, Runner], bool] = lambda race, runner: False
    left: Callable[[Race, Runner], bool] = lambda race, runner: False
    steady: Callable[[Race], bool] = lambda race: False
    share: Callable[[Race], float] = lambda race: 1.0
    opens: Callable[[Race, Runner], bool] = lambda race, runner: False


class Runner:
    """A stage that has begun: its turns, what it spent and how its best error fell."""

    def __init__(self, stage: Stage, race: Race) -> None:
        self.stage, self.monitor = stage, ShareOfMonitor(race.monitor)
        self.price = stage.price(race)
        self._turns = stage.turns(race, self.monitor)
        self.result: Iterate | None = None
        self._course = [(0.0, min(race.monitor.best, 1e3))]
        self._speeds = [(0.0, float("inf"))]
        self._since = 0

    @property
    def spent(self) -> float:
        """Seconds on the reference machine; who has ended in its first iteration has spent that."""
        return max(self.monitor.iterations, self.result is not None) * self.price + self.monitor.beside

    def counted_at(self, stage: Stage, race: Race) -> None:
        """Its stage, and what it has spent, where its iterations have counted as one each so far."""
        self.stage, self.price = stage, stage.price(race)
        self._course = [(self.price * spent, error) for spent, error in self._course]
        self._speeds = [(self.price * spent, speed) for spent, speed in self._speeds]

    def work(self, amount: float) -> None:
        """Take turns until about so much is spent, one at least, or one without an iteration says that something new would begin."""
        begun = self.spent
        until = begun + amount
        while self.result is None:
            done = self.monitor.iterations
            try:
                next(self._turns)
            except StopIteration as stop:
                self.result = stop.value
            if self.spent >= until or self.monitor.iterations == done:
                break
        self.monitor.tell()
        if np.isfinite(self.monitor.taken_up):  # what another brought the error down by says nothing of this one's rate
            self._since = len(self._course)
            self._course.append((begun, self.monitor.taken_up))
            self.monitor.taken_up = float("inf")
        best = min(self._course[-1][1], self.monitor.best)
        self._course.append((self.spent, best))
        self._speeds.append((self.spent, self.monitor.speed))

    def decades(self) -> float:
        """Powers of ten by which its best error is below that of where it began."""
        return float(np.log10(self._course[0][1] / max(self._course[-1][1], 1e-300)))

    def gain(self, share: float) -> float:
        """Factor by which the last share of what it has spent brought its best error down."""
        return _fall(self._course, share)

    def rest(self, share: float) -> float:
        """Factor by which the last share of what it has spent brought the velocities that it believes in down."""
        return _fall(self._speeds, share)

    def slowed(self) -> float:
        """Powers of ten by which the velocities that it believes in have fallen since it first said any."""
        known = [speed for _, speed in self._speeds if np.isfinite(speed)]
        return float(np.log10(known[0] / max(known[-1], 1e-300))) if known and known[0] > 0 else 0.0

    def needs(self) -> float:
        """What it will spend until it arrives, at the rate of the second half of what it has spent since it began, or took up another's
        iterate; infinite where that made no better."""
        own = self._course[self._since :]
        spent, best = own[-1]
        earlier, before = next(point for point in reversed(own) if point[0] - own[0][0] <= 0.5 * (spent - own[0][0]))
        if not 0 < best < before or spent <= earlier:
            return float("inf")
        return float(np.log(best / self.monitor.tol) / np.log(before / best)) * (spent - earlier)


def _fall(course: Sequence[tuple[float, float]], share: float) -> float:
    """Factor by which a course of (spent, size) fell in the last share of what was spent; 1 where nothing is known."""
    spent, size = course[-1]
    before = next(earlier for paid, earlier in reversed(course) if paid <= (1 - share) * spent)
    return before / max(size, 1e-300) if np.isfinite(before) else 1.0


@dataclass(eq=False)
class Race:
    """What the stages' conditions look at. problem: with W as `storage` fits it; swept: the storage that sweeps read; points, single,
    held (at which iterate, what), small and still: see `closed.points_a_pair`, `closed.in_single_points`, `closed.held`,
    `closed.in_small_bed`, `later.still`."""

    problem: LocalProblem
    swept: LocalProblem
    monitor: Monitor
    options: RaceOptions
    prices: Prices
    warm: bool
    joints: BlockRows | None
    start: FloatArray
    runners: dict[str, Runner] = field(default_factory=dict)
    points: float | None = None
    single: bool | None = None
    held: tuple[FloatArray, float] | None = None
    small: bool | None = None
    still: bool | None = None

    @property
    def passed(self) -> bool:
        """Whether the compiled front door has tried the problem."""
        return self.monitor.passed

    @property
    def best(self) -> float:
        """The least error so far."""
        return self.monitor.best

    def best_r(self) -> FloatArray:
        """The iterate of that error."""
        return self.start if self.monitor.best_r is None else self.monitor.best_r

    def spent(self) -> float:
        """By all together."""
        return sum(runner.spent for runner in self.runners.values())

    def running(self) -> list[Runner]:
        """Those that are neither done nor left."""
        return [runner for runner in self.runners.values() if runner.result is None]

    def over(self, name: str) -> bool:
        """Whether a stage has begun and ended, or is left out."""
        return name in self.options.without or (name in self.runners and self.runners[name].result is not None)


def _next(race: Race) -> Runner:
    """Who works now: who goes alone, else who is on its way, else who has spent least."""
    running = race.running()
    alone = [runner for runner in running if runner.stage.alone(race, runner)]
    if alone:
        return alone[-1]
    total = race.spent()
    soonest = min(running, key=lambda runner: runner.needs())
    if SLOWING * soonest.needs() <= total:
        return soonest
    return min(running, key=lambda runner: runner.spent / _share(race, runner, total))


def _share(race: Race, runner: Runner, total: float) -> float:
    """What it spends beside the others, 1 where as much as they do."""
    little = runner.stage.steady(race) and runner.needs() > HOPE * total
    return min(runner.stage.share(race), LITTLE if little else 1.0)


def _enter(race: Race, stages: Sequence[Stage]) -> None:
    """Whoever enters now, in the order of the stages, up to one that opens: to ask the others costs as much as sweeps of few contacts."""
    for stage in stages:
        if stage.name not in race.runners and stage.enters(race):
            race.runners[stage.name] = runner = Runner(stage, race)
            if stage.opens(race, runner):
                break


def _answers(race: Race, r: FloatArray) -> bool:
    """Whether r (m,) answers by a u that is computed anew: one that was updated may have drifted."""
    monitor = race.monitor
    if monitor.checks and monitor.best <= monitor.tol and monitor.best_r is not None and np.array_equal(monitor.best_r, r):
        return True  # it counted so far by such a u alone
    return monitor.record(r, race.problem.delassus @ r + race.problem.q) <= monitor.tol


def run(race: Race, stages: Sequence[Stage], exhausted: Callable[[Race], bool] = lambda race: False) -> Iterate:
    """Run the race until a method solves the problem, nobody is left in it, it is exhausted, or the limits of time or iterations are
    reached."""
    last = Iterate(race.start, Status.STAGNATED)
    while True:
        if race.monitor.iterations >= race.options.max_iterations:
            return Iterate(race.best_r(), Status.MAX_ITERATIONS)
        if exhausted(race):
            return Iterate(race.best_r(), Status.EXHAUSTED)
        if not any(runner.stage.opens(race, runner) for runner in race.running()):
            _enter(race, stages)
        if not race.running():
            return Iterate(race.best_r(), last.status)
        runner = _next(race)
        runner.work(SLICE * race.spent())
        if runner.result is None and runner.stage.left(race, runner):
            runner.result = Iterate(race.best_r(), Status.STAGNATED)
        if runner.result is None:
            continue
        last = runner.result
        if last.status is Status.SOLVED:
            if _answers(race, last.r):
                return last
            runner.result = last = Iterate(last.r, Status.STAGNATED)
        elif last.status in ENDS:
            return last
        elif last.status in (Status.SINGULAR, Status.MAX_ITERATIONS):  # one method's own end, not the race's
            last = Iterate(last.r, Status.STAGNATED)
