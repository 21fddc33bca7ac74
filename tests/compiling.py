"""What processes of tests do where numba compiles: each function once among them.

As a program: `python tests/compiling.py SCRIPT ...` runs a script so, as pytest's workers run tests.
"""

from __future__ import annotations

import fcntl
import os
import runpy
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any
from zlib import crc32

LOCKS = Path(__file__).parents[1] / ".pytest_cache"


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


def main(program: str, *arguments: str) -> None:
    """Run a script with these arguments."""
    import fcsim  # noqa: F401 - before NumPy, whose threads it limits

    compile_once(LOCKS)
    sys.argv = [program, *arguments]
    sys.path[0] = str(Path(program).parent)
    runpy.run_path(program, run_name="__main__")


if __name__ == "__main__":
    main(*sys.argv[1:])
