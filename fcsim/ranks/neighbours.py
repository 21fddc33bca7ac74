"""The other ranks' processes on this machine: whether they are still there, and run. A process that is killed says nothing to anybody, and
not every launcher ends the others then (srun without --kill-on-bad-exit, mostly mpiexec -disable-auto-cleanup): they would wait on and
on."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

Process = tuple[str, int, int]
"""Machine and its space of process numbers, number, start [ticks since the machine's]: two processes differ in one; machine "": unknown."""


def this_process() -> Process:
    """The process that calls."""
    try:
        machine = Path("/proc/sys/kernel/random/boot_id").read_text().strip() + str(Path("/proc/self/ns/pid").readlink())
    except OSError:
        return "", 0, 0
    started = _started(os.getpid())
    return ("", 0, 0) if started is None else (machine, os.getpid(), started)


def on_this_machine(processes: Sequence[Process]) -> dict[int, Process]:
    """Of the ranks' processes, in their order, those whose end can be seen from here, by rank."""
    machine = this_process()[0]
    return {rank: process for rank, process in enumerate(processes) if machine and process[0] == machine and process[1] != os.getpid()}


def gone(processes: Mapping[int, Process], ranks: Iterable[int]) -> list[int]:
    """Those of the ranks whose process has ended."""
    return [rank for rank in ranks if _started(processes[rank][1]) != processes[rank][2]]


def stopped(processes: Mapping[int, Process], ranks: Iterable[int]) -> list[int]:
    """Those of the ranks whose process is held, by SIGSTOP or a debugger."""
    return [rank for rank in ranks if (fields := _stat(processes[rank][1])) and fields[0] in "Tt"]


def _started(number: int) -> int | None:
    """When the process began; None where none of that number runs (one that has ended, and whose parent has not asked yet, does not)."""
    fields = _stat(number)
    return None if not fields or fields[0] in "ZX" else int(fields[19])


def _stat(number: int) -> list[str]:
    """What the machine says of a process, from its state on; nothing where there is none."""
    try:
        return Path(f"/proc/{number}/stat").read_text(errors="replace").rpartition(")")[2].split()  # the name before may hold blanks
    except OSError:
        return []
