"""`auto` on a problem whose q follows its solution: its Newton, where it would begin with that."""

from __future__ import annotations

from functools import partial

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.problem import Followed
from fcsim.problem.distributed import DistributedDelassus
from fcsim.solvers.automatic.costs import Prices
from fcsim.solvers.automatic.first import newton_first
from fcsim.solvers.automatic.methods import newton_options
from fcsim.solvers.automatic.over_ranks import newton_over_ranks
from fcsim.solvers.automatic.pause import paused, tried
from fcsim.solvers.automatic.race import Race
from fcsim.solvers.automatic.stages import AutomaticOptions
from fcsim.solvers.base import Iterate, Monitor, Status
from fcsim.solvers.newton.iterations import local_turns
from fcsim.solvers.newton.options import NewtonOptions
from fcsim.solvers.newton.spaces import FollowingSpace
from fcsim.solvers.newton.systems.condensed import last_pattern
from fcsim.solvers.turns import to_the_end


def automatic_followed(problem: Followed, r: FloatArray, monitor: Monitor, options: AutomaticOptions) -> Iterate:
    """Newton from r (m,), see `FollowingSpace`. Where it is not the stage that begins, or has just failed on others (`Pause`), r without an
    iteration: W is that of all q, and what goes on is `automatic` on a problem that stays as it is."""
    if paused(monitor):
        return Iterate(r, Status.STAGNATED)
    local = problem.local
    if isinstance(local.W, DistributedDelassus):
        return _newton(problem, r, monitor, newton_over_ranks(options, warm=bool(np.any(r))))
    joints, fitting = local.delassus.joints_like(last_pattern(monitor.memory)), local.stored()
    race = Race(fitting, fitting, monitor, options, Prices.of(fitting, local.delassus, joints), bool(np.any(r)), joints, r)
    if "Newton" in options.without or not newton_first(race):
        return Iterate(r, Status.STAGNATED)
    return _newton(problem, r, monitor, newton_options(race))


def _newton(problem: Followed, r: FloatArray, monitor: Monitor, options: NewtonOptions) -> Iterate:
    iterate = to_the_end(local_turns(problem.local, r, monitor, options, space_of=partial(FollowingSpace, problem, monitor)))
    tried(monitor, iterate.status)
    return iterate
