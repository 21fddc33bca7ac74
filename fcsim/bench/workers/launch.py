"""Where measurements are made: by worker processes of this machine, or of the ranks of an MPI job."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, cast

from fcsim.bench.results import Measurement
from fcsim.bench.workers.killable import Row
from fcsim.bench.workers.worker import Request, Settings, blank
from fcsim.errors import InputError, MissingDependency
from fcsim.runtime import ISOLATED, THREAD_VARIABLES

_MPI_VARIABLES = ("PMI", "PMIX", "MPI", "OMPI", "HYDRA", "HYDI", "MPIR", "MPICH")
_LOCAL_RANK = ("MPI_LOCALRANKID", "OMPI_COMM_WORLD_LOCAL_RANK", "SLURM_LOCALID")
_LOCAL_SIZE = ("MPI_LOCALNRANKS", "OMPI_COMM_WORLD_LOCAL_SIZE", "SLURM_NTASKS_PER_NODE")


@dataclass(frozen=True)
class Launcher:
    """`submit` asks for a measurement; `places` are made at a time."""

    submit: Callable[[Request], Future[Measurement]]
    places: int


def cores(place: int, places: int, threads: int) -> tuple[int, ...]:
    """The processors of one of `places`, none where they would have to be shared or cannot be chosen."""
    if not hasattr(os, "sched_getaffinity"):
        return ()
    allowed = sorted(os.sched_getaffinity(0))
    fitting = len(allowed) // threads
    if places > fitting:
        return ()
    first = (place % fitting) * threads
    return tuple(allowed[first : first + threads])


class WorkerProcess:
    """A running `fcsim.bench.workers.worker`, started again where it ended."""

    def __init__(self, settings: Settings, pinned: tuple[int, ...]) -> None:
        self.settings, self.pinned = settings, pinned
        self._process: subprocess.Popen[str] | None = None
        self._said: IO[str] | None = None
        self._pipes: list[IO[str]] = []
        self._folder = ""

    def _start(self) -> subprocess.Popen[str]:
        environment = {key: value for key, value in os.environ.items() if key.partition("_")[0] not in _MPI_VARIABLES}
        environment |= dict.fromkeys((*THREAD_VARIABLES, "NUMBA_NUM_THREADS", "FCSIM_THREADS"), str(self.settings.threads))
        known = [str(Path(__file__).parents[3]), environment.get("PYTHONPATH", "")]
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, known))
        self.close()
        self._said = TemporaryFile("w+", errors="replace")  # noqa: SIM115 - as long as the process
        process = subprocess.Popen(
            [sys.executable, ISOLATED, "-m", "fcsim.bench.workers.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            text=True,
            env=environment,
            start_new_session=True,  # Ctrl-C is for the bench, which ends its workers
        )
        self._process = process
        self._pipes = [pipe for pipe in (process.stdin, process.stdout, self._said) if pipe is not None]
        ready = self._ask({**asdict(self.settings), "cores": self.pinned})
        self._folder = ready["folder"] if ready is not None else ""
        return process

    def _ask(self, question: Mapping[str, object]) -> Row | None:
        """The reply, None where the worker ended instead."""
        process = self._process
        assert process is not None and process.stdin is not None and process.stdout is not None
        try:
            process.stdin.write(json.dumps(question) + "\n")
            process.stdin.flush()
        except OSError:
            return None
        line = process.stdout.readline()
        reply: Row | None = json.loads(line) if line.endswith("\n") else None
        if reply is not None and "input_error" in reply:
            raise InputError(reply["input_error"])
        return reply

    def measure(self, request: Request) -> Measurement:
        """Have a measurement made. Raises InputError where the problem cannot be read."""
        if self._process is None:
            self._start()
        reply = self._ask(asdict(request))
        if reply is not None:
            return Measurement(**reply)
        process, self._process = self._process, None
        code = self._ended(process) if process is not None else 0  # its pipe is closed: it is ending
        how = f"signal {-code}" if code < 0 else f"exit code {code}"
        status = f"CRASHED: the process that reads and judges the problem ended, {how} {self._last_words()}"
        return blank(request, self.settings, status.rstrip())

    def _last_words(self) -> str:
        assert self._said is not None
        self._said.seek(0)
        lines = str(self._said.read()).split("\n")
        return next((f"({line.strip()})" for line in reversed(lines) if line.strip()), "")

    def end(self) -> None:
        """End the process, and its children with it."""
        process, self._process = self._process, None
        if process is None:
            return
        process.terminate()
        try:
            process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            process.kill()
        self._ended(process)

    def _ended(self, process: subprocess.Popen[str]) -> int:
        """The exit code of a process that is ending; with it go what methods left running in it, and a folder that it could not remove."""
        code = process.wait()
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)  # it leads a session of its own
        if self._folder:
            shutil.rmtree(self._folder, ignore_errors=True)
        return code

    def close(self) -> None:
        """Close what was written to and read from processes that have ended, once no thread waits for them."""
        for pipe in self._pipes:
            with suppress(BrokenPipeError):  # of what was not read
                pipe.close()
        self._pipes = []


_here = threading.local()


def _measure_here(settings: Settings, pinned: tuple[int, ...], request: Request) -> Measurement:
    """By the worker of this thread."""
    if getattr(_here, "worker", None) is None:
        _here.worker = WorkerProcess(settings, pinned)
    worker: WorkerProcess = _here.worker
    return worker.measure(request)


def _measure_on_rank(settings: Settings, request: Request) -> Measurement:
    """By the worker of this MPI rank; rank 0 only hands out, so that as many ranks as processors and one more are not too many."""

    def number(names: tuple[str, ...], default: int) -> int:
        return int(next((os.environ[name] for name in names if os.environ.get(name, "").isdigit()), default))

    ranks = number(_LOCAL_SIZE, 1)
    return _measure_here(settings, cores(number(_LOCAL_RANK, 0), max(ranks - 1, 1), settings.threads), request)


@contextmanager
def local(settings: Settings, jobs: int) -> Iterator[Launcher]:
    """`jobs` worker processes, each on processors of its own where there are enough."""
    workers = [WorkerProcess(settings, cores(place, jobs, settings.threads)) for place in range(jobs)]
    idle = list(workers)

    def adopt() -> None:
        _here.worker = idle.pop()

    executor = ThreadPoolExecutor(jobs, initializer=adopt)
    try:
        yield Launcher(lambda request: executor.submit(_measure_here, settings, (), request), jobs)
    finally:
        executor.shutdown(wait=False, cancel_futures=True)
        for worker in workers:
            worker.end()
        executor.shutdown()
        for worker in workers:
            worker.close()


@contextmanager
def over_mpi(settings: Settings) -> Iterator[Launcher | None]:
    """One worker process a rank, rank 0 excepted if there are others; None on the ranks that have served, when all is done.

    For `mpiexec -n N python -m mpi4py.futures -m fcsim bench ...`, and the same without `-m mpi4py.futures`.
    """
    try:
        from mpi4py import MPI
        from mpi4py.futures import MPICommExecutor
    except ImportError as error:
        raise MissingDependency(f"--launcher mpi: mpi4py cannot be imported ({error}): pip install mpi4py") from None
    with MPICommExecutor(MPI.COMM_WORLD, root=0) as entered:
        executor = cast(Executor | None, entered)  # None where this rank has served
        if executor is None:
            yield None
        else:
            places = max(1, MPI.COMM_WORLD.Get_size() - 1)
            yield Launcher(lambda request: executor.submit(_measure_on_rank, settings, request), places)
