"""Of two workers that need one function at the same time, one compiles it and the functions that it calls (tests/compiling.py); what they
keep serves other programs."""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest
from numba.core import event
from numba.core.dispatcher import Dispatcher

from tests.compiling import compile_once

KERNELS = """
import numba

@numba.njit(cache=True)
def inner(x):
    return x + 1

@numba.njit(cache=True)
def outer(x):
    return 2 * inner(x)
"""


class Count(event.Listener):  # type: ignore[misc]
    def __init__(self) -> None:
        self.compiled = 0

    def on_start(self, event: object) -> None:
        self.compiled += 1

    def on_end(self, event: object) -> None:
        pass


def forked(work: Callable[[], int]) -> int:
    child = os.fork()
    if child:
        return child
    code = 99
    try:
        code = work()
    finally:
        os._exit(code)


@pytest.mark.filterwarnings("ignore:.*use of fork:DeprecationWarning")
def test_two_processes_compile_a_function_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Dispatcher, "compile", Dispatcher.compile)  # as it is, afterwards
    compile_once(tmp_path / "locks")
    path, begin = tmp_path / "kernels_of_the_test.py", tmp_path / "begin"
    path.write_text(KERNELS, encoding="utf-8")

    def compiled() -> int:
        spec = spec_from_file_location(path.stem, path)
        assert spec is not None and spec.loader is not None
        kernels = module_from_spec(spec)
        sys.modules[path.stem] = kernels
        spec.loader.exec_module(kernels)
        count = Count()
        event.register("numba:compile", count)
        while not begin.exists():
            time.sleep(1e-3)
        assert kernels.outer(1.5) == 5
        return count.compiled

    children = [forked(compiled) for _ in range(2)]
    begin.touch()
    codes = sorted(os.WEXITSTATUS(os.waitpid(child, 0)[1]) for child in children)
    assert codes == [0, 2]  # outer and inner by one of them, nothing by the other


def test_what_tests_compile_is_loaded_without_them(tmp_path: Path) -> None:
    """Caches are shared with users' runs, whose programs have no package `tests`: none of its code may be within what is kept."""
    (tmp_path / "put.py").write_text("import numba\n\n@numba.njit(cache=True)\ndef put(a, b):\n    a[0] = b\n", encoding="utf-8")
    spec = spec_from_file_location("put", tmp_path / "put.py")
    assert spec is not None and spec.loader is not None
    kernels = module_from_spec(spec)
    sys.modules["put"] = kernels
    spec.loader.exec_module(kernels)
    kernels.put(np.zeros((2, 3)), np.zeros(3))
    assert kernels.put.stats.cache_misses
    code = "import numpy, put; put.put(numpy.zeros((2, 3)), numpy.zeros(3)); assert put.put.stats.cache_hits, put.put.stats"
    subprocess.run([sys.executable, "-P", "-c", code], env=os.environ | {"PYTHONPATH": str(tmp_path)}, cwd=tmp_path, check=True)
