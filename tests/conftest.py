"""Before any test imports NumPy: fcsim limits the threads of BLAS, which fight with those of other processes. Nothing has a deadline.

Where numba's cache is empty, two workers do not compile the same twice: they begin in different rooms, and where they meet all the same,
the second waits for what the first puts into the cache.
"""

from __future__ import annotations

import fcntl
import gc
import os
from collections.abc import Generator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any
from zlib import crc32

import hypothesis
import pytest

import fcsim  # noqa: F401

hypothesis.settings.register_profile("no clock", deadline=None)  # what is compiled first would be late
hypothesis.settings.load_profile("no clock")

ROOT = Path(__file__).parents[1]
SOLVING = ("tests/conformance/", *(f"tests/unit/{room}/" for room in ("bench", "collection", "linear", "problem", "solvers")))
"""What compiles the kernels of solvers; all else begins with those of bodies and contacts."""


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """What is collected, 12 000 tests and the modules they are in, lives to the end: Python's collector of cycles need not walk through
    it again and again, half a second each time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> object:
    """Files by their number of tests, as xdist has them; every second worker takes those of `SOLVING` first, the others the rest."""
    from xdist.scheduler import LoadFileScheduling

    if config.getvalue("dist") != "loadfile":
        return None

    class InRooms(LoadFileScheduling):
        def _assign_work_unit(self, node: Any) -> None:
            solving = self.nodes.index(node) % 2 == 1
            own = next((file for file in self.workqueue if file.startswith(SOLVING) == solving), None)
            if own is not None:
                self.workqueue.move_to_end(own, last=False)
            super()._assign_work_unit(node)

    return InRooms(config, log)


def pytest_configure(config: pytest.Config) -> None:
    if hasattr(config, "workerinput"):
        compile_once(ROOT / ".pytest_cache")


def compile_once(folder: Path) -> None:
    """Have numba load or compile a function under a lock by its name: who waited finds it in the cache.

    A function's lock is held while those that it calls are compiled: locks are taken along calls, which make no circles. They are the
    process's: forked children do not have them.
    """
    from numba.core.caching import FunctionCache
    from numba.core.dispatcher import Dispatcher

    @cache
    def file() -> int:
        folder.mkdir(exist_ok=True)
        return os.open(folder / "compiling.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)

    now = Dispatcher.compile

    def alone(self: Any, signature: Any) -> Any:
        if not isinstance(self._cache, FunctionCache) or signature in self.overloads:
            return now(self, signature)
        place = crc32(f"{self.py_func.__module__}.{self.py_func.__qualname__}".encode())
        with suppress(OSError):  # a folder that cannot be written; or the system sees a circle, through threads or two names of one place
            fcntl.lockf(file(), fcntl.LOCK_EX, 1, place)
        try:
            return now(self, signature)
        finally:
            with suppress(OSError):
                fcntl.lockf(file(), fcntl.LOCK_UN, 1, place)

    Dispatcher.compile = alone
