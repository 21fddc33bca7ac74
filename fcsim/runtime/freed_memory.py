"""Memory of freed arrays, which stays with the process."""

from __future__ import annotations

import ctypes
import os
import platform

KEPT_ARRAY, KEPT_MEMORY = 128 * 2**20, 512 * 2**20
"""[bytes] Arrays up to this size are taken from memory freed before, of which at most so much is kept at the end of the heap."""
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -3, -8  # of glibc's malloc.h


def keep_freed_memory() -> None:
    """Have glibc's malloc keep the memory of freed arrays instead of returning it to the system, which clears every page anew: a third of
    the time in which W of a refined wall is summed, in each step. All threads have one heap: another thread's own, of 64 MB, gives pages
    back whatever the thresholds. Nothing happens elsewhere, or where the user's environment sets malloc's thresholds
    (MALLOC_MMAP_THRESHOLD_, MALLOC_TRIM_THRESHOLD_, GLIBC_TUNABLES)."""
    if any(name in os.environ for name in ("MALLOC_MMAP_THRESHOLD_", "MALLOC_TRIM_THRESHOLD_", "GLIBC_TUNABLES")):
        return
    if platform.libc_ver()[0] == "glibc":
        for what, size in ((M_MMAP_THRESHOLD, KEPT_ARRAY), (M_TRIM_THRESHOLD, KEPT_MEMORY), (M_ARENA_MAX, 1)):
            ctypes.CDLL(None).mallopt(what, size)


def release_freed_memory() -> None:
    """Return what malloc keeps to the system: before a fork, so that what the child takes shows in its resident memory."""
    if platform.libc_ver()[0] == "glibc":
        ctypes.CDLL(None).malloc_trim(ctypes.c_size_t(0))
