"""`auto` from a start near the answer between rigid blocks: proximal Newton alone, before anything is set up for others."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.problem import LocalProblem
from fcsim.solvers.automatic.costs import Prices
from fcsim.solvers.automatic.expected import at_first
from fcsim.solvers.automatic.first import proximal_first
from fcsim.solvers.automatic.race import Race, RaceOptions, Runner, Stage, run
from fcsim.solvers.base import Iterate, Monitor, Status
from fcsim.solvers.newton.systems.choice import eliminated_in_velocities


def proximal_alone(
    problem: LocalProblem, r: FloatArray, monitor: Monitor, options: RaceOptions, proximal: Stage
) -> tuple[Iterate | None, dict[str, Runner]]:
    """The answer of proximal Newton's own iterations from r (m,) where it is the first stage from a warm start in edges or faces, else None
    and the runners with which the race goes on. Neither joints are looked for in W nor is it stored anew, since bodies' velocities are
    eliminated: on steps of one to three milliseconds that is as much as the iterations that they take."""
    if not np.any(r) or not eliminated_in_velocities(problem.delassus):
        return None, {}
    race = Race(problem, problem, monitor, options, Prices.of(problem, problem.delassus, None), True, None, r)
    if not proximal_first(race):
        return None, {}
    if monitor.record(r, problem.delassus.affine(r, problem.q)) <= monitor.tol:
        return Iterate(r, Status.SOLVED), {}
    iterate = run(race, [proximal], _past_its_own)
    if iterate.status in (Status.SOLVED, Status.TIME_LIMIT, Status.MAX_ITERATIONS):
        race.runners.clear()  # see `stages.automatic`
        return iterate, {}
    return None, race.runners


def _past_its_own(race: Race) -> bool:
    return any(not at_first(runner) for runner in race.runners.values())
