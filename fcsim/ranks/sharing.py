"""Whether this process shares the work of its simulations with other ranks."""

from __future__ import annotations

import atexit
import os
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress

from fcsim.errors import FcsimError
from fcsim.interrupts import ended_by, is_interrupt
from fcsim.ranks.asked import asked_ranks
from fcsim.ranks.world import World

_shared: list[World] = []
_alone: list[None] = []
_codes = [1]


def world() -> World | None:
    """The ranks that share what is computed now; None where this process computes alone."""
    return _shared[-1] if _shared and not _alone else None


def partners() -> World | None:
    """The ranks that this process shares its work with, also while it computes alone."""
    return _shared[-1] if _shared else None


def kept_alike() -> bool:
    """Whether what this process keeps now for later the other ranks keep too, who then need not exchange it: not what one of them alone
    computes, nor what a thread beside the steps does."""
    return not _shared or (not _alone and threading.current_thread() is threading.main_thread())


def shared() -> bool:
    """Whether this process is one of several ranks that share their work, also while it computes alone."""
    return bool(_shared)


def writes() -> bool:
    """Whether this process is the one that speaks and writes: the only one, or rank 0."""
    return not _shared or _shared[-1].number == 0


def section(what: str) -> AbstractContextManager[None]:
    """A block of work that each rank does by itself; its errors are all ranks'. Nothing where there is one process."""
    ranks = world()
    return nullcontext() if ranks is None else ranks.together(what)


def told[T](what: str, value: T) -> T:
    """The value that rank 0 has; the value itself where there is one process."""
    ranks = world()
    return value if ranks is None else ranks.told(what, value)


def of_rank_0[T](what: str, make: Callable[[], T]) -> T:
    """What `make` returns on rank 0, whose errors are all ranks'."""
    value: T | None = None
    with section(what):
        if writes():
            value = make()
    return told(what, value)  # type: ignore[return-value]  # rank 0 has made it


@contextmanager
def alone() -> Iterator[None]:
    """Within the block this rank computes what it asks for by itself, as one process would: what rank 0 writes, say."""
    _alone.append(None)
    try:
        yield
    finally:
        _alone.pop()


@contextmanager
def sharing() -> Iterator[World | None]:
    """Within the block simulations are shared among the ranks that a launcher of MPI has started; every rank must run the same. None
    where there is one process.

    All ranks leave the block together; where one leaves it by an error, the others do so too, and at the end of the program MPI is left
    without its own farewell, which would wait for exchanges that never come.
    """
    if asked_ranks() == 1 or _shared:
        yield None if not _shared else _shared[-1]
        return
    ranks = World()
    if ranks.size == 1:
        yield None
        return
    _shared.append(ranks)
    try:
        yield ranks
    except BaseException as error:  # an interrupt, too: the other ranks are told
        _shared.pop()
        why = f"interrupted by {ended_by(error)}" if is_interrupt(error) else f"{type(error).__name__}: {error}"
        if ranks.number and isinstance(error, Exception) and not isinstance(error, FcsimError) and not hasattr(error, "__notes__"):
            traceback.print_exception(error)  # a fault of this rank alone, whose end rank 0 may bring about at any time from now on
        ranks.leave(1, why, regular=False)
        if ranks.broken:
            _end_without_mpi()
        raise
    _shared.pop()
    ranks.leave(0, "", regular=True)
    if ranks.broken:
        _end_without_mpi()


def _end_without_mpi() -> None:
    """Let the program end as it would, but before MPI's farewell, which would wait for exchanges that never come."""
    atexit.register(_end_at_once)


def end_with(code: int) -> None:
    """The exit code of a program whose ranks did not end well together; 1 where it says none."""
    _codes.append(code)


def _end_at_once() -> None:
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(_codes[-1])
