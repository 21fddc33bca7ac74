"""`auto` on a problem whose q follows its solution: its Newton, where it would begin with that."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.problem import Followed
from fcsim.solvers.automatic.costs import Prices
from fcsim.solvers.automatic.methods import newton_options
from fcsim.solvers.automatic.race import Race
from fcsim.solvers.automatic.stages import AutomaticOptions, newton_first
from fcsim.solvers.base import Iterate, Monitor, Status
from fcsim.solvers.memory import Kept, Memory
from fcsim.solvers.newton.iterations import local_turns
from fcsim.solvers.newton.spaces import FollowingSpace
from fcsim.solvers.turns import to_the_end

FAILS = (Status.SINGULAR, Status.STAGNATED, Status.DIVERGED)
LONGEST_PAUSE = 32
"""Problems."""


@dataclass(frozen=True, eq=False)
class Pause(Kept):
    """After Newton has failed on a problem that follows it is not tried on the next `length` ones, of which `left` are to come; each time
    in turn twice as many. Where contacts do not hold the bodies uniquely it fails in step after step, at the price of an elimination."""

    length: int = field(kw_only=True)
    left: int = field(kw_only=True)


def automatic_followed(problem: Followed, r: FloatArray, monitor: Monitor, options: AutomaticOptions) -> Iterate:
    """Newton from r (m,), see `FollowingSpace`. Where it is not the stage that begins, or has just failed on others (`Pause`), r without an
    iteration: W is that of all q, and what goes on is `automatic` on a problem that stays as it is."""
    pause = None if monitor.memory is None else monitor.memory.earlier(Pause)
    if pause is not None and pause.left and monitor.memory is not None:
        monitor.memory = monitor.memory.having(replace(pause, left=pause.left - 1))
        return Iterate(r, Status.STAGNATED)
    local = problem.local
    operator, fitting = local.delassus, local.stored()
    race = Race(fitting, fitting, monitor, options, Prices(fitting, operator.entries, operator.joints), bool(np.any(r)), operator.joints, r)
    if "Newton" in options.without or not newton_first(race):
        return Iterate(r, Status.STAGNATED)
    iterate = to_the_end(local_turns(local, r, monitor, newton_options(race), space_of=partial(FollowingSpace, problem, monitor)))
    if monitor.memory is not None:
        monitor.memory = _after(monitor.memory, pause, iterate.status)
    return iterate


def _after(memory: Memory, pause: Pause | None, status: Status) -> Memory:
    """The memory once Newton has ended."""
    if status not in FAILS:
        return memory.without(Pause)
    length = 1 if pause is None else min(2 * pause.length, LONGEST_PAUSE)
    return memory.having(Pause(np.empty(0, dtype=np.int64), length=length, left=length))
