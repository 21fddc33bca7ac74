"""Work side by side: every task once, in order, errors said once all are done; no waiting in a circle, nothing left for a fork; the same
bits whatever the number of threads."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest

from fcsim.runtime import threads
from fcsim.threads import PIECES, begun, pieces, pieces_by_work, side_by_side
from fcsim.threads import tasks as threads_module


@pytest.fixture(autouse=True)
def three_threads(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Whatever this machine has."""
    monkeypatch.setenv("FCSIM_THREADS", "3")
    _ended()
    yield
    _ended()


def _ended() -> None:
    """The pool's threads end, and the number is read anew."""
    threads.cache_clear()
    threads_module._before_a_fork()
    threads_module._making.release()


def meeting(count: int) -> list[Callable[[], int]]:
    """Tasks that each wait for the others: only threads of their own finish them."""
    barrier = threading.Barrier(count)
    return [partial(barrier.wait, 20)] * count


def test_tasks_are_done_at_the_same_time_and_answered_in_order() -> None:
    assert sorted(side_by_side(meeting(3))) == [0, 1, 2]
    assert side_by_side([partial(pow, k, 2) for k in range(100)]) == [k * k for k in range(100)]
    assert side_by_side([]) == []


def test_the_first_error_is_raised_when_nobody_works_any_more() -> None:
    working = []

    def fail(k: int) -> None:
        working.append(k)
        try:
            barrier.wait(20)
            raise ValueError(str(k))
        finally:
            working.remove(k)

    barrier = threading.Barrier(3)
    with pytest.raises(ValueError, match="0"):
        side_by_side([partial(fail, k) for k in range(3)])
    assert not working
    assert sorted(side_by_side(meeting(3))) == [0, 1, 2]  # and the threads go on


def test_ctrl_c_in_a_task_is_an_interrupt() -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        side_by_side([interrupted, int, int])


def test_tasks_may_ask_for_tasks_and_programs_from_their_own_threads() -> None:
    def sums(k: int) -> int:
        return sum(side_by_side([partial(pow, j, k) for j in range(20)]))

    expected = [sum(j**k for j in range(20)) for k in range(12)]
    with ThreadPoolExecutor(5) as users:
        found = list(users.map(lambda _: side_by_side([partial(sums, k) for k in range(12)]), range(40)))
    assert found == [expected] * 40


@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks are POSIX's")
@pytest.mark.filterwarnings("error::DeprecationWarning")
def test_no_thread_is_left_when_the_process_forks_and_both_go_on() -> None:
    side_by_side(meeting(3))
    assert any(thread.name.startswith("fcsim-") for thread in threading.enumerate())
    child = os.fork()
    if child == 0:
        os._exit(sorted(side_by_side(meeting(3))) != [0, 1, 2])
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert sorted(side_by_side(meeting(3))) == [0, 1, 2]


@pytest.mark.parametrize("size", [0, 1, 7, 8, 9, 1000])
def test_pieces_cover_all_once(size: int) -> None:
    for least in (1, 3, 5000):
        found = pieces(size, least)
        assert [k for begin, end in found for k in range(begin, end)] == list(range(size))
        assert len(found) <= PIECES and (len(found) == 1 or min(end - begin for begin, end in found) >= least)
    begins = np.concatenate([[0], np.cumsum(np.random.default_rng(size).integers(0, 50, size))])
    for least in (1, 100):
        found = pieces_by_work(begins, least)
        assert [k for begin, end in found for k in range(begin, end)] == list(range(size))
        assert len(found) <= PIECES


def test_pieces_by_work_have_about_the_same() -> None:
    begins = np.cumsum(np.arange(2001))
    work = [begins[end] - begins[begin] for begin, end in pieces_by_work(begins, 1)]
    assert max(work) - min(work) < 2 * 2000


@pytest.mark.parametrize(("environment", "expected"), [({}, "cores"), ({"FCSIM_THREADS": "5"}, "5"), ({"MPI_LOCALNRANKS": "1000"}, "1")])
def test_who_says_how_many(environment: dict[str, str], expected: str) -> None:
    known = {name: value for name, value in os.environ.items() if name != "FCSIM_THREADS"}
    said = subprocess.run(
        [sys.executable, "-c", "from fcsim.runtime import threads; print(threads())"],
        env={**known, **environment},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    ).stdout.strip()
    assert said == (str(len(os.sched_getaffinity(0))) if expected == "cores" else expected)


def test_what_is_begun_is_done_once_by_another_thread_or_by_whoever_asks_first() -> None:
    meet, done = threading.Barrier(3), list[threading.Thread]()
    first, second = (begun(partial(meet.wait, 20)) for _ in range(2))
    asked = begun(lambda: done.append(threading.current_thread()))
    asked()  # by whoever asks, as both helpers wait for the meeting
    asked()
    assert done == [threading.current_thread()]
    assert {meet.wait(20), first(), second(), second()} == {0, 1, 2}


def test_the_error_of_what_is_begun_is_raised_where_it_is_asked_for() -> None:
    asked = begun(partial(int, "no number"))
    for _ in range(2):
        with pytest.raises(ValueError, match="no number"):
            asked()


def test_on_one_thread_what_is_begun_waits_until_it_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FCSIM_THREADS", "1")
    threads.cache_clear()
    done: list[int] = []
    asked = begun(lambda: done.append(1))
    assert not done
    asked()
    asked()
    assert done == [1]
