"""Another unit of mass or length is the same problem: `auto` takes the same decisions and finds the same bits, by the scaled error."""

from __future__ import annotations

import numpy as np
import pytest

from fcsim.bench.families import problems
from fcsim.problem import LocalProblem
from fcsim.problem.reduction import reduce
from fcsim.solvers import solve


@pytest.mark.parametrize("family", ["spheres", "walls", "rocks", "towers", "noise"])
def test_the_same_bits_in_any_unit(family: str) -> None:
    """Powers of two leave every rounding as it is; 2^30 is a factor of 1e9."""
    given = problems(family, 40, 0)
    problem = given if isinstance(given, LocalProblem) else reduce(given).local
    reference = solve(problem, "auto", error="scaled")
    assert reference.solved
    for mass, velocity in ((2.0**30, 1.0), (2.0**-30, 1.0), (1.0, 2.0**20), (1.0, 2.0**-20)):
        result = solve(LocalProblem(problem.W / mass, velocity * problem.q, problem.mu), "auto", error="scaled")
        assert result.status is reference.status
        assert result.iterations == reference.iterations
        assert np.array_equal(result.r, mass * velocity * reference.r)
