"""A run in a process of its own, watched from outside: its limits, its log, and how it ended, whatever that was."""

from __future__ import annotations

import fcntl
import glob
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import IO

from fcsim.apart.reading import with_our_modules
from fcsim.bench.workers.killable import resident
from fcsim.campaign.record import CRASHED, FINISHED, INTERRUPTED, MEMORY_LIMIT, STATUSES, TIME_LIMIT, Limits, Place, Record, stands
from fcsim.memory import readable
from fcsim.running.outputs import RunOptions
from fcsim.runtime import THREAD_VARIABLES

POLITE = 60.0
"""[s] that a run has to end its step and write its checkpoint, before it is killed."""
WORKER = ("-m", "fcsim.campaign.worker")
LOOK = 0.05
"""[s] between two looks at a process."""


@dataclass(frozen=True)
class Task:
    """One run of a sweep, as its process is told."""

    sweep: str
    name: str
    script: str
    assignments: Mapping[str, str]
    limits: Limits = field(default_factory=Limits)
    options: RunOptions = field(default_factory=RunOptions)
    plugins: Sequence[str] = ()
    threads: int = 1
    accept_changes: bool = False
    anew: bool = False
    """Whether what an earlier process left is replaced, not gone on with."""

    @property
    def place(self) -> Place:
        return Place(Path(self.sweep), self.name)


def make_run(task: Task, stop: threading.Event | None = None) -> Record:
    """Make a run, or go on with it, and note how it ended.

    Where another process is at it (a job that outlived its sweep), its end is waited for; what it finished since is not made again. A
    process above its memory limit is killed at once, since it grows; at its time limit, and once `stop` is set, it is asked to write its
    checkpoint first. Raises OSError where log or record cannot be written.
    """
    place = task.place
    for folder in (place.log.parent, place.record.parent):
        folder.mkdir(parents=True, exist_ok=True)
    with place.log.open("a", encoding="utf-8") as log:
        waited, known = _waited(log, stop), place.known()
        if _set(stop) or known.status == FINISHED or (waited and stands(known, task.limits)):
            return known
        for left in place.record.parent.glob(f".{glob.escape(place.name)}.*.partial*"):  # by a process that was killed as it wrote
            left.unlink(missing_ok=True)
        place.record.unlink(missing_ok=True)  # of an earlier process, which is no longer the last
        record = _made(task, log, stop)
        place.write(record)
        return record


def _waited(log: IO[str], stop: threading.Event | None) -> bool:
    """Take the lock on a run's log, which goes with the process that holds it; whether another one had to end first."""
    waited = False
    while not _set(stop):
        try:
            fcntl.flock(log, fcntl.LOCK_EX | fcntl.LOCK_NB)
            break
        except BlockingIOError:
            waited = True
            time.sleep(10 * LOOK)
        except OSError:  # no locks on this file system
            break
    return waited


def _set(stop: threading.Event | None) -> bool:
    return stop is not None and stop.is_set()


def _made(task: Task, log: IO[str], stop: threading.Event | None) -> Record:
    begin = time.monotonic()
    process = _started(task, log)
    try:
        how, peak = _watched(process, task.limits, stop, begin)
        said = process.stdout.read() if process.stdout is not None else ""
    finally:
        if process.poll() is None:
            _end(process, kill=False)
        if process.stdout is not None:
            process.stdout.close()
    return replace(
        _record(said, process.returncode, how, task.limits),
        seconds=round(time.monotonic() - begin, 2),
        peak_memory=round(peak, 1),
        time_limit=task.limits.time,
        memory_limit=task.limits.memory,
    )


def _started(task: Task, log: IO[str]) -> subprocess.Popen[str]:
    environment = with_our_modules() | {"FCSIM_THREADS": str(task.threads), "NUMBA_NUM_THREADS": str(task.threads)}
    for name in THREAD_VARIABLES:  # libraries that read them as they are loaded
        environment[name] = str(task.threads)
    process = subprocess.Popen(
        [sys.executable, *WORKER, str(os.getpid())],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=log,
        text=True,
        env=environment,
        start_new_session=True,  # Ctrl-C is for the sweep, which ends its runs
    )
    assert process.stdin is not None
    try:
        process.stdin.write(json.dumps(asdict(task)))
        process.stdin.close()
    except OSError:  # it has ended already, and its end tells how
        pass
    return process


def _watched(process: subprocess.Popen[str], limits: Limits, stop: threading.Event | None, begin: float) -> tuple[str, float]:
    """Wait for the end of a process, or end it; why it was ended, empty where it was not, and the most memory that was seen [MiB]."""
    how, peak = "", 0.0
    deadline = None if limits.time is None else begin + limits.time
    while process.poll() is None:
        peak = max(peak, resident(process.pid))
        if limits.memory is not None and peak > limits.memory:
            how = MEMORY_LIMIT
            _end(process, kill=True)
        elif deadline is not None and time.monotonic() > deadline:
            how = TIME_LIMIT
            _end(process, kill=False)
        elif _set(stop):
            how = INTERRUPTED
            _end(process, kill=False)
        else:
            time.sleep(LOOK)
    return how, peak


def _end(process: subprocess.Popen[str], *, kill: bool) -> None:
    """End a process and what it started, politely for so long as it may take to write a checkpoint."""
    if not kill:
        process.terminate()
        try:
            process.wait(POLITE)
        except subprocess.TimeoutExpired:
            kill = True
    if kill:
        try:
            os.killpg(process.pid, signal.SIGKILL)
        except ProcessLookupError:
            process.kill()
        process.wait()


def _record(said: str, code: int, how: str, limits: Limits) -> Record:
    """What a process said of its run, or what is to be said of it."""
    last = said.strip().splitlines()[-1] if said.strip() else ""
    try:
        told = json.loads(last)
        status, message = str(told["status"]), str(told["message"])
    except (ValueError, KeyError, TypeError):
        ended = f"signal {-code} ({signal.Signals(-code).name})" if code < 0 else f"exit code {code}"
        status, message = CRASHED, f"its process ended without a word, {ended}"
    if status not in STATUSES:
        status, message = CRASHED, f"its process said {status[:60]!r}"
    if how == MEMORY_LIMIT:
        return Record(MEMORY_LIMIT, f"above {readable((limits.memory or 0.0) * 2**20)}")
    if how == TIME_LIMIT and status in (INTERRUPTED, CRASHED):
        return Record(TIME_LIMIT, f"not finished within {limits.time:g} s")
    if how == INTERRUPTED and status == CRASHED:
        return Record(INTERRUPTED, "interrupted with the sweep")
    return Record(status, message)
