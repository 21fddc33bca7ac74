"""`solve_many` is `solve` for each problem, in order, on any number of threads."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fcsim.errors import InputError
from fcsim.linear.factors import SingularMatrix
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.solvers import solve, solve_many


def problems(count: int = 9) -> list[LocalProblem]:
    found = []
    for seed in range(count):
        rng, nc = np.random.default_rng(seed), 1 + 9 * seed
        H = rng.standard_normal((4 * nc, 3 * nc)) / np.sqrt(nc)
        found.append(LocalProblem(H.T @ H, rng.standard_normal(3 * nc) - np.tile([0.5, 0, 0], nc), np.full(nc, 0.6)))
    return found


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("name", ["auto", "NSGS-AC", "NSN-AC"])
def test_each_as_alone(name: str, threads: int) -> None:
    given = problems()
    for found, p in zip(solve_many(given, name, threads=threads), given, strict=True):
        alone = solve(p, name)
        assert found.status is alone.status
        assert np.array_equal(found.r, alone.r)


def test_starts_and_options_reach_the_method() -> None:
    given = problems(3)
    starts = [solve(p, "auto", tol=1e-12).r for p in given]
    assert [result.iterations for result in solve_many(given, "NSGS-AC", starts)] == [0, 0, 0]
    assert all(result.iterations <= 2 for result in solve_many(given, "NSGS-AC", max_iterations=2, threads=2))
    assert all(result.error <= 1e-12 for result in solve_many(given, tol=1e-12))


def test_kinds_may_be_mixed_and_none_is_none() -> None:
    H = np.eye(3)
    ball = GlobalProblem(2 * np.eye(3), H, np.array([-1.0, 0.2, 0]), np.zeros(3), np.array([0.5]))
    found = solve_many([ball, *problems(2)], threads=2)
    assert found[0].v is not None and found[1].v is None
    assert solve_many([]) == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"threads": 0}, "threads: expected a whole number >= 1, got 0"),
        ({"threads": 1.5}, "threads"),
        ({"solver": "magic"}, "solver 'magic'"),
        ({"starts": [None]}, "starts: expected one for each of 2 problems, got 1"),
        ({"starts": [None, np.zeros(4)]}, r"problems\[1\]: r: expected a starting point"),
        ({"starts": 5}, "starts: expected a list of starting points, got a int"),
        ({"tol": 0.0}, r"problems\[0\]: tol"),
        ({"memory": None}, "memory"),
        ({"magic": 1}, r"problems\[0\]: option 'magic'"),
    ],
)
def test_mistakes_are_named(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        solve_many(problems(2), **arguments)


def test_what_is_no_problem_is_named_by_its_place() -> None:
    given: list[Any] = [*problems(1), "a problem"]
    with pytest.raises(InputError, match=r"problems\[1\]: problem: expected a GlobalProblem"):
        solve_many(given, threads=2)


@pytest.mark.parametrize("threads", [1, 2])
def test_a_singular_problem_is_named_by_its_place(threads: int) -> None:
    singular = GlobalProblem(np.zeros((3, 3)), np.eye(3), np.ones(3), np.zeros(3), np.array([0.5]))
    with pytest.raises(SingularMatrix, match=r"problems\[1\]: M is singular"):
        solve_many([*problems(1), singular], threads=threads)


@pytest.mark.parametrize("problems", [None, LocalProblem(np.eye(3), np.array([-1.0, 0, 0]), np.ones(1))])
def test_what_is_no_list_is_refused(problems: Any) -> None:
    with pytest.raises(InputError, match="problems: expected a list of problems, got a"):
        solve_many(problems)
