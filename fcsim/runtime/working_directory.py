"""The working directory is a place, not a source of code or options."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

from fcsim.runtime.forks import lock_over_forks

ELSEWHERE = Path(os.sep)
ISOLATED = "-P"
"""Of Python: no modules from the working directory."""


class _Away:
    """The working directory while blocks last within which it is `ELSEWHERE`: the first to begin leaves it, the last to end returns."""

    def __init__(self) -> None:
        self._lock = lock_over_forks()
        self._blocks = 0
        self._here: int | None = None

    def begin(self) -> None:
        with self._lock:
            if not self._blocks:
                try:
                    self._here = os.open(os.curdir, getattr(os, "O_PATH", os.O_RDONLY))
                except OSError:  # removed, or not to be read: nothing can come from it
                    self._here = None
                else:
                    os.chdir(ELSEWHERE)
            self._blocks += 1

    def end(self) -> None:
        with self._lock:
            self._blocks -= 1
            if not self._blocks and self._here is not None:
                os.fchdir(self._here)
                os.close(self._here)
                self._here = None


_away = _Away()


@contextmanager
def without_local_options() -> Iterator[None]:
    """Load libraries, and have them read their options, as if the working directory held nothing; the user's own, in HOME, count.

    The directory is the process's: other threads see the change for as long as the block lasts. Several threads may be in one.
    """
    _away.begin()
    try:
        yield
    finally:
        _away.end()


def load_numba_alone() -> None:
    """Import numba without the working directory's options, where there are some; it is loaded when it is used otherwise."""
    if Path(".numba_config.yaml").is_file():
        with without_local_options():
            import_module("numba")
