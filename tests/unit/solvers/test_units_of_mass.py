"""Units of mass that no float32 and no absolute threshold survives: what is solved in one of them is solved in all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from fcsim.bench.families import problems
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.solvers import Status, solve
from fcsim.solvers.newton.systems import condensed as condensed_system


def slack(problem: LocalProblem, r: np.ndarray) -> float:
    """The largest violation of the law, each contact's part in the unit of its own velocity; statics in place of the natural map."""
    shape = (-1, problem.dimension)
    u, r = (problem.W @ r + problem.q).reshape(shape), r.reshape(shape)
    s = np.diag(problem.W).reshape(shape).mean(axis=1)
    slip, pull = np.linalg.norm(u[:, 1:], axis=1), np.linalg.norm(r[:, 1:], axis=1)
    bound = problem.mu * r[:, 0]
    beside = np.abs(pull - bound)  # of a contact that slips: against its slip, and on the cone
    opposed = np.abs((u[:, 1:] * r[:, 1:]).sum(axis=1) + slip * pull) / np.where(slip > 0, slip, 1.0)
    parts = (
        np.maximum(-u[:, 0], 0),
        s * np.maximum(-r[:, 0], 0),
        np.minimum(np.abs(u[:, 0]), s * np.abs(r[:, 0])),
        s * np.maximum(pull - bound, 0),
        np.minimum(slip, s * (beside + opposed)),
    )
    return float(max(part.max() for part in parts) / np.linalg.norm(problem.q))


@pytest.mark.parametrize("unit", [1e-36, 1.0, 1e36])
def test_a_border_in_single_precision_whatever_the_unit(unit: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """W of rank 144 of 180 has no factor in single precision but on what sticks; its columns are W^-1/2 in size, their response W^-1."""
    monkeypatch.setattr(condensed_system, "SINGLE_FROM", 0)
    rng = np.random.default_rng(911)
    A = rng.standard_normal((180, 144)) / np.sqrt(180)
    problem = LocalProblem(unit * A @ A.T, np.sqrt(unit) * A @ rng.standard_normal(144), rng.uniform(0.1, 1.2, 60))
    result = solve(problem, "NSN-AC", tol=1e-10)
    assert result.status is Status.SOLVED
    assert slack(problem, result.r) < 1e-9


@pytest.mark.parametrize("family", ["walls-2D", "boxes", "arches"])
def test_paths_are_the_same_in_all_units_of_mass(family: str) -> None:
    """Bit by bit where the unit is a power of two: no threshold on the way is absolute."""
    given = problems(family, 45, 921)
    assert isinstance(given, GlobalProblem)
    first = solve(given, "PROX-PATH", tol=1e-8, before=0)
    assert first.status is Status.SOLVED
    for unit in (2.0**-60, 2.0**60):
        other = solve(replace(given, M=unit * given.M, f=unit * given.f), "PROX-PATH", tol=1e-8, before=0)
        assert other.status is Status.SOLVED
        assert other.iterations == first.iterations
        assert_array_equal(other.r, unit * first.r)
