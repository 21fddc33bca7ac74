"""Blocks that one preconditioner takes over from another: each has its own numbers, whoever has written since."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_array_equal

from fcsim.solvers.newton.systems.two_level.taken_over import TakenOver

STARTS = np.array([0, 2, 2, 5, 9]), np.array([0, 1, 4, 4, 6])


def begun() -> TakenOver:
    return TakenOver((np.arange(9, dtype=np.float32), np.arange(6.0)), STARTS)


def write(blocks: TakenOver, which: list[int], value: float) -> None:
    for array, starts in zip(blocks.to_write(np.array(which, dtype=np.int64)), STARTS, strict=True):
        for k in which:
            array[starts[k] : starts[k + 1]] = value


def read(blocks: TakenOver) -> list[np.ndarray]:
    return [x.copy() for x in blocks.to_read()]


def test_the_last_one_writes_to_the_very_arrays() -> None:
    first = begun()
    arrays = first.to_write(np.array([0]))
    assert all(x is y for x, y in zip(first.following().following().to_write(np.array([1])), arrays, strict=True))


def test_a_step_is_begun_again_from_what_it_began_with() -> None:
    """Two steps lead on, each with two systems that change some joints twice; then the first of them is begun again, and again."""
    first = begun()
    write(first, [1], 7.0)
    expected = read(first)
    second = first.following()
    write(second, [0, 2], 10.0)
    write(second, [2, 3], 11.0)
    of_second = read(second)
    third = second.following()
    write(third, [0, 1, 2, 3], 12.0)
    write(third, [1], 13.0)
    of_third = read(third)
    for _ in range(2):
        again = first.following()
        for x, y in zip(read(again), expected, strict=True):
            assert_array_equal(x, y)
        write(again, [3, 0], 20.0)
    again = second.following()
    for found, wanted in ((again, of_second), (third, of_third), (second, of_second), (first, expected)):
        for x, y in zip(read(found), wanted, strict=True):
            assert_array_equal(x, y)


def test_an_earlier_one_that_writes_again_leaves_the_later_one_alone() -> None:
    first = begun()
    expected = read(first)
    second = first.following()
    write(second, [0], 1.0)
    of_second = read(second)
    write(first, [3], 2.0)
    for x, y in zip(read(second), of_second, strict=True):
        assert_array_equal(x, y)
    for x, y, starts in zip(read(first), expected, STARTS, strict=True):
        assert_array_equal(x[: starts[3]], y[: starts[3]])
        assert np.all(x[starts[3] :] == 2.0)
