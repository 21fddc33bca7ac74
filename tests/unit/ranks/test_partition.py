"""Bodies cut into neighbourhoods of equal cost."""

from __future__ import annotations

import numpy as np
import pytest

from fcsim.ranks.partition import partition


@pytest.mark.parametrize("ranks", [1, 2, 3, 4, 7, 16])
def test_a_grid_is_cut_evenly(ranks: int) -> None:
    centres = np.stack(np.meshgrid(*map(np.arange, (16.0, 14.0))), axis=-1).reshape(-1, 2)
    rank = partition(centres, np.ones(len(centres)), ranks)
    sizes = np.bincount(rank, minlength=ranks)
    assert len(sizes) == ranks and np.all(abs(sizes - len(centres) / ranks) <= 3)  # a cut rounds once, and there are log2(16) of them


def test_costs_count_and_not_numbers() -> None:
    rank = partition(np.arange(11.0)[:, None], np.array([10.0] + 10 * [1.0]), 2)
    assert rank.tolist() == [0] + 10 * [1]


def test_parts_are_neighbourhoods() -> None:
    """Of a row of bodies, in any order, each rank has an interval."""
    order = np.random.default_rng(3).permutation(50)
    rank = partition(order[:, None].astype(float), np.ones(50), 4)
    assert np.all(np.diff(rank[np.argsort(order)]) >= 0)


def test_more_ranks_than_bodies() -> None:
    rank = partition(np.zeros((3, 3)), np.ones(3), 5)
    assert len(set(rank.tolist())) == 3 and rank.max() < 5
    assert partition(np.empty((0, 3)), np.empty(0), 4).size == 0


def test_every_rank_has_a_body_where_there_are_enough() -> None:
    """Also where one body costs more than all others, and where costs are zero."""
    for costs in (np.array([1000.0, 1, 1, 1]), np.zeros(4)):
        assert sorted(partition(np.arange(4.0)[:, None], costs, 4).tolist()) == [0, 1, 2, 3]
