"""What belongs to the whole process, in one place: threads, freed memory, dolfinx/PETSc, gmsh.

* `threads` says how many threads of its own fcsim uses (`fcsim.threads`): FCSIM_THREADS, else the cores that the process may use. They
  change no result.
* BLAS and OpenMP threads change the order of sums and fight with ours, MUMPS and other processes, so that `solve`, a step of a simulation
  and the command line limit them to one for as long as they run (`limited_threads`), unless the user's environment (OMP_NUM_THREADS,
  OPENBLAS_NUM_THREADS, ...) says otherwise. A program that imports fcsim keeps its own number outside these calls.
* Large arrays that are freed in one step and made again in the next stay with the process (`keep_freed_memory`).
* `dolfinx()` and `petsc()` are the only doors to those packages: where the `dolfinx_solver` wheel exists it must be imported first.
* The working directory is a place, not a source (`without_local_options`): numba reads .numba_config.yaml there (where compiled functions
  are loaded from), dolfinx dolfinx_jit_options.json (arguments of the C compiler), PETSc .petscrc (files it writes, libraries it loads),
  matplotlib matplotlibrc (programs it calls), and `python -c` every module: a folder of somebody else's results would run their code.
* `gmsh_model()` is the only place that initialises and finalises gmsh, so that a failure inside cannot poison what comes next. A process
  has one gmsh: threads wait for each other there.
"""

from __future__ import annotations

import ctypes
import os
import platform
import signal
import stat
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import ContextDecorator, contextmanager
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

from threadpoolctl import LibController, ThreadpoolController

from fcsim.errors import InputError, MissingDependency
from fcsim.memory import refuse_to_load_libraries

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


def _lock_over_forks() -> threading.Lock:
    """A lock that no fork takes along closed: the thread that would open it is not in the child."""
    lock = threading.Lock()
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(before=lock.acquire, after_in_parent=lock.release, after_in_child=lock.release)
    return lock


class _Limits:
    """Numbers of threads that blocks found, whose they are while one lasts: each block lowers, the last to end restores."""

    def __init__(self) -> None:
        self._lock = _lock_over_forks()
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


