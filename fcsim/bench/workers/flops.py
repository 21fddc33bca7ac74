"""Floating point operations in double precision, from the processor's counters where the system lets them be read.

Linux on x86-64 only (perf_event_open). The events are the manufacturers': FP_ARITH_INST_RETIRED (Intel, since Broadwell; an instruction
counts as many as it has lanes) and PMCx003 Retired SSE/AVX FLOPs (AMD, since Zen 2; single precision included). Virtual machines often
have no counters, and /proc/sys/kernel/perf_event_paranoid above 2 forbids them: then nothing is counted.
"""

from __future__ import annotations

import ctypes
import os
import platform
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path

SYSCALL = 298
"""perf_event_open on x86-64."""
RAW = 4
INHERIT, EXCLUDE_KERNEL, EXCLUDE_HYPERVISOR = 1 << 1, 1 << 5, 1 << 6
ENABLED_AND_RUNNING = 3
"""Read with a count the times it was enabled and running, since the kernel shares counters out by turns."""


@dataclass(frozen=True)
class Event:
    """An event of perf_event_open and the operations that one count stands for."""

    type: int
    config: int
    weight: int = 1


_EVENTS = {
    "GenuineIntel": tuple(Event(RAW, 0xC7 | umask << 8, lanes) for umask, lanes in ((0x01, 1), (0x04, 2), (0x10, 4), (0x40, 8))),
    "AuthenticAMD": (Event(RAW, 0x03 | 0x0F << 8),),
}


@cache
def flop_events() -> tuple[Event, ...]:
    """This processor's events, none where they are not known."""
    if platform.system() != "Linux" or platform.machine() != "x86_64":
        return ()
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
        if line.startswith("vendor_id"):
            return _EVENTS.get(line.partition(":")[2].strip(), ())
    return ()


class Counters:
    """Counts of this process and of the threads that it starts, from now on; closed by `close`."""

    def __init__(self, events: Sequence[Event]) -> None:
        self._open: list[tuple[int, int]] = []
        libc = ctypes.CDLL(None, use_errno=True) if events else None
        for event in events:
            assert libc is not None
            flags = INHERIT | EXCLUDE_KERNEL | EXCLUDE_HYPERVISOR
            attributes = struct.pack("=IIQQQQQ16x", event.type, 64, event.config, 0, 0, ENABLED_AND_RUNNING, flags)
            file = libc.syscall(SYSCALL, attributes, 0, -1, -1, 0)
            if file < 0:
                self.close()
                return
            self._open.append((file, event.weight))

    def total(self) -> float | None:
        """Operations so far; None where they cannot be counted."""
        if not self._open:
            return None
        total = 0.0
        for file, weight in self._open:
            count, enabled, running = struct.unpack("=QQQ", os.read(file, 24))
            if running == 0:
                return None
            total += weight * count * enabled / running
        return total

    def close(self) -> None:
        for file, _ in self._open:
            os.close(file)
        self._open = []


@contextmanager
def counting(events: Sequence[Event] | None = None) -> Iterator[Counters]:
    """Count `events` (default: the processor's floating point operations) within the block."""
    counters = Counters(flop_events() if events is None else events)
    try:
        yield counters
    finally:
        counters.close()
