"""What became of each run of a sweep, and whether it is to be made again."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from fcsim.campaign.plan import FILE as SWEEP_FILE
from fcsim.errors import InputError
from fcsim.records import read_record, write_record
from fcsim.running.description import FILE, read_description

FINISHED, NOT_CONVERGED, FAILED, REFUSED = "finished", "not converged", "failed", "refused"
TIME_LIMIT, MEMORY_LIMIT, CRASHED, INTERRUPTED, WAITING = "time limit", "memory limit", "crashed", "interrupted", "waiting"
STATUSES = (FINISHED, NOT_CONVERGED, FAILED, REFUSED, TIME_LIMIT, MEMORY_LIMIT, CRASHED, INTERRUPTED, WAITING)
"""refused: its parameters make no case, or its script fails; crashed: its process ended without a word, or the machine did not let it
write; interrupted: it goes on from its checkpoint; waiting: it has not begun."""


@dataclass(frozen=True)
class Limits:
    """Of each process: wall time [s], resident memory [MiB]; None: no limit."""

    time: float | None = None
    memory: float | None = None


@dataclass(frozen=True)
class Record:
    """How the last process of a run ended, under which limits.

    seconds      [s] wall time of that process alone: earlier ones of an interrupted run had their own
    peak_memory  [MiB] resident, as it was seen
    """

    status: str
    message: str = ""
    seconds: float | None = None
    peak_memory: float | None = None
    time_limit: float | None = None
    memory_limit: float | None = None


@dataclass(frozen=True)
class Place:
    """Where the files of a run are in the folder of its sweep."""

    sweep: Path
    name: str

    @property
    def run(self) -> Path:
        return self.sweep / "runs" / self.name

    @property
    def record(self) -> Path:
        return self.sweep / "records" / f"{self.name}.json"

    @property
    def log(self) -> Path:
        return self.sweep / "logs" / f"{self.name}.txt"

    def known(self) -> Record:
        """What became of the run so far: by its own run.json where that says that it finished, else by what was noted of its process."""
        status = _said_by_the_run(self.run)
        noted = read_record(Record, self.record) if self.record.is_file() else None
        if noted is not None and noted.status not in STATUSES:
            raise InputError(f"{self.record}, 'status': expected one of {', '.join(STATUSES)}, got {noted.status!r}")
        if status == FINISHED:
            return noted if noted is not None and noted.status == FINISHED else Record(FINISHED)
        if noted is not None and noted.status != FINISHED:
            return noted
        return Record(INTERRUPTED if status is not None else WAITING)

    def write(self, record: Record) -> None:
        """Note how a process of the run ended; on the disk when it returns."""
        self.record.parent.mkdir(parents=True, exist_ok=True)
        write_record(self.record, record)


def _said_by_the_run(directory: Path) -> str | None:
    """The status in run.json, None where there is none; of a damaged one, as of a run that never ended."""
    if not (directory / FILE).is_file():
        return None
    try:
        return read_description(directory).status
    except InputError:
        return "running"


def stands(record: Record, limits: Limits, retry: bool = False) -> bool:
    """Whether a run is not made (again): it finished; or it ended by what would come again, unless `retry`, or by a limit no looser now."""
    if record.status == TIME_LIMIT:
        return not (retry or _looser(limits.time, record.time_limit))
    if record.status == MEMORY_LIMIT:
        return not (retry or _looser(limits.memory, record.memory_limit))
    return record.status == FINISHED or (not retry and record.status in (NOT_CONVERGED, FAILED, REFUSED))


def _looser(now: float | None, before: float | None) -> bool:
    return before is not None and (now is None or now > before)


def runs_in(folder: Path) -> list[Path]:
    """The runs that a folder stands for: a sweep's those that have begun, each by the order of its name; so does its folder `runs`, while
    `records` and `logs` hold none, so that SWEEP/*/ names each run once. Any other folder is itself one."""
    sweep = folder if (folder / SWEEP_FILE).is_file() else folder.parent
    if folder is not sweep and (folder.name not in ("runs", "records", "logs") or not (sweep / SWEEP_FILE).is_file()):
        return [folder]
    return sorted(path.parent for path in (sweep / "runs").glob(f"*/{FILE}")) if folder.name not in ("records", "logs") else []
