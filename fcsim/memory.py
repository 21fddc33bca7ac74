"""How much memory is free, and what may be begun in it.

A mesh of 10^9 cells or a wall of 10^5 bricks would fill the machine for an hour and then be killed without a word; what is built says
beforehand what it will take. Such estimates may be wrong by half, so that the user may go on all the same: within `any_size()`, or with
FCSIM_ANY_SIZE=1 in the environment.
"""

from __future__ import annotations

import os
import resource
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from fcsim.errors import InputError

_ANY_SIZE: ContextVar[bool] = ContextVar("any size", default=False)
LIBRARIES = 400 * 2**20
"""Addresses [bytes] that MPI, dolfinx and gmsh take: 360 MiB were counted. With fewer left they end in a segmentation fault."""
NUMPY, CORE = 70 * 2**20, 280 * 2**20
"""Addresses [bytes] that NumPy takes, and SciPy, numba and h5py after it: 70 and 285 MiB were counted, of one thread. With fewer left
an import fails in any line of theirs."""

CGROUPS = (
    ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"),
    ("/sys/fs/cgroup/memory/memory.limit_in_bytes", "/sys/fs/cgroup/memory/memory.usage_in_bytes"),
)
"""Limit and use of a container, by the second and the first version of control groups."""


@contextmanager
def any_size() -> Iterator[None]:
    """Let whatever is begun within the block take what memory it will."""
    token = _ANY_SIZE.set(True)
    try:
        yield
    finally:
        _ANY_SIZE.reset(token)


def free_memory() -> float:
    """[bytes] that this process may still take: the least of what the machine has, its container and its own limit leave."""
    left = [_of_the_machine(), *(_number(limit) - _number(used, 0.0) for limit, used in CGROUPS)]
    return max(min(*left, addresses_left()), 0.0)


def addresses_left() -> float:
    """[bytes] that this process' own limit (ulimit -v) leaves it."""
    own = resource.getrlimit(resource.RLIMIT_AS)[0]
    return float("inf") if own == resource.RLIM_INFINITY else max(own - own_addresses(), 0.0)


def _of_the_machine() -> float:
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        return next(1024.0 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable:"))
    except (OSError, StopIteration, ValueError, IndexError):
        return float("inf")


def _number(path: str, unknown: float = float("inf")) -> float:
    try:
        return float(Path(path).read_text(encoding="ascii"))
    except (OSError, ValueError):  # no such file, or "max"
        return unknown


def own_addresses() -> float:
    """Bytes of addresses that this process has taken; 0 where the system does not say."""
    try:
        return float(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError):
        return 0.0


def readable(size: float) -> str:
    """A number of bytes for people."""
    for unit, factor in (("EiB", 2.0**60), ("TiB", 2.0**40), ("GiB", 2.0**30)):
        if size >= factor:
            return f"{size / factor:.3g} {unit}"
    return f"{size / 2**20:.0f} MiB"


def refuse_beyond_memory(what: str, needed: float) -> None:
    """InputError where `what` would take more memory than is free ([bytes], about), unless the user said that any size will do."""
    free = free_memory()
    if needed > free and not _ANY_SIZE.get() and os.environ.get("FCSIM_ANY_SIZE", "0") in ("", "0"):
        raise InputError(
            f"{what}: takes about {readable(needed)} of memory, {readable(free)} are free; make it smaller, or begin all the same with "
            "FCSIM_ANY_SIZE=1 (fcsim run: --any-size)"
        )


def refuse_to_load_the_core() -> None:
    """InputError where this process' own limit leaves too few addresses for SciPy, numba and h5py, and they are not loaded yet."""
    if "numba" in sys.modules:
        return
    needed = CORE if "numpy" in sys.modules else CORE + NUMPY
    if (left := addresses_left()) < needed:
        taken = f"NumPy, SciPy and numba take about {readable(needed)}"
        raise InputError(f"memory: {taken}, this process' limit leaves {readable(left)}; raise it (ulimit -v)")


def refuse_to_load_libraries(package: str) -> None:
    """InputError where this process' own limit leaves too few addresses for MPI, dolfinx and gmsh, and the package is not loaded yet."""
    left = addresses_left()
    if left < LIBRARIES and package not in sys.modules:
        needed = f"the libraries of finite elements take about {readable(LIBRARIES)}"
        raise InputError(f"memory: {needed}, this process' limit leaves {readable(left)}; raise it (ulimit -v)")
