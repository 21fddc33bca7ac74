"""Projection methods: answers against Newton's and the error in NumPy, steps and ratios by hand, options."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.errors import InputError
from fcsim.problem import LocalProblem
from fcsim.solvers import SOLVERS, Status, solve
from fcsim.solvers.base import Monitor
from fcsim.solvers.variational.inequality import Inequality
from fcsim.solvers.variational.projection import HyperplaneOptions, khobotov_ratio, project_on_hyperplanes, solodov_tseng_ratio
from fcsim.solvers.variational.watches import ProblemWatch

NAMES = [name for name, method in SOLVERS.items() if method.family == "projection"]


def test_all_are_in_the_table() -> None:
    assert set(NAMES) >= {"FP-DS", "EG", "HP", "FP-VI-UPK", "FP-VI-UTK", "EG-VI-UPK", "EG-VI-UTK"}


@pytest.mark.parametrize("name", NAMES)
def test_answers(name: str, coulomb_problem: LocalProblem, error_of: Callable[..., float]) -> None:
    result = solve(coulomb_problem, name, tol=1e-9)
    assert result.status is Status.SOLVED
    assert error_of(coulomb_problem, result.r) <= 1.001e-9
    newton = solve(coulomb_problem, "NSGS-AC", tol=1e-11)
    assert_allclose(result.u, newton.u, atol=2e-8 * max(1, np.linalg.norm(newton.r)))


@pytest.mark.parametrize("name", NAMES)
def test_warm_start(name: str, coulomb_problems: dict[str, Callable[[], LocalProblem]]) -> None:
    problem = coulomb_problems["full rank"]()
    cold = solve(problem, name, tol=1e-9)
    again = solve(problem, name, r=cold.r, tol=1e-8)
    assert again.solved and again.iterations == 0
    nearby = solve(problem, name, r=1.001 * cold.r, tol=1e-8)
    assert nearby.solved and nearby.iterations <= cold.iterations


@pytest.mark.parametrize("name", NAMES)
def test_honest_stops(name: str, coulomb_problems: dict[str, Callable[[], LocalProblem]]) -> None:
    problem = coulomb_problems["full rank"]()
    few = solve(problem, name, max_iterations=3, tol=1e-12)
    assert few.status is Status.MAX_ITERATIONS and few.iterations == 3 and few.error > 1e-12
    assert solve(problem, name, time_limit=0.0, tol=1e-12).status is Status.TIME_LIMIT
    assert solve(problem, name, max_iterations=3, tol=1e-12).error == pytest.approx(min(row[2] for row in few.history))


@pytest.mark.parametrize("name", ["FP-DS", "EG"])
def test_a_step_too_long_is_not_called_solved(name: str, coulomb_problems: dict[str, Callable[[], LocalProblem]]) -> None:
    result = solve(coulomb_problems["full rank"](), name, rho=1e6, max_iterations=300)
    assert not result.solved and result.error > 1e-8


@pytest.mark.parametrize("name", ["FP-VI-UPK", "FP-VI-UTK", "EG-VI-UPK", "EG-VI-UTK"])
@pytest.mark.parametrize("rho", [1e-6, 1e6])
def test_self_adaptive_steps_find_their_length(name: str, rho: float, coulomb_problems: dict[str, Callable[[], LocalProblem]]) -> None:
    problem = coulomb_problems["full rank"]()
    assert solve(problem, name, rho=rho).solved
    scaled = LocalProblem(1e4 * problem.W, problem.q, problem.mu)
    assert solve(scaled, name, rho=1.0, tol=1e-10).solved


def test_first_fixed_point_step_by_hand(coulomb_problems: dict[str, Callable[[], LocalProblem]]) -> None:
    """From r = 0 with rho = 2 = 1 / W a sliding block's first step projects -2 (q + g(q)) on the cone."""
    problem = coulomb_problems["sliding block"]()
    q, mu = problem.q, 0.3
    z = -2 * (q + np.r_[mu * abs(q[1]), 0, 0])
    s = (z[0] + mu * abs(z[1])) / (1 + mu**2)
    result = solve(problem, "FP-DS", rho=2.0, max_iterations=1, tol=1e-14)
    assert_allclose(result.r, [s, -mu * s, 0], rtol=1e-14)


def test_ratios() -> None:
    dr, dF = np.array([3.0, 4.0]), np.array([2.0, 0.0])
    assert khobotov_ratio(0.5, dr, dF, 5.0) == pytest.approx(0.5 * 2 / 5)
    assert solodov_tseng_ratio(0.5, dr, dF, 5.0) == pytest.approx(0.5 * 6 / 25)


def test_hyperplane_projection_never_moves_away_from_the_solution(coulomb_problems: dict[str, Callable[[], LocalProblem]]) -> None:
    """Fejér: on a monotone problem (mu = 0) the distance to the solution falls in every iteration."""
    problem = coulomb_problems["frictionless"]()
    solution = solve(problem, "NSN-AC", tol=1e-12).r
    distances = []
    for iterations in range(12):
        monitor = Monitor(problem.q, problem.mu, 3, 1e-14)
        vi = Inequality.coulomb(problem)
        r = project_on_hyperplanes(vi, np.zeros(problem.m), ProblemWatch(vi.velocity, monitor, iterations), HyperplaneOptions()).r
        distances.append(np.linalg.norm((r - solution)[::3]))
    assert np.all(np.diff(distances) < 0)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("FP", {"rho": 0.0}),
        ("EG", {"rho": float("nan")}),
        ("HP", {"rho": -1.0}),
        ("HP", {"sigma": 1.0}),
        ("HP", {"tau": 0.0}),
        ("HP", {"search_iterations": 0}),
        ("FP-VI-UPK", {"tau": 1.0}),
        ("FP-VI-UPK", {"L": 0.2}),
        ("EG-VI-UPK", {"L_min": 0.95}),
        ("EG-VI-UPK", {"step_rule": "Armijo"}),
        ("FP", {"max_iterations": -1}),
        ("FP", {"sigma": 0.5}),
    ],
)
def test_refused_options(name: str, options: dict[str, object], coulomb_problems: dict[str, Callable[[], LocalProblem]]) -> None:
    with pytest.raises(InputError):
        solve(coulomb_problems["full rank"](), name, **options)
