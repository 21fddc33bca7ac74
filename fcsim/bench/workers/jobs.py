"""Measurements by jobs of a cluster: each job serves one place of the bench for as long as it may last, with a worker process as on one
machine, so that limits, warmth and judgement are the same.

Questions and replies are files of a folder that both sides see. A job that ends in between, by its own time or otherwise, is followed by
another one; what two jobs in turn did not survive is recorded as CRASHED. A job whose bench is gone for PATIENCE ends.
"""

from __future__ import annotations

import json
import shutil
import threading
import time
import uuid
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fcsim.bench.results import Measurement
from fcsim.bench.workers.launch import Launcher, WorkerProcess
from fcsim.bench.workers.worker import STARTING, Request, Settings, blank, grace
from fcsim.cluster import Cluster, cancel, error_of, executor, found_by_jobs
from fcsim.errors import InputError
from fcsim.files import replacing

if TYPE_CHECKING:
    from submitit import AutoExecutor, Job

LOOK, BEAT, PATIENCE, POLITE = 0.1, 10.0, 120.0, 5.0
"""[s] between two looks at the folder; between two signs of life of the bench; without one until a job ends; until one is cancelled."""
ALIVE, END = "alive", "end"


@dataclass(frozen=True)
class Post:
    """Where a job finds its questions, and for how long it serves [s]."""

    bench: str
    folder: str
    settings: Settings
    seconds: float


def longest(time_limit: float) -> float:
    """[s] that a measurement may take, the start of its process and the reading of its problem included."""
    return STARTING + 2 * (time_limit + grace(time_limit))


def serve(post: Post) -> None:
    """Answer the questions of a folder: the work of a job."""
    folder, alive = Path(post.folder), Path(post.bench) / ALIVE
    worker = WorkerProcess(post.settings, ())
    begin = since = time.monotonic()
    seen, served = 0, 0
    try:
        while True:
            asked = folder / f"{served}.request.json"
            if asked.is_file():
                request = Request(**json.loads(asked.read_text(encoding="utf-8")))
                if time.monotonic() - begin + longest(request.time_limit) > post.seconds and served:
                    return  # another job will
                _write(folder / f"{served}.reply.json", _reply(worker, request))
                served, since = served + 1, time.monotonic()
                continue
            if (folder / END).exists():
                return
            if (sign := _sign(alive)) != seen:
                seen, since = sign, time.monotonic()
            elif time.monotonic() - since > PATIENCE:
                return
            time.sleep(LOOK)
    finally:
        worker.end()


def _reply(worker: WorkerProcess, request: Request) -> dict[str, object]:
    try:
        return asdict(worker.measure(request))
    except InputError as error:
        return {"input_error": str(error)}


def _sign(alive: Path) -> int:
    """Changes as long as the bench lives; clocks of different machines are not compared."""
    try:
        return alive.stat().st_mtime_ns
    except OSError:
        return 0


def _write(path: Path, content: dict[str, object]) -> None:
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(content), encoding="utf-8")


class JobWorker:
    """The bench's side of a job that serves, followed by others."""

    def __init__(self, hand_out: AutoExecutor, lock: threading.Lock, bench: Path, settings: Settings, seconds: float) -> None:
        self._hand_out, self._lock, self._bench, self._settings, self._seconds = hand_out, lock, bench, settings, seconds
        self._job: Job[None] | None = None
        self._folder, self._asked = bench, 0
        self._closed = threading.Event()

    def _submit(self) -> Job[None]:
        self._folder, self._asked = self._bench / uuid.uuid4().hex[:12], 0
        self._folder.mkdir()
        post = Post(str(self._bench), str(self._folder), self._settings, self._seconds)
        with self._lock, found_by_jobs():
            self._job = self._hand_out.submit(serve, post)
        return self._job

    def measure(self, request: Request) -> Measurement:
        """Have a measurement made. Raises InputError where the problem cannot be read."""
        why = ""
        for _ in range(2):
            job = self._job or self._submit()
            reply = self._answered(job, request)
            if reply is None and not self._closed.is_set() and not (why := error_of(job)):  # its time was up
                reply = self._answered(self._submit(), request)
            if reply is not None:
                if "input_error" in reply:
                    raise InputError(str(reply["input_error"]))
                return Measurement(**reply)  # type: ignore[arg-type] # fields that its worker wrote
            self._job = None
            if self._closed.is_set():
                break
        return blank(request, self._settings, f"CRASHED: {why or 'its job ended without a word'}")

    def _answered(self, job: Job[None], request: Request) -> dict[str, object] | None:
        """The reply of a job, None where it ended instead or the bench did."""
        reply = self._folder / f"{self._asked}.reply.json"
        _write(self._folder / f"{self._asked}.request.json", asdict(request))
        while not self._closed.wait(LOOK):
            ended = job.done()
            if reply.is_file():
                self._asked += 1
                found: dict[str, object] = json.loads(reply.read_text(encoding="utf-8"))
                return found
            if ended:
                return None
        return None

    def end(self) -> Job[None] | None:
        """Tell the job to end; the job, None where there is none."""
        self._closed.set()
        if self._job is not None:
            (self._folder / END).touch()
        return self._job


@contextmanager
def by_jobs(settings: Settings, cluster: Cluster, folder: Path, time_limit: float) -> Iterator[Launcher]:
    """`cluster.at_once` jobs that serve, submitted when they are first needed; their files in a folder of their own within `folder`.

    time_limit: [s] of each measurement; a job must last for one at least, InputError where it does not.
    """
    if cluster.seconds < longest(time_limit):
        raise InputError(
            f"--job-time: expected at least {longest(time_limit):.0f} s, which one measurement may take, got {cluster.seconds:g}"
        )
    bench = folder.resolve() / uuid.uuid4().hex[:12]
    hand_out, lock = executor(bench / "submitted", cluster, "fcsim-bench"), threading.Lock()
    idle = [JobWorker(hand_out, lock, bench, settings, cluster.seconds) for _ in range(cluster.at_once)]
    workers, ended, here = tuple(idle), threading.Event(), threading.local()

    def live() -> None:
        while True:
            (bench / ALIVE).touch()
            if ended.wait(BEAT):
                return

    def adopt() -> None:
        here.worker = idle.pop()

    def measured(request: Request) -> Measurement:
        worker: JobWorker = here.worker
        return worker.measure(request)

    threading.Thread(target=live, daemon=True).start()
    threads = ThreadPoolExecutor(cluster.at_once, initializer=adopt)
    try:
        yield Launcher(lambda request: threads.submit(measured, request), cluster.at_once)
    finally:
        threads.shutdown(wait=False, cancel_futures=True)
        _end([job for worker in workers if (job := worker.end()) is not None])
        ended.set()
        threads.shutdown()
        shutil.rmtree(bench, ignore_errors=True)


def _end(jobs: list[Job[None]]) -> None:
    """Let jobs end by themselves, as those do that measure nothing; cancel the others."""
    deadline = time.monotonic() + POLITE
    while time.monotonic() < deadline and not all(job.done() for job in jobs):
        time.sleep(LOOK)
    cancel(job for job in jobs if not job.done())
