"""ADMM among the stages: it goes on by other options, from zero anew, once that is due."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.testing import assert_array_equal

from fcsim.bench.families import problems
from fcsim.problem.reduction import reduce
from fcsim.solvers.automatic.methods import SPLITTING, SPLITTING_OF_BEDS, splitting
from fcsim.solvers.automatic.race import ShareOfMonitor
from fcsim.solvers.base import Monitor, Status
from fcsim.solvers.turns import to_the_end
from fcsim.solvers.variational.admm import AdmmOptions

PROBLEM = reduce(problems("frictions", 60, 3)).local  # type: ignore[arg-type]


def admm(options: AdmmOptions, others: AdmmOptions | None = None, after: int = 0) -> tuple[np.ndarray, int]:
    """Reactions and iterations; by the others from after so many iterations."""
    monitor = ShareOfMonitor(Monitor(PROBLEM.q, PROBLEM.mu, PROBLEM.dimension, 1e-4, compliance=PROBLEM.delassus.compliance))
    race: Any = SimpleNamespace(problem=PROBLEM)
    iterate = to_the_end(splitting(race, monitor, options, others, lambda: monitor.iterations >= after))
    assert iterate.status is Status.SOLVED
    return iterate.r, monitor.iterations


def test_it_begins_anew_by_the_other_options_once_that_is_due() -> None:
    by_rule, needed = admm(SPLITTING)
    by_other, others_need = admm(SPLITTING_OF_BEDS)
    assert needed > 5 and not np.array_equal(by_rule, by_other)
    r, iterations = admm(SPLITTING, SPLITTING_OF_BEDS, after=5)
    assert_array_equal(r, by_other)
    assert iterations == 5 + others_need
    r, iterations = admm(SPLITTING, SPLITTING_OF_BEDS, after=10**6)
    assert_array_equal(r, by_rule)
    assert iterations == needed
