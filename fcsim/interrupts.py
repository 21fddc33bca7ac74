"""Signals that end a command, and the interrupts that they become, in one place."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from fcsim.errors import EXIT_BAD_INPUT

ENDING = {signal.SIGINT: "the keyboard", signal.SIGTERM: "SIGTERM", signal.SIGHUP: "SIGHUP (the terminal was closed)"}


_WEAK = ("weakref.py", "_weakrefset.py")
"""Where Python's dictionaries and sets of weak references are."""
_LATER = 0.01
"""[s] After which a signal that came where an exception is forgotten is heard again."""


_heard = threading.Event()
"""Set once a signal has raised `Ended`."""


class Ended(KeyboardInterrupt):
    """A polite end from outside; `by` says whose."""

    def __init__(self, by: str) -> None:
        super().__init__(by)
        self.by = by


def _end(number: int, frame: FrameType | None) -> None:
    if not _forgets(frame):
        _heard.set()
        raise Ended(ENDING[signal.Signals(number)])
    main = threading.main_thread().ident
    assert main is not None
    again = threading.Timer(_LATER, signal.pthread_kill, (main, number))
    again.daemon = True
    again.start()


def _forgets(frame: FrameType | None) -> bool:
    """Whether what is raised here is forgotten: Python prints and drops what `__del__` and the callbacks of weak references raise."""
    while frame is not None:
        code = frame.f_code
        if code.co_name == "__del__" or (code.co_name in ("remove", "_remove") and code.co_filename.endswith(_WEAK)):
            return True
        frame = frame.f_back
    return False


@contextmanager
def ended_politely() -> Iterator[None]:
    """SIGTERM, and SIGINT and SIGHUP unless they are ignored (nohup, jobs in the background), raise `Ended` within the block; a reader that
    left raises BrokenPipeError instead of killing. What an `__init__` that was so ended left without its attributes goes without a word:
    its `__del__` misses them, as LLVM's values do while a kernel is compiled. In other threads than the main one nothing is changed:
    signals go to that one."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    _heard.clear()
    told = sys.unraisablehook

    def hook(dropped: sys.UnraisableHookArgs) -> None:
        half_made = isinstance(dropped.exc_value, AttributeError) and getattr(dropped.object, "__name__", "") == "__del__"
        if not (half_made and _heard.is_set()):
            told(dropped)

    sys.unraisablehook = hook
    before = {number: signal.getsignal(number) for number in (*ENDING, signal.SIGPIPE)}
    for number in ENDING:
        if number == signal.SIGTERM or before[number] != signal.SIG_IGN:
            signal.signal(number, _end)
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        sys.unraisablehook = told


@contextmanager
def held_back() -> Iterator[None]:
    """Signals that end a command are heard at the end of the block: inside, all ranks take part in exchanges that none may leave."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heard: list[int] = []
    before = {number: handler for number in ENDING if callable(handler := signal.getsignal(number))}
    for number in before:
        signal.signal(number, lambda number, frame: heard.append(number))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if heard:
            signal.raise_signal(heard[0])


def ended_by(error: BaseException | None) -> str:
    """Who ended what was interrupted, also where compiled code wrapped the interrupt."""
    while error is not None and not isinstance(error, Ended):
        error = error.__cause__ or error.__context__
    return error.by if error is not None else "the keyboard"


def end_forks_of(process: int) -> None:
    """End this process where it is a fork of the run's, which has the run's lock and would write its files a second time: a case script
    that forks in a sensor leaves two programs in one run."""
    if os.getpid() != process:
        os.write(2, f"fcsim: process {os.getpid()} is a fork of a run and ends; the run is process {process}\n".encode())
        os._exit(EXIT_BAD_INPUT)


def is_interrupt(error: BaseException) -> bool:
    """Whether an exception is Ctrl-C's: itself, or a SystemError that compiled code made of it when it struck inside."""
    seen: BaseException | None = error
    while seen is not None and not isinstance(seen, KeyboardInterrupt):
        seen = (seen.__cause__ or seen.__context__) if isinstance(seen, SystemError) else None
    return seen is not None
