"""Newton's pauses: after it has failed on a problem it is not tried on the next ones."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from fcsim.solvers.base import Monitor, Status
from fcsim.solvers.memory import Kept

FAILS = (Status.SINGULAR, Status.STAGNATED, Status.DIVERGED)
LONGEST_PAUSE = 32
"""Problems."""


@dataclass(frozen=True, eq=False)
class Pause(Kept):
    """After Newton has failed on a problem that follows it is not tried on the next `length` ones, of which `left` are to come; each time
    in turn twice as many. Where contacts do not hold the bodies uniquely it fails in step after step, at the price of an elimination."""

    length: int = field(kw_only=True)
    left: int = field(kw_only=True)


def paused(monitor: Monitor) -> bool:
    """Whether Newton is not tried on this problem, which then counts."""
    pause = None if monitor.memory is None else monitor.memory.earlier(Pause)
    if monitor.memory is None or pause is None or not pause.left:
        return False
    monitor.memory = monitor.memory.having(replace(pause, left=pause.left - 1))
    return True


def tried(monitor: Monitor, status: Status) -> None:
    """Remember how Newton has ended."""
    if monitor.memory is None:
        return
    if status not in FAILS:
        monitor.memory = monitor.memory.without(Pause)
        return
    pause = monitor.memory.earlier(Pause)
    length = 1 if pause is None else min(2 * pause.length, LONGEST_PAUSE)
    monitor.memory = monitor.memory.having(Pause(np.empty(0, dtype=np.int64), length=length, left=length))
