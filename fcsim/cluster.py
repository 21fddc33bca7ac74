"""The one door to submitit: jobs of a cluster (Slurm, as an array), or its executor for this machine, as tests use it.

A job's work, its folder and what it left are on a file system that all machines share. Jobs outlive who submitted them when that is killed;
who is interrupted cancels them.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from fcsim.errors import InputError, MissingDependency

if TYPE_CHECKING:
    from submitit import AutoExecutor, Job

type Kind = Literal["slurm", "jobs"]
"""jobs: of submitit's executor for this machine."""

MARGIN = 240.0
"""[s] that a job has beyond its work's own limit: to start, to write a checkpoint, and what submitit wants as warning time."""
LOOK = {"jobs": 0.2, "slurm": 2.0}
"""[s] between two looks at jobs."""


@dataclass(frozen=True)
class Cluster:
    """What a job may take: wall time [s], memory [MiB] (None: as the cluster has it), threads; how many run at a time; and submitit's own
    options of Slurm by their names, without the prefix: partition, account, qos, ..."""

    kind: Kind
    seconds: float
    at_once: int
    threads: int = 1
    memory: float | None = None
    options: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not (self.seconds > 0 and math.isfinite(self.seconds)):
            raise InputError(f"--time-limit: expected a finite number of seconds > 0, which a job of a cluster needs, got {self.seconds:g}")
        if self.at_once < 1:
            raise InputError(f"--jobs: expected a whole number >= 1, got {self.at_once}")


@dataclass(frozen=True)
class Jobs:
    """Of jobs that were submitted: the number of one that has ended, None where none has since the last look, and the error that it
    raised or why it left none, empty where it ended well; the numbers of those that have not ended; what its function returned."""

    ended: int | None
    error: str
    left: tuple[int, ...]
    result: object


def executor(folder: Path, cluster: Cluster, name: str) -> AutoExecutor:
    """submitit's executor. MissingDependency without submitit; InputError where there is no such cluster, or for an option it lacks."""
    try:
        import submitit
    except ImportError as error:
        raise MissingDependency(f"submitit is needed for jobs and cannot be imported ({error}): pip install 'fcsim[cluster]'") from None
    folder.mkdir(parents=True, exist_ok=True)
    memory = None if cluster.memory is None else cluster.memory / 1024
    try:
        made = submitit.AutoExecutor(folder=folder, cluster="local" if cluster.kind == "jobs" else cluster.kind)
        made.update_parameters(
            name=name, timeout_min=math.ceil((cluster.seconds + MARGIN) / 60), cpus_per_task=cluster.threads, mem_gb=memory
        )
        if cluster.kind == "slurm":
            made.update_parameters(
                slurm_array_parallelism=cluster.at_once, **{f"slurm_{key}": text for key, text in cluster.options.items()}
            )
    except (RuntimeError, ValueError, NameError, AssertionError) as error:
        raise InputError(f"--launcher {cluster.kind}: {' '.join(str(error).split())[:400]}") from None
    return made


def run_jobs[T](function: Callable[[T], object], arguments: Sequence[T], folder: Path, cluster: Cluster, name: str) -> Generator[Jobs]:
    """Have `function` called with each of the arguments, each in a job of its own, and yield how they come along.

    Slurm gets one array of all; of this machine's jobs `at_once` are started at a time. What has not ended when the generator is closed
    is cancelled.
    """
    if not arguments:
        return
    hand_out = executor(folder, cluster, name)
    running: dict[int, Job[object]] = {}
    waiting = list(range(len(arguments)))[::-1]
    try:
        if cluster.kind == "slurm":
            with found_by_jobs():
                running = dict(enumerate(hand_out.map_array(function, arguments)))
            waiting = []
        while running or waiting:
            while waiting and len(running) < cluster.at_once:
                number = waiting.pop()
                with found_by_jobs():
                    running[number] = hand_out.submit(function, arguments[number])
            ended = [number for number, job in running.items() if job.done()]
            for number in ended:
                job = running.pop(number)
                error = error_of(job)
                yield Jobs(number, error, (*running, *waiting), None if error else job.result())
            if not ended:
                time.sleep(LOOK[cluster.kind])
                yield Jobs(None, "", (*running, *waiting), None)
    finally:
        cancel(running.values())


def cancel[T](jobs: Iterable[Job[T]]) -> None:
    """End jobs, which write what they have."""
    for job in jobs:
        with suppress(Exception):  # it has ended, or its cluster does not answer: nothing more can be done
            job.cancel(check=False)


def error_of[T](job: Job[T]) -> str:
    """What a job that has ended raised, in one line."""
    error = job.exception()
    if error is None:
        return ""
    lines = [line.strip() for line in str(error).splitlines() if line.strip() and not set(line.strip()) <= {"-"}]
    told = [line for line in lines if not line.startswith(("You can check", "- ", "at paths"))]
    return f"its job {job.job_id} failed: {told[-1] if told else type(error).__name__}"


@contextmanager
def found_by_jobs() -> Iterator[None]:
    """Jobs inherit the environment of who submits them; in it they find this fcsim."""
    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (str(Path(__file__).parents[1]), before)))
    try:
        yield
    finally:
        if before is None:
            del os.environ["PYTHONPATH"]
        else:
            os.environ["PYTHONPATH"] = before
