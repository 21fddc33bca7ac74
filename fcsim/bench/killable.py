"""Work in forked child processes that may hang or crash: each has a time limit, and its end is a result like any other.

A fork inherits what its parent has loaded and compiled, so that children start warm. Needs Python >= 3.11 alone: the process that
drives Siconos uses it as well.
"""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from typing import Any

FINISHED = "finished"
TIME_LIMIT = "time limit"


@dataclass
class Task:
    """Items made one after the other in a child; each, the first included, may take `limit` seconds. Items are pickled."""

    key: Any
    items: Callable[[], Iterator[Any]]
    limit: float


@dataclass
class Ended:
    """What a task gave before it ended: FINISHED, TIME_LIMIT, or in words how it failed."""

    key: Any
    items: list[Any] = field(default_factory=list)
    how: str = FINISHED


@dataclass
class _Child:
    task: Task
    process: Any
    deadline: float
    ended: Ended


def _work(items: Callable[[], Iterator[Any]], pipe: Connection, quiet: bool) -> None:
    if quiet:
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os.dup2(null, 2)
    try:
        for item in items():
            pipe.send(("item", item))
        pipe.send(("end", FINISHED))
    except Exception as error:  # its text is the result
        pipe.send(("end", f"{type(error).__name__}: {error}".splitlines()[0]))


def run_killable(tasks: Iterable[Task], jobs: int = 1, quiet: bool = False) -> Iterator[Ended]:
    """Run the tasks in at most `jobs` children at a time and yield each as it ends. `quiet` silences the children's output."""
    fork = multiprocessing.get_context("fork")
    waiting, running = iter(tasks), dict[Connection, _Child]()
    exhausted = False
    try:
        while True:
            while not exhausted and len(running) < jobs:
                task = next(waiting, None)
                if task is None:
                    exhausted = True
                    break
                receiver, sender = fork.Pipe(duplex=False)
                process = fork.Process(target=_work, args=(task.items, sender, quiet), daemon=True)
                process.start()
                sender.close()
                running[receiver] = _Child(task, process, time.monotonic() + task.limit, Ended(task.key))
            if not running:
                return
            patience = min(child.deadline for child in running.values()) - time.monotonic()
            for pipe in wait(list(running), max(patience, 0.0)):
                assert isinstance(pipe, Connection)
                child = running[pipe]
                try:
                    kind, value = pipe.recv()
                except (EOFError, OSError):
                    child.process.join()
                    code = child.process.exitcode
                    kind, value = "end", f"killed by signal {-code}" if code < 0 else f"exit code {code}"
                if kind == "item":
                    child.ended.items.append(value)
                    child.deadline = time.monotonic() + child.task.limit
                else:
                    child.ended.how = value
                    yield _reap(running, pipe)
            for pipe in [pipe for pipe, child in running.items() if time.monotonic() > child.deadline]:
                running[pipe].ended.how = TIME_LIMIT
                yield _reap(running, pipe)
    finally:
        for child in running.values():
            child.process.kill()


def _reap(running: dict[Connection, _Child], pipe: Connection) -> Ended:
    child = running.pop(pipe)
    child.process.kill()
    child.process.join()
    pipe.close()
    return child.ended
