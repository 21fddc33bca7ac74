"""NSGS-AA: its mixing where theory knows what it does, and what it is for: fewer sweeps, and problems that sweeps alone do not solve."""

from __future__ import annotations

import numpy as np
import pytest

from fcsim.bench.families import problems
from fcsim.errors import InputError
from fcsim.solvers import solve
from fcsim.solvers.gauss_seidel.anderson import Mixing


@pytest.mark.parametrize("size", [2, 4, 6])
def test_an_affine_map_is_solved_in_as_many_steps_as_it_has_unknowns(size: int) -> None:
    """Type II mixing of the whole history is GMRES (Walker, Ni 2011, theorem 2.2): size + 1 images, however slowly the map contracts.

    The last of them is exact but for round-off, which the normal equations square: a millionth where the map itself leaves half."""
    rng = np.random.default_rng(size)
    Q = np.linalg.qr(rng.standard_normal((size, size)))[0]
    A, b = Q @ np.diag(np.linspace(-0.9, 0.99, size)) @ Q.T, rng.standard_normal(size)
    x, mixing = np.zeros(size), Mixing(size, 1e9)
    for _ in range(size + 1):
        x = mixing.next(x, A @ x + b)
    assert np.linalg.norm(A @ x + b - x) <= 1e-6 * np.linalg.norm(b)


def test_a_step_that_grows_forgets_the_others() -> None:
    mixing = Mixing(5, 1.0)
    x, g = np.zeros(2), np.array([0.1, 0.2])
    assert np.array_equal(mixing.next(x, g), g)
    grown = np.array([3.0, 4.0])
    assert np.array_equal(mixing.next(g, grown), grown)
    assert not np.array_equal(mixing.next(grown, grown + 1e-3), grown + 1e-3)


def test_a_difference_that_is_no_number_leaves_the_points_after_it_as_they_are() -> None:
    mixing, x = Mixing(3, 1e9), np.array([1.0, 2.0])
    mixing.next(x, np.array([np.nan, 3.0]))
    for g in (x + 0.5, x - 0.1):
        assert np.array_equal(mixing.next(x, g), g)


def test_a_fixed_point_stays() -> None:
    mixing, x = Mixing(3, 1.0), np.array([1.0, 2.0])
    for _ in range(3):
        assert np.array_equal(mixing.next(x, x.copy()), x)


def test_the_window_is_the_last_differences_whatever_came_before() -> None:
    """By least squares over all of them at once (Walker, Ni 2011, eq. 2.2), after the window has been gone round twice."""
    rng = np.random.default_rng(3)
    size, window = 8, 3
    A, b = np.diag(np.linspace(-0.5, 0.6, size)), rng.standard_normal(size)
    mixing, points, images = Mixing(window, 1e9), [rng.standard_normal(size)], []
    for _ in range(2 * window + 2):
        images.append(A @ points[-1] + b)
        points.append(mixing.next(points[-1], images[-1]))
        f, g = (np.array(images) - np.array(points[:-1]))[-window - 1 :], np.array(images)[-window - 1 :]
        gamma = np.linalg.lstsq(np.diff(f, axis=0).T, f[-1])[0]
        assert np.allclose(points[-1], g[-1] - gamma @ np.diff(g, axis=0), rtol=0, atol=1e-7 * np.linalg.norm(b))


@pytest.mark.parametrize(("family", "seed"), [("walls", 1), ("boxes", 0), ("rocks", 2)])
def test_fewer_sweeps_than_gauss_seidel_on_rank_deficient_problems(family: str, seed: int) -> None:
    problem = problems(family, 200, seed)
    plain, mixed = (solve(problem, name, tol=1e-7) for name in ("NSGS-AC", "NSGS-AA"))
    assert plain.solved and mixed.solved
    assert 4 * mixed.iterations < plain.iterations


def test_more_problems_than_sweeps_of_widely_different_friction() -> None:
    """Which ones differs with the last bits: four and seven of these eight where it was counted."""
    piles = [problems("frictions", 60, seed) for seed in range(8)]
    plain, mixed = (sum(solve(pile, name, tol=1e-8).solved for pile in piles) for name in ("NSGS-AC", "NSGS-AA"))
    assert mixed > plain


@pytest.mark.parametrize(("option", "value"), [("window", 0), ("restart", 0.5)])
def test_options_out_of_range(option: str, value: float) -> None:
    with pytest.raises(InputError, match=f"option {option}"):
        solve(problems("boxes", 10, 0), "NSGS-AA", **{option: value})
