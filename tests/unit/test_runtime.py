"""What belongs to the whole process: freed memory stays with it, unless the user's environment says otherwise."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest

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
