"""What belongs to the whole process: freed memory stays with it, unless the user's environment says otherwise."""

from __future__ import annotations

import os
import platform
import subprocess
import sys

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
