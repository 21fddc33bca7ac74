"""Hybrids: what runs first, in which order, how often; the published ones solve what their last stage alone does not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from fcsim.errors import InputError
from fcsim.problem import LocalProblem
from fcsim.solvers import SOLVERS, solve
from fcsim.solvers.base import Iterate, Monitor, Options, Status
from fcsim.solvers.hybrid import HybridOptions, Stage, hybrid
from fcsim.solvers.newton.iterations import newton


@dataclass(frozen=True, kw_only=True)
class Told(Options):
    """A stage that notes its name and goes `gain` nearer to the answer r = 1 of u = r - 1, one frictionless contact."""

    name: str = ""
    gain: float = 0.0


CALLS: list[str] = []


def told(problem: LocalProblem, r: np.ndarray, monitor: Monitor, options: Told) -> Iterate:
    CALLS.append(options.name)
    assert options.max_iterations == monitor.iterations + 3
    monitor.iterations += 1
    r = r + options.gain * (np.array([1.0, 0, 0]) - r)
    error = monitor.record(r, problem.W @ r + problem.q)
    return Iterate(r, Status.SOLVED if error <= monitor.tol else Status.MAX_ITERATIONS)


def stage(name: str, gain: float) -> Stage:
    return Stage(told, Told(name=name, gain=gain, max_iterations=3))


def run(options: HybridOptions, tol: float = 1e-3) -> tuple[Iterate, Monitor]:
    CALLS.clear()
    p = LocalProblem(np.eye(3), np.array([-1.0, 0, 0]), np.zeros(1))
    monitor = Monitor(p.q, p.mu, 3, tol)
    return hybrid(p, np.zeros(3), monitor, options), monitor


def test_first_stages_run_once_and_the_cycles_until_solved() -> None:
    iterate, monitor = run(HybridOptions(first=(stage("first", 0.1),), stages=(stage("a", 0.5), stage("b", 0.1)), cycles=50))
    assert iterate.status is Status.SOLVED and monitor.best <= 1e-3
    assert CALLS[:5] == ["first", "a", "b", "a", "b"] and CALLS.count("first") == 1
    assert monitor.iterations == len(CALLS)
    assert abs(iterate.r[0] - (1 - 0.9 * 0.5 ** CALLS.count("a") * 0.9 ** CALLS.count("b"))) < 1e-12


def test_cycles_are_limited() -> None:
    iterate, _ = run(HybridOptions(stages=(stage("a", 0.1),), cycles=4))
    assert iterate.status is Status.MAX_ITERATIONS and CALLS == ["a"] * 4


def test_a_cycle_without_progress_is_the_last() -> None:
    iterate, _ = run(HybridOptions(first=(stage("first", 0.5),), stages=(stage("away", -0.5), stage("nothing", 0.0)), cycles=9))
    assert CALLS == ["first", "away", "nothing"]
    assert iterate.status is Status.MAX_ITERATIONS
    assert iterate.r[0] == 0.5  # the best iterate, not the last


def test_no_cycle_is_refused() -> None:
    with pytest.raises(InputError, match="cycles: expected an integer >= 1, got 0"):
        HybridOptions(cycles=0)


HYBRIDS = [name for name, method in SOLVERS.items() if method.run is hybrid]


def test_published_hybrids() -> None:
    assert {"NSN-AC-HYBRID", "NSN-AC-EG-HYBRID", "NSN-AC-PLI-LOOP", "NSN-AC-NSN-PLI-LOOP"} <= set(HYBRIDS)
    for name in HYBRIDS:
        options = SOLVERS[name].options
        assert options.stages[-1].run is newton and options.stages[-1].options.formulation == name.split("-")[1]
        assert options.stages[0].options.max_iterations == 100
        assert (options.cycles > 1) == name.endswith("-LOOP")


def hard_problem(seed: int) -> LocalProblem:
    """2D, friction above 1 and little compliance of a contact's own."""
    rng = np.random.default_rng(seed)
    H = rng.standard_normal((32, 30)) / np.sqrt(30)
    q = rng.standard_normal((15, 2))
    q[:, 0] -= 0.5
    return LocalProblem(H.T @ H + 0.01 * np.eye(30), q.ravel(), np.full(15, 1.5), dimension=2)


@pytest.fixture(scope="module")
def unsolved() -> list[LocalProblem]:
    """Those of 40 hard problems on which full Newton steps from r = 0 fail."""
    problems = [p for p in map(hard_problem, range(40)) if not solve(p, "NSN-AC", tol=1e-9).solved]
    assert problems
    return problems


@pytest.mark.parametrize("name", [name for name in HYBRIDS if name != "NSN-AC-EG-HYBRID"])
def test_hybrids_solve_what_newton_alone_does_not(name: str, unsolved: list[LocalProblem]) -> None:
    for p in unsolved:
        result = solve(p, name, tol=1e-9)
        assert result.solved
        u_N, u_T = (p.W @ result.r + p.q).reshape(-1, 2).T
        r_N, r_T = result.r.reshape(-1, 2).T
        for broken in (-r_N, -u_N, np.abs(r_N * u_N), np.abs(r_T) - 1.5 * r_N, np.abs(r_T * u_T + 1.5 * r_N * np.abs(u_T))):
            assert broken.max() < 1e-6
