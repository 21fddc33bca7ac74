"""Work side by side: tasks of one piece of work on the threads that `fcsim.runtime.threads` allows.

A task is Python that soon leaves the interpreter's lock: a compiled kernel (`nogil=True`), a product of NumPy, LAPACK, zlib. Results do not
depend on the number of threads: the problem alone says how work is cut (`pieces`), every task writes what no other one reads or writes,
and what they return is put together in the tasks' order. Library threads (BLAS, OpenMP) stay as `runtime.limited_threads` sets them.

Whoever asks works too and takes what nobody has begun; so tasks may ask for others, and programs may ask from threads of their own,
without waiting in a circle. Before a fork the threads end, in parent and child they begin anew when they are needed.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from functools import cache
from queue import SimpleQueue

from fcsim.runtime import threads
from fcsim.threads.pieces import PIECES


class _Work[T]:
    """Tasks of which each is done once, by whoever comes first."""

    def __init__(self, tasks: Sequence[Callable[[], T]]) -> None:
        self._tasks = tasks
        self._results: dict[int, T] = {}
        self._lock, self._done = threading.Lock(), threading.Lock()
        self._next, self._helpers, self._closed = 0, 0, False
        self._errors: dict[int, BaseException] = {}

    def _begin(self) -> int | None:
        with self._lock:
            k, self._next = self._next, self._next + 1
        return k if k < len(self._tasks) else None

    def go(self) -> None:
        """Do what is left, one task after the other; after an error nothing more is begun."""
        while (k := self._begin()) is not None:
            try:
                self._results[k] = self._tasks[k]()
            except BaseException as error:  # also Ctrl-C: the others are waited for first
                with self._lock:
                    self._errors[k] = error
                    self._next = len(self._tasks)

    def help(self) -> None:
        """`go`, unless it is over."""
        with self._lock:
            if self._closed:
                return
            self._helpers += 1
        self.go()
        with self._lock:
            self._helpers -= 1
            if self._closed and not self._helpers:
                self._done.release()

    def wait(self) -> None:
        """Return when nobody is at work on it any more."""
        self._done.acquire()
        with self._lock:
            self._closed = True
            working = self._helpers
        if working:
            self._done.acquire()  # which the last helper releases

    def results(self) -> list[T]:
        """What the tasks returned; raises the first error in their order."""
        if self._errors:
            raise self._errors[min(self._errors)]
        return [self._results[k] for k in range(len(self._tasks))]


class _Pool:
    """Threads that wait for work."""

    def __init__(self, count: int) -> None:
        self._offers: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._threads = [threading.Thread(target=self._serve, name=f"fcsim-{k + 1}", daemon=True) for k in range(count)]
        for thread in self._threads:
            thread.start()

    def _serve(self) -> None:
        while (help_with := self._offers.get()) is not None:
            help_with()
            del help_with  # its tasks hold arrays

    def offer(self, help_with: Callable[[], None], times: int) -> None:
        for _ in range(min(times, len(self._threads))):
            self._offers.put(help_with)

    def end(self) -> None:
        for _ in self._threads:
            self._offers.put(None)
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join()


@cache
def _pool() -> _Pool:
    return _Pool(min(threads(), PIECES) - 1)


_making = threading.Lock()


def _the_pool() -> _Pool:
    with _making:  # one, whoever asks first
        return _pool()


def _before_a_fork() -> None:
    _making.acquire()  # nobody else's thread makes another meanwhile
    if _pool.cache_info().currsize:
        _pool().end()
        _pool.cache_clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_before_a_fork, after_in_parent=_making.release, after_in_child=_making.release)


def side_by_side[T](tasks: Sequence[Callable[[], T]]) -> list[T]:
    """What the tasks return, in their order, whichever thread did them. An error is raised when none is at work any more: of several the
    first in the tasks' order."""
    if len(tasks) < 2 or threads() == 1:
        return [task() for task in tasks]
    work = _Work(tasks)
    _the_pool().offer(work.help, len(tasks) - 1)
    work.go()
    work.wait()
    return work.results()


def begun[T](task: Callable[[], T]) -> Callable[[], T]:
    """Begin a task on another thread and return what waits for it and gives what it returned, or raises its error, as often as it is asked.

    Where no thread has begun it when it is first asked for, and always on one thread, whoever asks does it then: a task that nobody
    asks for may never be done.
    """
    if threads() == 1:
        return cache(task)
    work = _Work([task])
    _the_pool().offer(work.help, 1)

    @cache
    def waited() -> None:
        work.go()
        work.wait()

    def finished() -> T:
        waited()
        return work.results()[0]

    return finished
