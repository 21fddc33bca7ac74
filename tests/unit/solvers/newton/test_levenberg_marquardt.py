"""Levenberg-Marquardt on the error: its steps beside the normal equations, rank-deficient problems, problems without a solution."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.problem import LocalProblem
from fcsim.solvers.base import Monitor, Options, Status
from fcsim.solvers.newton import levenberg_marquardt as module
from fcsim.solvers.newton.levenberg_marquardt import DAMPING, _steps, levenberg_marquardt


def stuck(d: int, nc: int = 12, rank: int = 9, slide: float = 0.0) -> tuple[LocalProblem, np.ndarray]:
    """Rank-deficient W = H^T H and a reaction inside the cones, in equilibrium; with `slide` two contacts slide at that speed."""
    rng = np.random.default_rng(5)
    H = rng.standard_normal((rank, d * nc))
    mu = np.full(nc, 0.6)
    r = np.zeros((nc, d))
    r[:, 0] = rng.uniform(1, 2, nc)
    r[:, 1] = 0.3 * r[:, 0]
    u = np.zeros((nc, d))
    if slide:
        r[:2, 1], u[:2, 1] = mu[:2] * r[:2, 0], -slide
    W = H.T @ H
    return LocalProblem(W, u.ravel() - W @ r.ravel(), mu, dimension=d), r.ravel()


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("form", [np.asarray, sp.csr_array])
def test_steps_solve_the_damped_normal_equations(form: Callable[..., Any], d: int) -> None:
    rng = np.random.default_rng(0)
    nc = 6
    W, A, B, F = (rng.standard_normal(s) for s in ((nc * d, nc * d), (nc, d, d), (nc, d, d), (nc, d)))
    A[[1, 4]], B[[1, 4]] = 0, np.eye(d)
    length = rng.uniform(0.5, 2, nc * d)
    weight = rng.uniform(0.5, 2, nc)
    steps = _steps(form(W), F, A, B, length, weight)
    assert steps is not None and steps.shape == (nc * d, len(DAMPING))
    J = np.vstack([A[a] @ W[d * a : d * a + d] for a in range(nc)])
    for a in range(nc):
        J[d * a : d * a + d, d * a : d * a + d] += B[a]
    dofs = np.setdiff1d(np.arange(nc * d), [*range(d, 2 * d), *range(4 * d, 5 * d)])
    others = np.setdiff1d(np.arange(nc * d), dofs)
    by_row = np.repeat(weight, d)[dofs]
    scaled = by_row[:, None] * J[np.ix_(dofs, dofs)] * length[dofs]
    largest = np.linalg.norm(scaled, 2)
    for dr, damping in zip(steps.T, DAMPING, strict=True):
        assert_allclose(dr[others], -F.ravel()[others], rtol=1e-14)
        s = dr[dofs] / length[dofs]
        residual = scaled @ s + by_row * (J[np.ix_(dofs, others)] @ dr[others] + F.ravel()[dofs])
        assert_allclose(scaled.T @ residual + (damping * largest) ** 2 * s, 0, atol=1e-9 * largest)


@pytest.mark.parametrize("slide", [0.0, 0.2])
@pytest.mark.parametrize("d", [2, 3])
def test_solves_where_newton_s_matrix_is_singular(d: int, slide: float, natural_map_error: Callable[..., float]) -> None:
    problem, r = stuck(d, slide=slide)
    assert np.linalg.matrix_rank(problem.W) < problem.m / 2
    start = r * (1 + 1e-3 * np.random.default_rng(1).standard_normal(problem.m))
    monitor = Monitor(problem.q, problem.mu, d, 1e-11)
    found = levenberg_marquardt(problem, start, monitor, Options(max_iterations=50))
    assert found.status is Status.SOLVED
    assert monitor.iterations <= 20
    assert natural_map_error(problem, found.r) <= 1.01e-11


def test_noise_without_a_solution_ends_at_a_lesser_error() -> None:
    """Noise on rank-deficient W: what is found is no worse than the start, and a status other than SOLVED says that it is not enough."""
    exact, r = stuck(3)
    noisy = LocalProblem(exact.W * (1 + 1e-6 * np.random.default_rng(2).standard_normal(exact.W.shape)), exact.q, exact.mu)
    monitor = Monitor(noisy.q, noisy.mu, 3, 1e-16)
    start = monitor.error(r, noisy.W @ r + noisy.q)
    found = levenberg_marquardt(noisy, r, monitor, Options(max_iterations=50))
    assert found.status is Status.STAGNATED
    assert monitor.error(found.r, noisy.W @ found.r + noisy.q) < 0.8 * start


def test_no_solution_at_all() -> None:
    """W = 0 and an approaching body: nothing helps, and nothing is claimed."""
    problem = LocalProblem(np.zeros((3, 3)), np.array([-1.0, 0.0, 0.0]), np.array([0.5]))
    monitor = Monitor(problem.q, problem.mu, 3, 1e-8)
    found = levenberg_marquardt(problem, np.ones(3), monitor, Options(max_iterations=50))
    assert found.status is Status.STAGNATED
    assert monitor.best > 0.1


def test_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, r = stuck(3)
    assert (
        levenberg_marquardt(problem, 1.1 * r, Monitor(problem.q, problem.mu, 3, 1e-30), Options(max_iterations=0)).status
        is Status.MAX_ITERATIONS
    )
    late = Monitor(problem.q, problem.mu, 3, 1e-30, time_limit=0.0)
    assert levenberg_marquardt(problem, 1.1 * r, late, Options(max_iterations=50)).status is Status.TIME_LIMIT
    monkeypatch.setattr(module, "LARGEST", 10)
    monitor = Monitor(problem.q, problem.mu, 3, 1e-30)
    found = levenberg_marquardt(problem, 1.1 * r, monitor, Options(max_iterations=50))
    assert found.status is Status.STAGNATED and monitor.iterations == 0
    assert_array_equal(found.r, 1.1 * r)


def test_an_error_that_only_its_own_velocities_reach_ends_it() -> None:
    """With u from other equations, 1e-3 of ||q|| from W r + q, steps that W calls solutions are none: it ends instead of going on."""
    problem, r = stuck(3, slide=0.1)
    away = 1e-3 * float(np.linalg.norm(problem.q)) * np.tile([-1.0, 0.0, 0.0], problem.nc) / np.sqrt(problem.nc)
    monitor = Monitor(problem.q, problem.mu, 3, 1e-8, velocity=lambda r: problem.W @ r + problem.q + away)
    found = levenberg_marquardt(problem, 1.01 * r, monitor, Options(max_iterations=1000))
    assert found.status is Status.STAGNATED and monitor.iterations < 100
