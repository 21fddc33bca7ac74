"""How many threads fcsim computes on, and BLAS and OpenMP meanwhile."""

from __future__ import annotations

import os
import sys
from contextlib import ContextDecorator
from functools import cache

from threadpoolctl import LibController, ThreadpoolController

from fcsim.errors import InputError
from fcsim.runtime.forks import lock_over_forks

THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


_BRINGS_LIBRARIES = ("scipy.linalg", "petsc4py.PETSc", "gmsh", "vtkmodules")
"""Packages that bring a BLAS or OpenMP of their own."""


@cache
def _thread_pools(loaded: tuple[bool, ...]) -> list[LibController]:
    """The BLAS and OpenMP libraries of this process, by which of `_BRINGS_LIBRARIES` are loaded: each that comes is looked at once."""
    pools: list[LibController] = ThreadpoolController().lib_controllers
    return pools


_ON_THIS_MACHINE = ("MPI_LOCALNRANKS", "OMPI_COMM_WORLD_LOCAL_SIZE")
"""Variables in which mpiexec says how many ranks share the machine."""


@cache
def threads() -> int:
    """How many threads fcsim computes on: FCSIM_THREADS, read once, else the cores that this process may use, shared with the MPI ranks
    beside it. Raises InputError where FCSIM_THREADS is no such number."""
    asked = os.environ.get("FCSIM_THREADS")
    if asked is None:
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        ranks = next((int(os.environ[name]) for name in _ON_THIS_MACHINE if os.environ.get(name, "").isdecimal()), 1)
        return max(1, cores // max(ranks, 1))
    if not asked.isascii() or not asked.isdecimal() or int(asked) < 1:
        raise InputError(f"FCSIM_THREADS: expected a whole number >= 1, got {asked!r}")
    return int(asked)


@cache
def library_threads() -> int | None:
    """Threads of BLAS and OpenMP while fcsim computes: 1, but None (as they are) where the user's environment sets a number for them."""
    return None if any(os.environ.get(name) for name in THREAD_VARIABLES) else 1


class _Limits:
    """Numbers of threads that blocks found, whose they are while one lasts: each block lowers, the last to end restores."""

    def __init__(self) -> None:
        self._lock = lock_over_forks()
        self._blocks = 0
        self._before: dict[int, tuple[LibController, int]] = {}

    def begin(self, allowed: int) -> None:
        with self._lock:
            self._blocks += 1
            for pool in _thread_pools(tuple(name in sys.modules for name in _BRINGS_LIBRARIES)):
                if (now := pool.get_num_threads()) not in (allowed, None):
                    self._before.setdefault(id(pool), (pool, now))
                    pool.set_num_threads(allowed)

    def end(self) -> None:
        with self._lock:
            self._blocks -= 1
            if not self._blocks:
                for pool, number in self._before.values():
                    pool.set_num_threads(number)
                self._before.clear()


_limits = _Limits()


class limited_threads(ContextDecorator):
    """BLAS and OpenMP on `library_threads` within the block, on as many as before after it; some microseconds where they are so already.

    A class, since a generator's context costs as much as a sweep of a small problem. The number belongs to the process: other threads of
    the program see it as long as the block lasts. Blocks may nest, and several threads may be in one: the limit holds until the last ends.
    """

    def __init__(self) -> None:
        self._began = False

    def _recreate_cm(self) -> limited_threads:
        """A block of its own for each call of what is decorated: calls may nest."""
        return limited_threads()

    def __enter__(self) -> None:
        threads()  # which refuses a wrong number
        allowed = library_threads()
        if allowed is not None:
            _limits.begin(allowed)
            self._began = True

    def __exit__(self, *_: object) -> None:
        if self._began:
            _limits.end()
