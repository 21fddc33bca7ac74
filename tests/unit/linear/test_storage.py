"""Dense or sparse: the decision by counted costs, and what work costs."""

from __future__ import annotations

import pytest

from fcsim.linear.storage import DENSE_UP_TO, REFERENCE, Work, eliminated_dense, summed_dense


@pytest.mark.parametrize("size", [1, 60, 150])
def test_small_matrices_are_eliminated_dense_however_sparse(size: int) -> None:
    assert eliminated_dense(size, 0)


@pytest.mark.parametrize("size", [500, 3000, DENSE_UP_TO])
def test_full_matrices_are_eliminated_dense_as_long_as_they_are_affordable(size: int) -> None:
    assert eliminated_dense(size, size**2)
    assert not eliminated_dense(DENSE_UP_TO + 1, (DENSE_UP_TO + 1) ** 2)


@pytest.mark.parametrize("size", [600, 2000, 10_000])
def test_few_entries_a_row_are_eliminated_sparse(size: int) -> None:
    """Twenty contacts beside each: the count of sparse elimination grows with the size, that of dense elimination with its cube."""
    assert not eliminated_dense(size, 60 * size)


def test_more_entries_never_turn_a_dense_elimination_sparse() -> None:
    for size in (200, 400, 900):
        decided = [eliminated_dense(size, share * size**2 // 100) for share in range(0, 101, 5)]
        assert decided == sorted(decided)


def test_a_sum_keeps_the_structure_that_joints_may_have() -> None:
    """A wall of 688 contacts has a quarter of its entries."""
    assert not summed_dense(2064, 2064**2 // 4)
    assert summed_dense(2064, 2064**2)
    assert summed_dense(900, 0)


def test_a_sum_of_rigid_bodies_is_sparse_beyond_the_compiled_front_door() -> None:
    """128 contacts in space pass it; towers of 300 contacts have a tenth of W's entries."""
    assert summed_dense(3 * 128, 0, rigid=True)
    assert not summed_dense(900, 900**2 // 10, rigid=True)
    assert summed_dense(900, 900**2, rigid=True)


def test_work_adds_up() -> None:
    work = Work(flops=1e9) + 2 * Work(bytes=5e8, steps=1)
    assert work == Work(1e9, 1e9, 2)
    assert REFERENCE.seconds(work) == pytest.approx(1e9 / REFERENCE.flops + 1e9 / REFERENCE.bytes + 2 * REFERENCE.step)
