"""The race: who works next, what is counted, what is believed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fcsim.problem import LocalProblem
from fcsim.solvers.automatic import methods
from fcsim.solvers.automatic.costs import Prices
from fcsim.solvers.automatic.pause import Pause
from fcsim.solvers.automatic.race import Race, Runner, ShareOfMonitor, Stage, run
from fcsim.solvers.automatic.stages import AutomaticOptions
from fcsim.solvers.base import Iterate, Monitor, Status
from fcsim.solvers.memory import Memory
from fcsim.solvers.turns import Turns

PROBLEM = LocalProblem(np.eye(3), np.array([-1.0, 0, 0]), np.zeros(1))  # r = (1, 0, 0) solves it; the error of (1 - e, 0, 0) is e


def method(name: str, error: Callable[[int], float], price: float = 1.0, claim: Status = Status.SOLVED) -> Stage:
    """A stage whose k-th iterate has the error error(k), and which ends where it thinks that this is enough."""

    def turns(race: Race, monitor: ShareOfMonitor) -> Turns:
        while True:
            monitor.iterations += 1
            r = np.array([1 - error(monitor.iterations), 0, 0])
            if monitor.record(r, r + PROBLEM.q) <= monitor.tol:
                return Iterate(r, claim)
            yield

    return Stage(name, "Test.", enters=lambda race: True, turns=turns, price=lambda race: price)


def race(stages: Sequence[Stage], max_iterations: int = 100_000) -> tuple[Iterate, Race]:
    monitor = Monitor(PROBLEM.q, PROBLEM.mu, 3, 1e-8)
    options = AutomaticOptions(max_iterations=max_iterations)
    the_race = Race(PROBLEM, PROBLEM, monitor, options, Prices(PROBLEM, 3, None), False, None, np.zeros(3))
    monitor.record(np.zeros(3), PROBLEM.q)
    return run(the_race, stages), the_race


def stuck(k: int) -> float:
    return 0.5


@pytest.mark.parametrize("dear", [0.1, 1.0, 10.0])
def test_a_method_that_never_arrives_costs_about_what_the_one_that_does(dear: float) -> None:
    """The second one jumps to its solution after 200 iterations, without any sign before: both have spent alike till then."""
    iterate, the_race = race([method("stuck", stuck, dear), method("sudden", lambda k: 0.0 if k == 200 else 0.9)])
    assert iterate.status is Status.SOLVED
    assert the_race.runners["stuck"].spent <= 1.25 * 200 + 2 * dear


def test_what_is_spent_beside_iterations_counts_and_an_end_in_the_first_one_as_that() -> None:
    _, the_race = race([method("one", lambda k: 0.0 if k == 3 else 0.5, 2.0)])
    runner = the_race.runners["one"]
    runner.monitor.beside = 0.25
    assert runner.spent == 3 * 2.0 + 0.25

    def ends(race: Race, monitor: ShareOfMonitor) -> Turns:
        yield from ()
        return Iterate(np.zeros(3), Status.SINGULAR)

    runner = Runner(replace(method("ends", stuck, 2.0), turns=ends), the_race)
    assert runner.spent == 0
    runner.work(1.0)
    assert runner.result is not None and runner.monitor.iterations == 0 and runner.spent == 2


def test_a_stage_spends_no_more_than_its_share_beside_others() -> None:
    little = replace(method("stuck", stuck), share=lambda race: 0.1)
    iterate, the_race = race([little, method("sudden", lambda k: 0.0 if k == 200 else 0.9)])
    assert iterate.status is Status.SOLVED
    assert the_race.runners["stuck"].spent <= 0.1 * 1.25 * 200 + 20


def test_a_method_is_measured_from_the_error_that_it_found() -> None:
    """Not from 1: another method's good iterate is no merit of its own."""
    the_race = race([method("near", lambda k: 1e-3)], max_iterations=5)[1]
    runner = Runner(method("steady", lambda k: 0.9**k), the_race)
    runner.work(20.0)
    assert runner.decades() == pytest.approx(-np.log10(min(1e-3, 0.9**runner.monitor.iterations) / 1e-3))
    runner.work(100.0)
    assert runner.decades() == pytest.approx(-np.log10(0.9**runner.monitor.iterations / 1e-3)) and runner.decades() > 1


def test_who_is_on_its_way_goes_alone() -> None:
    iterate, the_race = race([method("stuck", stuck), method("steady", lambda k: 0.9**k)])
    assert iterate.status is Status.SOLVED
    assert the_race.runners["steady"].monitor.iterations == pytest.approx(np.log(1e-8) / np.log(0.9), abs=1)
    assert the_race.runners["stuck"].spent < 0.7 * the_race.runners["steady"].spent


def test_the_rate_predicts_what_is_needed() -> None:
    _, the_race = race([method("steady", lambda k: 0.9**k)], max_iterations=60)
    runner = the_race.runners["steady"]
    left = np.log(1e-8) / np.log(0.9) - runner.monitor.iterations
    assert runner.needs() == pytest.approx(left, rel=0.05)
    assert runner.decades() == pytest.approx(-runner.monitor.iterations * np.log10(0.9))


