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
    assert mixing.next(x, g) is g
    grown = np.array([3.0, 4.0])
    assert mixing.next(g, grown) is grown
    assert mixing.next(grown, grown + 1e-3) is not grown


def test_a_fixed_point_stays() -> None:
    mixing, x = Mixing(3, 1.0), np.array([1.0, 2.0])
    for _ in range(3):
        assert np.array_equal(mixing.next(x, x.copy()), x)


@pytest.mark.parametrize(("family", "seed"), [("walls", 1), ("boxes", 0), ("rocks", 2)])
def test_fewer_sweeps_than_gauss_seidel_on_rank_deficient_problems(family: str, seed: int) -> None:
    problem = problems(family, 200, seed)
    plain, mixed = (solve(problem, name, tol=1e-7) for name in ("NSGS-AC", "NSGS-AA"))
    assert plain.solved and mixed.solved
    assert 4 * mixed.iterations < plain.iterations


def test_a_problem_that_sweeps_and_their_conjugate_gradients_do_not_solve() -> None:
    problem = problems("frictions", 100, 1)
    assert [solve(problem, name, tol=1e-8).solved for name in ("NSGS-AC", "NNCG", "NSGS-AA")] == [False, False, True]


@pytest.mark.parametrize(("option", "value"), [("window", 0), ("restart", 0.5)])
def test_options_out_of_range(option: str, value: float) -> None:
    with pytest.raises(InputError, match=f"option {option}"):
        solve(problems("boxes", 10, 0), "NSGS-AA", **{option: value})
