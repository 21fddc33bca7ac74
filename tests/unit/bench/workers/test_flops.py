"""Counters of the system: the mechanism by an event that every Linux has, the processor's own where they can be read."""

from __future__ import annotations

import time

import numpy as np
import pytest

from fcsim.bench.workers.flops import Event, counting

TASK_CLOCK = Event(type=1, config=1)
"""PERF_COUNT_SW_TASK_CLOCK: nanoseconds of processor time."""


def test_counts_are_of_the_block_and_weighted() -> None:
    with counting([TASK_CLOCK, Event(type=1, config=1, weight=2)]) as counters:
        if counters.total() is None:
            pytest.skip("perf_event_open is not allowed here")
        start = time.thread_time_ns()  # not the process's: threads that earlier tests have left are not counted
        while time.thread_time_ns() - start < 50_000_000:
            pass
        used = time.thread_time_ns() - start
        total = counters.total()
    assert total == pytest.approx(3 * used, rel=0.1)
    assert counters.total() is None


def test_what_cannot_be_counted_is_none() -> None:
    with counting([TASK_CLOCK, Event(type=12345, config=1)]) as counters:
        assert counters.total() is None
    with counting([]) as counters:
        assert counters.total() is None


def test_operations_of_a_matrix_product() -> None:
    a = np.ones((200, 200))
    a @ a
    with counting() as counters:
        for _ in range(10):
            a @ a
        total = counters.total()
    if total is None:
        pytest.skip("this machine's counters of floating point operations cannot be read")
    assert total == pytest.approx(10 * 2 * 200**3, rel=0.2)
