"""What belongs to the whole process: freed memory stays with it, BLAS keeps its threads but while fcsim computes; the user's environment
counts."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest

from fcsim.errors import InputError
from fcsim.runtime import limited_threads, threads

FAULTS = """
import resource
import fcsim
import numpy as np
array = np.ones(8_000_000)
del array
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
array = np.ones(8_000_000)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""
"""Page faults of an array as large as one that was freed before: pages of 2 MB at most make 30 of its 64 MB."""


def page_faults(**environment: str) -> int:
    found = subprocess.run(
        [sys.executable, "-c", FAULTS], env={**os.environ, **environment}, capture_output=True, text=True, check=True, timeout=120
    )
    return int(found.stdout)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="malloc's thresholds are glibc's")
def test_freed_arrays_are_used_again() -> None:
    assert page_faults() < 10


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="malloc's thresholds are glibc's")
def test_the_environment_s_thresholds_stand() -> None:
    assert page_faults(MALLOC_MMAP_THRESHOLD_="1000000") >= 30


THREADS = """
import numpy as np
import scipy.linalg
from threadpoolctl import threadpool_info
import fcsim
from fcsim.problem import LocalProblem
from fcsim.solvers import SOLVERS, solve
from dataclasses import replace

def now():
    return max(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas")

seen = []
newton = SOLVERS["NSN-AC"]
def spied(*arguments):
    seen.append(now())
    return newton.run(*arguments)
SOLVERS["SPIED"] = replace(newton, run=spied)
before = now()
solve(LocalProblem(np.eye(3), np.array([-1.0, 0.1, 0.0]), np.array([0.5])), "SPIED")
print(before, seen[0], now())
"""


def blas_threads(**environment: str) -> tuple[int, int, int]:
    """BLAS threads before, within and after a solve."""
    known = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS") and name != "FCSIM_THREADS"}
    found = subprocess.run([sys.executable, "-c", THREADS], env={**known, **environment}, capture_output=True, text=True, timeout=120)
    assert found.returncode == 0, found.stderr
    before, within, after = map(int, found.stdout.split())
    return before, within, after


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="BLAS has one thread anyway")
def test_threads_are_limited_while_fcsim_computes() -> None:
    before, within, after = blas_threads()
    assert before == after > 1
    assert within == 1
    assert blas_threads(FCSIM_THREADS="2")[1] == 1  # whose number changes results
    assert blas_threads(OMP_NUM_THREADS="2", OPENBLAS_NUM_THREADS="2") == (2, 2, 2)


SIDE_BY_SIDE = """
import os
import threading
import scipy.linalg
from threadpoolctl import threadpool_info
from fcsim.runtime import limited_threads, without_local_options

def now():
    return max(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas")

def both(block, seen):
    first_in, second_in, first_out = (threading.Event() for _ in range(3))
    def first():
        with block():
            first_in.set()
            second_in.wait(20)
        first_out.set()
    def second():
        first_in.wait(20)
        with block():
            second_in.set()
            first_out.wait(20)
            print(seen())
    workers = [threading.Thread(target=work) for work in (first, second)]
    [worker.start() for worker in workers]
    [worker.join() for worker in workers]
    print(seen())

print(now())
both(limited_threads, now)
both(without_local_options, os.getcwd)
"""
"""Two threads of a program in one kind of block at the same time, of which the first to come is the first to leave; what each sees then."""


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="BLAS has one thread anyway")
def test_blocks_of_two_threads_end_with_the_last(tmp_path: Path) -> None:
    """The first took the limit away from the second, whose last bits changed; the second left the process in the root directory."""
    known = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS") and name != "FCSIM_THREADS"}
    known["PYTHONPATH"] = str(Path(__file__).parents[2])
    found = subprocess.run(
        [sys.executable, "-c", SIDE_BY_SIDE], cwd=tmp_path, env=known, capture_output=True, text=True, check=True, timeout=120
    )
    before, within, after, away, back = found.stdout.split()
    assert int(before) > 1
    assert (within, after) == ("1", before)
    assert (away, back) == ("/", str(tmp_path))


def test_threads_that_are_no_number(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FCSIM_THREADS", "many")
    threads.cache_clear()
    with pytest.raises(InputError, match="FCSIM_THREADS: expected a whole number >= 1, got 'many'"), limited_threads():
        pass


def test_a_home_that_cannot_be_written_stops_nothing(tmp_path: Path) -> None:
    """Compiled forms go to a folder for temporary files that is ours alone."""
    code = "import os, fcsim; print(os.environ.get('XDG_CACHE_HOME'))"
    environment = {name: value for name, value in os.environ.items() if name != "XDG_CACHE_HOME"}
    environment |= {"HOME": "/proc/nobody", "TMPDIR": str(tmp_path), "PYTHONPATH": str(Path(__file__).parents[2])}
    told = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True).stdout.strip()
    assert Path(told).parent == tmp_path and Path(told).stat().st_mode & 0o077 == 0
    Path(told).rmdir()
    Path(told).mkdir(mode=0o777)
    Path(told).chmod(0o777)  # made by somebody else before
    other = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True).stdout.strip()
    assert other != told and Path(other).stat().st_mode & 0o077 == 0
    told = subprocess.run(
        [sys.executable, "-c", code], env=environment | {"HOME": str(tmp_path)}, capture_output=True, text=True, check=True
    )
    assert told.stdout.strip() == "None"
