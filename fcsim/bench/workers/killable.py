"""Work in forked child processes that may hang, crash or leak: each has limits, and its end is a result like any other.

A fork inherits what its parent has loaded and compiled, so that children start warm. A child leads a process group, which is killed
whole, and dies with its parent. Needs Python >= 3.11 alone: the process that drives Siconos uses it as well.

The memory limit is on the resident memory that a child has beyond what it inherited, watched from outside every WATCH seconds, not on
its address space (RLIMIT_AS): compiled code and libraries reserve far more addresses than they use, and C libraries answer a refused
allocation with a crash that nothing tells from any other. Between two looks a child adds some tens of MiB at most; should the system's
memory run out all the same, the kernel is told to end the child rather than its parent.
"""

# ruff: noqa: UP046, UP047 - the Python of another program, an older one maybe, reads this file too
from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkProcess
from typing import Any, Generic, TypeVar

K = TypeVar("K")
I = TypeVar("I")
Row = dict[str, Any]  # JSON between processes, one of which knows nothing of fcsim: each reader knows its own keys

FINISHED = "finished"
TIME_LIMIT = "time limit"
MEMORY_LIMIT = "memory limit"
WATCH = 0.02
"""[s] between two looks at the memory of a child that has a limit."""
PATIENCE = 120.0
"""[s] What a child that says to be busy with other work than its items may take for it."""
PR_SET_PDEATHSIG = 1


@dataclass
class Task(Generic[K, I]):
    """Items made one after the other in a child; each, the first included, may take `limit` seconds. Items are pickled.

    memory: MiB of resident memory beyond what the child inherits, None for no limit.
    watch: called in the child with a function tell(busy); from tell(True) on it may take PATIENCE instead, and from tell(False) on
    `limit` begins anew: for work that is none of the items'.
    """

    key: K
    items: Callable[[], Iterator[I]]
    limit: float
    memory: float | None = None
    watch: Callable[[Callable[[bool], None]], None] | None = None


@dataclass
class Ended(Generic[K, I]):
    """What a task gave before it ended: FINISHED, TIME_LIMIT, MEMORY_LIMIT, or in words how it failed."""

    key: K
    items: list[I] = field(default_factory=list)
    how: str = FINISHED


@dataclass
class _Child(Generic[K, I]):
    task: Task[K, I]
    process: ForkProcess
    pid: int
    deadline: float
    ended: Ended[K, I]
    inherited: float = 0.0


def resident(pid: int) -> float:
    """Resident memory of a process without its mapped files [MiB], 0 where the system does not say."""
    try:
        with open(f"/proc/{pid}/statm", encoding="ascii") as file:  # noqa: PTH123 - many times a second
            _, pages, of_files, *_ = map(int, file.read().split())
    except (OSError, ValueError):
        return 0.0
    return (pages - of_files) * os.sysconf("SC_PAGE_SIZE") / 2**20


def die_with_parent(by: signal.Signals = signal.SIGKILL) -> None:
    """Have this process sent a signal when the one that started it ends, however that ends (Linux)."""
    try:
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, int(by))
    except (OSError, AttributeError):
        return


def _settle(parent: int) -> None:
    die_with_parent()
    if os.getppid() != parent:  # it ended just before
        os._exit(1)
    os.setpgid(0, 0)
    try:
        with open("/proc/self/oom_score_adj", "w", encoding="ascii") as file:  # noqa: PTH123 - this file does without pathlib
            file.write("1000")
    except OSError:
        return


def leave_copies(own: int) -> None:
    """End this process where it is not the one of that id but a copy: what a method forked and let return has nothing to say here."""
    if os.getpid() != own:
        os._exit(0)


def _work(task: Task[K, I], pipe: Connection, quiet: bool, parent: int) -> None:
    _settle(parent)
    own = os.getpid()
    speaking = threading.Lock()  # compilers tell from whatever thread they are in

    def tell(kind: str, value: object) -> None:
        leave_copies(own)
        with speaking:
            pipe.send((kind, value))

    if quiet:
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os.dup2(null, 2)
    try:
        if task.watch is not None:
            task.watch(lambda busy: tell("busy", busy))
        for item in task.items():
            tell("item", item)
        tell("end", FINISHED)
    except MemoryError:
        tell("end", MEMORY_LIMIT)
    except Exception as error:  # its text is the result
        tell("end", f"{type(error).__name__}: {error}".splitlines()[0])
    except SystemExit as leaving:
        tell("end", f"exit code {leaving.code}")


def run_killable(tasks: Iterable[Task[K, I]], jobs: int = 1, quiet: bool = False) -> Iterator[Ended[K, I]]:
    """Run the tasks in at most `jobs` children at a time and yield each as it ends. `quiet` silences the children's output."""
    fork = multiprocessing.get_context("fork")
    waiting, running = iter(tasks), dict[Connection, _Child[K, I]]()
    exhausted = False
    try:
        while True:
            while not exhausted and len(running) < jobs:
                task = next(waiting, None)
                if task is None:
                    exhausted = True
                    break
                receiver, sender = fork.Pipe(duplex=False)
                process = fork.Process(target=_work, args=(task, sender, quiet, os.getpid()), daemon=True)
                process.start()
                sender.close()
                assert process.pid is not None
                inherited = resident(process.pid)
                running[receiver] = _Child(task, process, process.pid, time.monotonic() + task.limit, Ended(task.key), inherited)
            if not running:
                return
            patience = min(child.deadline for child in running.values()) - time.monotonic()
            if any(child.task.memory is not None for child in running.values()):
                patience = min(patience, WATCH)
            for pipe in wait(list(running), max(patience, 0.0)):
                assert isinstance(pipe, Connection)
                child = running[pipe]
                try:
                    kind, value = pipe.recv()
                except (EOFError, OSError):
                    child.process.join()
                    code = child.process.exitcode or 0
                    kind, value = "end", f"killed by signal {-code}" if code < 0 else f"exit code {code}"
                if kind == "item":
                    child.ended.items.append(value)
                    child.deadline = time.monotonic() + child.task.limit
                elif kind == "busy":
                    child.deadline = time.monotonic() + (PATIENCE if value else child.task.limit)
                else:
                    child.ended.how = value
                    yield _reap(running, pipe)
            for pipe in [pipe for pipe, child in running.items() if time.monotonic() > child.deadline]:
                running[pipe].ended.how = TIME_LIMIT
                yield _reap(running, pipe)
            for pipe in [pipe for pipe, child in running.items() if _too_large(child)]:
                running[pipe].ended.how = MEMORY_LIMIT
                yield _reap(running, pipe)
    finally:
        for child in running.values():
            _kill(child)


def _too_large(child: _Child[K, I]) -> bool:
    return child.task.memory is not None and resident(child.pid) - child.inherited > child.task.memory


def _kill(child: _Child[K, I]) -> None:
    child.process.kill()
    try:
        os.killpg(child.pid, signal.SIGKILL)  # what the child started itself
    except (ProcessLookupError, PermissionError):
        return


def _reap(running: dict[Connection, _Child[K, I]], pipe: Connection) -> Ended[K, I]:
    child = running.pop(pipe)
    _kill(child)
    child.process.join()
    pipe.close()
    return child.ended
