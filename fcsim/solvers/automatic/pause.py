"""Newton's pauses: after it has failed on a problem it is not tried on the next ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fcsim.solvers.automatic.first import newton_first
from fcsim.solvers.automatic.race import Race, Stage, run
from fcsim.solvers.base import Iterate, Monitor, Status
from fcsim.solvers.memory import Kept, Memory
from fcsim.solvers.newton.expected import LastVelocities
from fcsim.solvers.newton.systems.condensed import KeptCondensation

FAILS = (Status.SINGULAR, Status.STAGNATED, Status.DIVERGED)
NEWTON = "Newton"
LONGEST_PAUSE, LONGER = 32, 4
"""Problems, and how many times as long a pause is as the one before. With two for four steps of turning walls take 1.1 to 1.25 times the
solver's time, of a wall whose nodes touch 1.13 times, and of elastic and rigid bricks about the same."""


@dataclass(frozen=True, eq=False)
class Pauses(Kept):
    """After Newton has failed on a problem that follows it is not tried on the next `length` ones, of which `left` are to come; each time
    in turn `LONGER` times as many. Where contacts do not hold the bodies uniquely it fails in step after step, at the price of an
    elimination."""

    length: int = field(kw_only=True)
    left: int = field(kw_only=True)


@dataclass(frozen=True, eq=False)
class Pause(Pauses):
    """Where ranks have W together, and where q follows the solution."""


@dataclass(frozen=True, eq=False)
class PauseInRace(Pauses):
    """In the race, whose problems may be those on which Newton has paused where q follows. What fails once may be that step's own: none
    before it has failed twice in a row."""


def paused(monitor: Monitor, kind: type[Pauses] = Pause) -> bool:
    """Whether Newton is not tried on this problem, which then counts."""
    pause = None if monitor.memory is None else monitor.memory.earlier(kind)
    if monitor.memory is None or pause is None:
        return False
    if kind is PauseInRace and _passed_over_before(monitor.memory):
        return True
    if not pause.left:
        return False
    monitor.memory = monitor.memory.having(replace(pause, left=pause.left - 1))
    return True


def _passed_over_before(memory: Memory) -> bool:
    """Whether Newton has been passed over on this problem where q follows, as in turning bodies' steps: where it has failed in the race
    as well it is not tried there either, and what is left of the race's own pause counts the problems on which it is tried and fails."""
    pause = memory.earlier(Pause)
    return pause is not None and pause.left < pause.length


def passed_over(memory: Memory | None) -> Memory | None:
    """What remains of the memory where Newton pauses on a problem whose q follows its solution, which then counts; None where it is tried,
    or there is none: who passes it over need not ask what follows from the start."""
    pause = None if memory is None else memory.earlier(Pause)
    if memory is None or pause is None or not pause.left:
        return None
    return memory.having(replace(pause, left=pause.left - 1))


def tried(monitor: Monitor, status: Status, kind: type[Pauses] = Pause) -> None:
    """Remember how Newton has ended."""
    if monitor.memory is None:
        return
    if status not in FAILS:
        monitor.memory = monitor.memory.without(kind)
        return
    pause = monitor.memory.earlier(kind)
    length = int(kind is Pause) if pause is None else min(max(LONGER * pause.length, 1), LONGEST_PAUSE)
    monitor.memory = monitor.memory.having(kind(np.empty(0, dtype=np.int64), length=length, left=length))


def newton_goes_on(memory: Memory | None) -> bool:
    """Whether Newton, which has answered the problem before and left what its systems are made of, will most likely begin the next one and
    answer it: who makes that problem need not make what Newton does not ask for, as the entries of W."""
    if memory is None or memory.earlier(LastVelocities) is None or memory.earlier(PauseInRace) is not None:
        return False
    kept = memory.earlier(KeptCondensation)
    return kept is not None and kept.pattern is not None


def run_with_pauses(race: Race, stages: Sequence[Stage], exhausted: Callable[[Race], bool]) -> Iterate:
    """`race.run`, without Newton's stage where it pauses. Only where it would be the first one from a warm start, of bodies with many
    velocities, of which it is not known what contacts hold: from zero it is always tried."""
    pausing = race.warm and not race.prices.in_velocities and newton_first(race)
    if pausing and paused(race.monitor, PauseInRace):
        race.options = replace(race.options, without=(*race.options.without, NEWTON))
        return run(race, [stage for stage in stages if stage.name != NEWTON], exhausted)
    iterate = run(race, stages, exhausted)
    runner = race.runners.get(NEWTON)
    if pausing and runner is not None and runner.result is not None:
        tried(race.monitor, runner.result.status, PauseInRace)
    return iterate