@pytest.mark.parametrize(
    ("own", "after"),  # after sixty iterations of its own it takes up an iterate of error 1e-6
    [(lambda k: 1e-6 * 0.99 ** (k - 60), np.log(1e-8 / (1e-6 * 0.99**20)) / np.log(0.99)), (lambda k: 2e-6, np.inf)],
    ids=["slowly", "no better"],
)
def test_what_another_method_found_is_no_rate_of_one_s_own(own: Callable[[int], float], after: float) -> None:
    """It took 60 iterations for 0.99^60 and then 20 from an error of 1e-6: not 14 of these, as if it had come there itself."""
    _, the_race = race([method("near", lambda k: 1e-6)], max_iterations=5)

    def turns(race: Race, monitor: ShareOfMonitor) -> Turns:
        for k in range(1, 81):
            if k == 61:
                monitor.taken_up = 1e-6
            monitor.iterations += 1
            r = np.array([1 - (0.99**k if k <= 60 else own(k)), 0, 0])
            monitor.record(r, r + PROBLEM.q)
            yield
        return Iterate(r, Status.STAGNATED)

    runner = Runner(Stage("taker", "Test.", enters=lambda race: True, turns=turns, price=lambda race: 1.0), the_race)
    for _ in range(8):
        runner.work(10.0)
    assert runner.monitor.iterations == 80
    assert runner.needs() == pytest.approx(after, rel=0.05)
    assert runner.monitor.taken_up == np.inf


@pytest.mark.parametrize(("own", "told"), [(1.01e-5, True), (0.99e-5, False)])
def test_an_iterate_is_taken_up_where_it_is_ten_times_as_good(own: float, told: bool) -> None:
    monitor = SimpleNamespace(best=own, taken_up=np.inf)
    assert methods.overtaken(SimpleNamespace(best=1e-6), monitor) is told  # type: ignore[arg-type]
    assert monitor.taken_up == (1e-6 if told else np.inf)


def test_what_a_method_believes_is_checked() -> None:
    """A method that calls a bad iterate solved is out of the race, and the status is not SOLVED."""

    def turns(race: Race, monitor: ShareOfMonitor) -> Turns:
        monitor.iterations += 1
        yield
        return Iterate(np.array([0.9, 0, 0]), Status.SOLVED)

    liar = Stage("liar", "Test.", enters=lambda race: True, turns=turns, price=lambda race: 1.0)
    iterate, the_race = race([liar])
    assert iterate.status is Status.STAGNATED
    assert the_race.monitor.best == pytest.approx(0.1)
    iterate, _ = race([liar, method("honest", lambda k: 0.5**k)])
    assert iterate.status is Status.SOLVED


def test_iterations_of_all_are_counted_and_limited() -> None:
    iterate, the_race = race([method("a", stuck), method("b", stuck)], max_iterations=50)
    assert iterate.status is Status.MAX_ITERATIONS
    assert the_race.monitor.iterations == sum(runner.monitor.iterations for runner in the_race.runners.values())
    assert 50 <= the_race.monitor.iterations <= 60


@pytest.mark.parametrize("factor", [0.9, 0.99])
def test_who_brings_all_to_rest_shows_it_by_its_velocities(factor: float) -> None:
    """0.9^k falls by 0.9^-10 over the last third of 30 iterations, whatever the error does meanwhile."""

    def turns(race: Race, monitor: ShareOfMonitor) -> Turns:
        while True:
            monitor.iterations += 1
            monitor.speed = factor**monitor.iterations
            yield

    silent = method("silent", stuck)
    for stage, expected in ((replace(silent, turns=turns), factor**-10), (silent, 1.0)):
        runner = Runner(stage, race([silent], max_iterations=3)[1])
        for _ in range(30):
            runner.work(0.0)
        assert runner.rest(1 / 3) == pytest.approx(expected)


@pytest.mark.parametrize("own", [Status.SINGULAR, Status.MAX_ITERATIONS])
def test_one_methods_own_end_is_not_that_of_the_race(own: Status) -> None:
    def turns(race: Race, monitor: ShareOfMonitor) -> Turns:
        monitor.iterations += 1
        yield
        return Iterate(np.zeros(3), own)

    assert race([replace(method("ends", stuck), turns=turns)])[0].status is Status.STAGNATED


def test_who_opens_is_alone_until_it_says_so() -> None:
    """Nobody else is asked to enter as long as the first one's opening lasts, and others enter right after that."""
    asked = []

    def enters(race: Race) -> bool:
        asked.append(race.runners["first"].monitor.iterations)
        return True

    first = replace(method("first", stuck), opens=lambda race, runner: runner.monitor.iterations < 7)
    iterate, _ = race([first, replace(method("second", lambda k: 0.1**k), enters=enters)])
    assert iterate.status is Status.SOLVED
    assert asked == [7]  # not when the race begins: right after the opening


def test_a_turn_without_an_iteration_ends_a_slice() -> None:
    """As where an interior point's path has ended and another one would begin."""

    def turns(race: Race, monitor: ShareOfMonitor) -> Turns:
        while True:
            for _ in range(3):
                monitor.iterations += 1
                yield
            yield

    _, the_race = race([method("sudden", lambda k: 0.0)])
    runner = Runner(Stage("by threes", "Test.", enters=lambda race: True, turns=turns, price=lambda race: 1.0), the_race)
    done = []
    for amount in (2.0, 100.0, 100.0, 1.0):
        runner.work(amount)
        done.append(runner.monitor.iterations)
    assert done == [2, 3, 6, 7]


def test_what_one_method_leaves_another_one_does_not_throw_away() -> None:
    """Sweeps that began before Newton's method has left its systems for the next step, and go on after that."""
    whole = Monitor(PROBLEM.q, PROBLEM.mu, 3, 1e-8, memory=Memory(np.arange(1)))
    sweeps, newton = ShareOfMonitor(whole), ShareOfMonitor(whole)
    assert newton.memory is not None
    newton.memory = newton.memory.having(Pause(np.empty(0, dtype=np.int64), length=2, left=1))
    sweeps.iterations += 1
    sweeps.tell()
    assert whole.iterations == 1
    assert whole.memory is not None and whole.memory.earlier(Pause) is not None