def writable_caches() -> None:
    """Let compiled forms (ffcx) and functions (numba) be kept in a private folder for temporary files where HOME cannot be written."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path(os.path.expanduser("~")) / ".cache")  # noqa: PTH111 - Path.home() may raise
    existing = next((folder for folder in (cache, *cache.parents) if folder.exists()), Path("/"))
    if os.access(existing, os.W_OK | os.X_OK) and not existing.as_posix().startswith("/proc"):
        return
    private = Path(tempfile.gettempdir()) / f"fcsim-cache-{os.getuid()}"
    try:
        private.mkdir(mode=0o700, exist_ok=True)
        about = private.lstat()
        if not stat.S_ISDIR(about.st_mode) or about.st_uid != os.getuid() or about.st_mode & 0o077:  # what is compiled is loaded
            private = Path(tempfile.mkdtemp(prefix="fcsim-cache-"))
    except OSError:
        return
    os.environ["XDG_CACHE_HOME"] = str(private)
    if not os.access(Path(__file__).parent, os.W_OK):
        os.environ.setdefault("NUMBA_CACHE_DIR", str(private / "numba"))


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


ELSEWHERE = Path(os.sep)
ISOLATED = "-P"
"""Of Python: no modules from the working directory."""


class _Away:
    """The working directory while blocks last within which it is `ELSEWHERE`: the first to begin leaves it, the last to end returns."""

    def __init__(self) -> None:
        self._lock = _lock_over_forks()
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


@cache  # the working directory is left once, not at every call
def _import(name: str) -> ModuleType:
    refuse_to_load_libraries(name)
    with without_local_options():
        module = _import_in_order(name)
    _restore_signal_handlers()  # MPI may have taken some
    return module


def _import_in_order(name: str) -> ModuleType:
    if find_spec("dolfinx_solver") is not None:  # the wheel that brings dolfinx, petsc4py and MPI must be loaded before them
        import_module("dolfinx_solver")
    if has_petsc() and "petsc4py.PETSc" not in sys.modules:
        # PETSc's signal handlers would turn a closed pipe or Ctrl-C into an MPI abort
        import_module("petsc4py").init(["fcsim", "-no_signal_handler"])
        import_module("petsc4py.PETSc").Options().delValue("no_signal_handler")
    return import_module(name)


def dolfinx() -> ModuleType:
    """Return the dolfinx package (>= 0.10) with its mesh, fem and io modules loaded; MissingDependency where it is absent."""
    try:
        package = _import("dolfinx")
        for module in ("mesh", "fem", "io", "jit"):
            import_module(f"dolfinx.{module}")
        _read_options()
    except ImportError as error:
        raise MissingDependency(
            f"dolfinx is needed for assembly and cannot be imported ({error}): pip install 'fcsim[fem]', or bring dolfinx >= 0.10"
        ) from None
    return package


@cache
def _read_options() -> None:
    """Have dolfinx and ffcx read their options now, once; they keep what they read."""
    with without_local_options():
        import_module("dolfinx.jit").get_options()
        import_module("ffcx.options").get_options()


def petsc() -> ModuleType:
    """Return petsc4py.PETSc, initialised; MissingDependency where it is absent."""
    try:
        return _import("petsc4py.PETSc")
    except ImportError as error:
        raise MissingDependency(f"PETSc (petsc4py) cannot be imported ({error}): pip install 'fcsim[fem]', or bring it") from None


def mpi() -> ModuleType:
    """Return mpi4py.MPI, initialised; MissingDependency where it is absent."""
    try:
        return _import("mpi4py.MPI")
    except ImportError as error:
        raise MissingDependency(f"mpi4py cannot be imported ({error}): pip install 'fcsim[fem]', or bring it") from None


def has_petsc() -> bool:
    """Whether petsc4py is there (without loading it)."""
    return find_spec("dolfinx_solver") is not None or find_spec("petsc4py") is not None


_GMSH = threading.RLock()


def _free_gmsh() -> None:
    """In a child: the thread that may hold the lock is not there."""
    global _GMSH
    _GMSH = threading.RLock()


os.register_at_fork(after_in_child=_free_gmsh)


@contextmanager
def gmsh_model(name: str) -> Iterator[ModuleType]:
    """Yield the gmsh module with a new, empty model; gmsh is finalised however the block ends.

    gmsh's own signal handlers and terminal output are off: errors come as exceptions. InputError where the program works with gmsh itself:
    its models and options are not ours, and what it has set would change our meshes.
    """
    try:
        import gmsh
    except (ImportError, OSError) as error:  # OSError: the wheel's library misses a system library
        raise MissingDependency(
            f"gmsh cannot be imported ({error}): pip install 'fcsim[fem]'; its wheel loads X and GL libraries, on Debian: "
            "apt-get install libglu1-mesa libxcursor1 libxft2 libxinerama1 libxrender1 libxext6"
        ) from None
    with _GMSH:
        if gmsh.isInitialized():
            raise InputError(
                f"mesh of {name!r}: expected gmsh to be free, and it is in use (gmsh.initialize(), or a block of gmsh_model): make the "
                "mesh before, or after gmsh.finalize()"
            )
        gmsh.initialize(interruptible=False, argv=["", "-nopopup"], readConfigFiles=False)  # options of a user's home would change meshes
        _restore_signal_handlers()
        try:
            gmsh.option.setNumber("General.Terminal", 0)
            gmsh.model.add(name)
            yield gmsh
        finally:
            gmsh.finalize()
            _restore_signal_handlers()


def _restore_signal_handlers() -> None:
    """Install Python's handlers again, ignored signals included: gmsh's library replaces those of SIGTERM, SIGPIPE and others when it
    starts and when it ends."""
    if threading.current_thread() is threading.main_thread():
        for number in signal.valid_signals():
            handler = signal.getsignal(number)
            if callable(handler) or handler == signal.SIG_IGN:
                signal.signal(number, handler)
