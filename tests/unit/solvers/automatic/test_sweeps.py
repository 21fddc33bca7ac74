"""Sweeps of `auto` beside others: what they do with another method's iterate."""

from __future__ import annotations

import numpy as np
import pytest

from fcsim.arrays import FloatArray
from fcsim.bench.families import problems
from fcsim.problem import LocalProblem
from fcsim.problem.reduction import reduce
from fcsim.solvers import solve
from fcsim.solvers.automatic import methods
from fcsim.solvers.automatic.costs import Prices
from fcsim.solvers.automatic.race import Race, ShareOfMonitor
from fcsim.solvers.automatic.stages import AutomaticOptions
from fcsim.solvers.base import Iterate, Monitor, Status

AFTER = 10
"""Turns after which another method's iterate is there."""
CLAIMED = 3e-8
"""The error that is said to be its own."""


@pytest.fixture(scope="module")
def bed() -> LocalProblem:
    """Balls that sweeps alone take some thousand of sweeps for."""
    made = problems("spheres", 100, 0)
    return (made if isinstance(made, LocalProblem) else reduce(made).local).stored()


def swept(problem: LocalProblem, found: FloatArray | None = None) -> tuple[Iterate | None, ShareOfMonitor]:
    """The end of the sweeps from zero, None where they have none, and their monitor; found: the iterate of another method."""
    zero = np.zeros(problem.m)
    whole = Monitor(problem.q, problem.mu, problem.dimension, 1e-8, compliance=problem.compliance)
    prices = Prices(problem, problem.delassus.entries, None)
    race = Race(problem, problem, whole, AutomaticOptions(), prices, False, None, zero)
    monitor = ShareOfMonitor(whole)
    turns = methods.sweeps(race, monitor)
    for turn in range(1000):
        try:
            next(turns)
        except StopIteration as stop:
            return stop.value, monitor
        if turn == AFTER and found is not None:
            whole.best, whole.best_r = CLAIMED, found
    return None, monitor


def test_sweeps_that_come_no_nearer_from_anothers_iterate_go_on_where_they_were(bed: LocalProblem) -> None:
    """From zero they would need as long as before: its error is not what it is said to be, so that no turn brings it down."""
    alone, own = swept(bed)
    beside, monitor = swept(bed, np.zeros(bed.m))
    assert alone is not None and beside is not None
    assert alone.status is beside.status is Status.SOLVED
    assert own.iterations > 1000
    assert own.iterations < monitor.iterations <= own.iterations + (methods.TRIED + 1) * methods.LONGEST_TURN
    u = bed.W @ beside.r + bed.q
    assert Monitor(bed.q, bed.mu, bed.dimension, 1e-8, compliance=bed.compliance).error(beside.r, u) <= 1e-8


def test_sweeps_go_on_from_anothers_iterate_that_brings_them_nearer(bed: LocalProblem) -> None:
    answer = solve(bed, "PROX-NEWTON", tol=1e-10)
    assert answer.solved
    _, own = swept(bed)
    beside, monitor = swept(bed, answer.r * (1 + 1e-7))
    assert beside is not None and beside.status is Status.SOLVED
    assert monitor.iterations < own.iterations / 2
