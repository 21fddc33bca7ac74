"""Proximal Newton's inner problems in the bodies' velocities in one compiled loop: the same iterations as by the general way."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.bench.families import problems
from fcsim.linear import storage
from fcsim.problem import GlobalProblem, LocalProblem, scaled_error
from fcsim.problem.reduction import reduce
from fcsim.solvers import Status, solve
from fcsim.solvers.base import Monitor
from fcsim.solvers.newton._formulation_kernels import disk_equations
from fcsim.solvers.newton.options import NewtonOptions
from fcsim.solvers.proximal import inner
from fcsim.solvers.proximal._velocity_kernels import eliminated
from fcsim.solvers.proximal.in_velocities import NewtonInVelocities, newton_here

OPTIONS = NewtonOptions(formulation="AC", rho="adaptive", max_iterations=15)


def blocks(family: str, size: int = 200, seed: int = 3) -> LocalProblem:
    """One of a family of rigid blocks, whose bodies are known and have few velocities."""
    made = problems(family, size, seed)
    assert isinstance(made, GlobalProblem)
    return reduce(made).local


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("error", ["scaled", "published"])
@pytest.mark.parametrize("family", ["walls", "walls-2D"])
def test_iterations_are_those_of_the_general_way(family: str, error: str, sparse: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """In 3D and 2D, with either elimination; the last bits differ, so that few iterations are compared and then the answers."""
    if sparse:
        monkeypatch.setattr(storage, "DENSE_UP_TO", 0)
    assert newton_here(blocks(family), OPTIONS)
    begun = solve(blocks(family), "PROX-NEWTON", error=error, max_iterations=12)
    there = solve(blocks(family), "PROX-NEWTON", error=error, tol=1e-9)
    monkeypatch.setattr(inner, "newton_here", lambda problem, options: False)
    begins = solve(blocks(family), "PROX-NEWTON", error=error, max_iterations=12)
    assert_allclose(begun.r, begins.r, rtol=0, atol=1e-8 * np.abs(begins.r).max())
    rows, others = (np.array([(row[0], row[2]) for row in result.history[:3]]) for result in (begun, begins))
    assert len(rows) == 3
    assert_allclose(rows, others, rtol=1e-8, atol=0)
    general = solve(blocks(family), "PROX-NEWTON", error=error, tol=1e-9)
    assert there.solved and general.solved
    assert_allclose(there.u, general.u, rtol=0, atol=1e-6 * np.abs(blocks(family).q).max())


def test_the_answer_is_that_of_its_own_problem() -> None:
    """The regularised problem is solved to the residual asked for, by an error that is computed without the bodies."""
    problem = blocks("walls")
    shift = 1e-2 * problem.compliance
    regularised = LocalProblem(problem.delassus.shifted(shift).matrix, problem.q, problem.mu)
    watch = Monitor(problem.q, problem.mu, 3, 1e-10, compliance=regularised.compliance)
    found = NewtonInVelocities(problem, OPTIONS)(shift, problem.q, np.zeros(problem.m), watch, 40)
    assert found.status is Status.SOLVED
    assert scaled_error(regularised, found.r) <= 1e-10
    assert 1 < watch.iterations <= 15


def test_how_it_ends_without_an_answer() -> None:
    """At its iterations, where the best iterate is kept; at numbers that are none; at a matrix without a pivot."""
    problem = blocks("walls")
    shift, zero = 1e-2 * problem.compliance, np.zeros(problem.m)
    watch = Monitor(problem.q, problem.mu, 3, 1e-10, compliance=problem.compliance)
    newton = NewtonInVelocities(problem, OPTIONS)
    found = newton(shift, problem.q, zero, watch, 2)
    assert found.status is Status.MAX_ITERATIONS and watch.iterations == 2
    assert watch.best_r is not None and watch.best < 1.0
    endless = Monitor(problem.q, problem.mu, 3, 1e-10, compliance=problem.compliance)
    with np.errstate(invalid="ignore", over="ignore"):
        assert newton(shift, problem.q, np.full(problem.m, 1e300), endless, 15).status is Status.DIVERGED
    watch = Monitor(problem.q, problem.mu, 3, 1e-10, compliance=problem.compliance)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = newton(0 * shift, problem.q, zero, watch, 15)
    assert found.status is Status.SINGULAR  # sticking contacts have no equations of their own without a shift


@pytest.mark.parametrize(
    "options",
    [{"formulation": "FB"}, {"line_search": "Armijo"}, {"rho": "spectral norm"}, {"patience": 3}, {"longest": 1e6}, {"safeguard": True}],
)
def test_other_options_are_left_to_the_general_way(options: dict[str, object]) -> None:
    chosen: dict[str, object] = {"formulation": "AC", "rho": "adaptive"} | options
    assert not newton_here(blocks("walls"), NewtonOptions(**chosen))  # type: ignore[arg-type]


@pytest.mark.parametrize("d", [2, 3])
def test_contacts_own_equations_in_closed_form(d: int) -> None:
    """K = C^-1 A, c = -C^-1 F of Alart and Curnier's F, C = A D + B: open, sticking, sliding, at the apex, without friction."""
    rng, nc = np.random.default_rng(6), 400
    r, u = rng.standard_normal((nc, d)), rng.standard_normal((nc, d))
    mu, rho, shift = rng.choice([0.0, 0.3, 2.0], nc), rng.uniform(0.1, 3.0, (nc, d)), rng.uniform(0.01, 2.0, (nc, d))
    rho[:, -1] = rho[:, 1]
    r[:20], u[:20] = 0.0, 0.0
    r[20:40, 1:], u[20:40, 1:] = 0.0, 0.0
    K, c = np.full((nc, d, d), np.nan), np.full((nc, d), np.nan)
    assert eliminated(u, r, mu, rho, shift, K, c) == -1
    F, A, B = disk_equations(u, r, mu, rho, False)
    C = A * shift[:, None, :] + B
    assert len({tuple(row) for row in (np.abs(K) > 0).reshape(nc, -1)}) >= 3
    assert_allclose(K, np.linalg.solve(C, A), rtol=0, atol=1e-11)
    assert_allclose(c, -np.linalg.solve(C, F[:, :, None])[:, :, 0], rtol=0, atol=1e-11)
    r[7, 0], u[7, 0], shift[7, 0] = 1.0, 0.0, 0.0
    assert eliminated(u, r, mu, rho, shift, K, c) == 7
