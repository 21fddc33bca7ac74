"""The choice of problems of graded difficulty, against divisions made by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fcsim.collection import choose
from fcsim.collection.grade import difficulty_classes, shares


def test_evenly_over_difficulty_and_time() -> None:
    """90 problems of 1, 10 and 100 iterations in turn; 9 of them: 3 of each difficulty, one in each third of the time."""
    iterations = np.tile([1, 10, 100], 30)
    for seed in range(5):
        places = choose(iterations, np.ones(90, dtype=bool), 9, seed)
        assert len(np.unique(places)) == 9
        pairs = set(zip(iterations[places].tolist(), (places // 30).tolist(), strict=True))
        assert pairs == {(k, third) for k in (1, 10, 100) for third in range(3)}


def test_rare_difficulties_are_all_taken() -> None:
    """97 problems of 10 iterations, two of 1000, one unsolved: the three are chosen, the others evenly over time."""
    iterations, solved = np.full(100, 10), np.ones(100, dtype=bool)
    iterations[[7, 55]], solved[30] = 1000, False
    places = choose(iterations, solved, 23)
    assert len(places) == 23 and {7, 30, 55} <= set(places.tolist())
    per_quarter = np.bincount(places // 25, minlength=4)
    assert per_quarter.min() >= 4 and per_quarter.max() <= 8


def test_reproducible_and_seeded() -> None:
    rng = np.random.default_rng(1)
    iterations, solved = rng.integers(1, 60, 200), rng.random(200) < 0.9
    first = choose(iterations, solved, 50, seed=3)
    assert np.array_equal(first, choose(iterations, solved, 50, seed=3))
    assert not np.array_equal(first, choose(iterations, solved, 50, seed=4))
    assert np.array_equal(first, np.unique(first)) and len(first) == 50


def test_classes() -> None:
    """The range 1 ... 1000 in three: 1 to 10, 10 to 100, 100 to 1000; unsolved ones are a class of their own."""
    label = difficulty_classes(np.array([1, 9, 11, 99, 101, 1000, 5]), np.array([True] * 6 + [False]), 3)
    assert label.tolist() == [0, 0, 1, 1, 2, 2, 3]
    assert difficulty_classes(np.array([4, 4]), np.array([True, True]), 3).tolist() == [0, 0]
    assert difficulty_classes(np.array([4, 4]), np.array([False, False]), 3).tolist() == [3, 3]


@given(st.lists(st.integers(0, 20), min_size=1, max_size=12), st.integers(0, 150), st.integers(0, 5))
def test_shares(sizes: list[int], total: int, seed: int) -> None:
    share = shares(total, np.array(sizes), np.random.default_rng(seed))
    assert share.sum() == min(total, sum(sizes))
    assert np.all((share >= 0) & (share <= sizes))
    room = share < sizes  # cells with something left got as much as any other, but for one
    if room.any():
        assert share.max() - share[room].min() <= 1


@given(st.lists(st.tuples(st.integers(0, 10_000), st.booleans()), min_size=1, max_size=60), st.integers(1, 70), st.integers(0, 3))
def test_any_problems(problems: list[tuple[int, bool]], count: int, seed: int) -> None:
    iterations, solved = np.array([p[0] for p in problems]), np.array([p[1] for p in problems])
    places = choose(iterations, solved, count, seed)
    assert len(places) == len(np.unique(places)) == min(count, len(problems))
    assert places.min() >= 0 and places.max() < len(problems)


@pytest.mark.parametrize("count", [3, 5])
def test_all_where_more_are_asked_for(count: int) -> None:
    assert choose(np.array([1, 2, 3]), np.array([True, False, True]), count).tolist() == [0, 1, 2]
