"""What `auto` leaves behind."""

import gc
import weakref

import numpy as np

from fcsim.problem import LocalProblem
from fcsim.solvers import solve


def test_a_solved_problem_goes_with_its_last_name() -> None:
    """Stages that were left before their end held the race, and the race them: in a run of many steps the W of each stayed."""
    random = np.random.default_rng(0)
    for k in range(12):
        A = random.standard_normal((60, 24))
        problem = LocalProblem(A @ A.T, random.standard_normal(60), np.full(20, 0.1 + 0.2 * (k % 6)))
        gone = weakref.ref(problem.delassus)
        gc.collect()
        gc.disable()
        try:
            solve(problem, "auto", time_limit=5.0)
            del problem
            assert gone() is None or k < 6  # at first: what compiles methods holds on to what it compiled them for
        finally:
            gc.enable()
