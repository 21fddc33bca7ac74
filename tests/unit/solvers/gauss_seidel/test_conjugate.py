"""NNCG: its direction beside the formulas, and what it is for: fewer sweeps where W is rank deficient."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.bench.families import problems
from fcsim.solvers import solve
from fcsim.solvers.gauss_seidel._conjugate_kernels import follow_direction
from fcsim.solvers.gauss_seidel._sweep_kernels import change_to_await, change_to_await_next


@pytest.mark.parametrize("last", [0.0, 1e-3, 1e6])
def test_direction_by_the_paper_s_steps(last: float) -> None:
    rng = np.random.default_rng(1)
    before, after, direction = (rng.standard_normal((7, 3)) for _ in range(3))
    after[3] = before[3]
    g = before - after
    beta = np.sum(g * g) / last if last else 2.0
    moved = np.any(g != 0, axis=1)[:, None]
    p = np.where(moved, beta * direction - g, 0.0) if beta <= 1 else np.zeros((7, 3))
    start = after + beta * direction * moved if beta <= 1 else after
    square, size = follow_direction(before, after, direction, last)
    assert_allclose(before, start)
    assert_allclose(direction, p)
    assert_allclose([square, size], [np.sum(g * g), np.sum(after * after)])


@pytest.mark.parametrize(("family", "seed"), [("walls", 1), ("boxes", 0), ("rocks", 2)])
def test_half_the_sweeps_of_gauss_seidel_on_rank_deficient_problems(family: str, seed: int) -> None:
    problem = problems(family, 200, seed)
    plain, conjugate = (solve(problem, name, tol=1e-7) for name in ("NSGS-AC", "NNCG"))
    assert plain.solved and conjugate.solved
    assert 2 * conjugate.iterations < plain.iterations


@pytest.mark.parametrize(("change", "share", "awaited"), [(1e-5, 0.1, 1e-6), (9e-5, 0.9, 5e-5), (1e-6, 1e-6, 1e-7)])
def test_the_next_change_to_await_is_in_proportion_but_neither_too_near_nor_too_far(change: float, share: float, awaited: float) -> None:
    """1e-4 was awaited: a half of it at the most, a thousandth at the least; in Python and compiled."""
    for by in (change_to_await, change_to_await_next):
        assert by(1e-4, change, share) == pytest.approx(awaited, rel=1e-12)


@pytest.mark.parametrize("size", [100, 600])
def test_sweeps_of_auto_do_not_look_at_the_error_after_each_where_heavy_bodies_hide_the_light_ones(size: int) -> None:
    """Masses of 1 to 1e9: a sweep changes all reactions together by less than the tolerance from the first one on."""
    result = solve(problems("mass-ratios", size, 811), "auto", tol=1e-4, max_iterations=3000)
    assert result.iterations > 500
    assert len(result.history) < 0.2 * result.iterations
