"""`auto` from a start near the answer between rigid blocks, and after its front door: the first method alone, before others are set up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.problem import LocalProblem
from fcsim.solvers.automatic.closed import on_springs, swept_at_the_door
from fcsim.solvers.automatic.costs import Prices
from fcsim.solvers.automatic.expected import at_first
from fcsim.solvers.automatic.first import newton_first, proximal_first
from fcsim.solvers.automatic.later import interior_opens
from fcsim.solvers.automatic.race import Race, RaceOptions, Runner, Stage, run
from fcsim.solvers.base import Iterate, Monitor, Status
from fcsim.solvers.newton.systems.choice import eliminated_in_velocities

NEWTON, PROXIMAL, INTERIOR = "Newton", "proximal Newton", "interior point"
FAR_TOO_LARGE = 0.3
"""The multiple of a start that fits best below which that multiple is the start: its impulses are far too large, as those of an impact in
the step before. Steps to 1e-8 from such starts: boxes that land 95 ms for 175, a facade 163 for 157; where the best multiple is 0.3 to 0.6
115 for 99, where it is more than 1.5 (a wall that is hit, the facade) 1474 for 976."""


def first_alone(
    problem: LocalProblem, r: FloatArray, monitor: Monitor, options: RaceOptions, stages: Sequence[Stage]
) -> tuple[Iterate | None, dict[str, Runner]]:
    """The answer from r (m,) of Newton where joints have stiffness, or of proximal Newton's own iterations where that is the first stage
    from a warm start in edges or faces, or, after the compiled front door, of these in blocks and of an interior point's first
    path in a small bed; else None and the runners with which the race goes on. Neither joints are looked for in W, nor its entries counted,
    nor, where bodies' velocities are eliminated, is it stored anew, nor are other stages asked: on problems of one to ten milliseconds that
    is as much as the iterations that they take."""
    warm, in_velocities = bool(np.any(r)), eliminated_in_velocities(problem.delassus)
    if not (in_velocities if warm else monitor.passed):
        return None, {}
    fitting = problem if in_velocities else problem.stored()
    race = Race(fitting, fitting, monitor, options, Prices.of(fitting, problem.delassus, None), warm, None, r)
    name = _first(race)
    if name is None:
        return None, {}
    if warm:
        pushed = problem.delassus @ r
        share = _fitting(problem, r, pushed) if name == PROXIMAL else 1.0
        r = r if share == 1.0 else share * r
        if monitor.record(r, share * pushed + problem.q) <= monitor.tol:
            return Iterate(r, Status.SOLVED), {}
    race.start = r
    stage = next(stage for stage in stages if stage.name == name)
    # who works alone may count iterations as one each
    iterate = run(race, [replace(stage, price=lambda race: 1.0)], _past_its_own)
    if iterate.status in (Status.SOLVED, Status.TIME_LIMIT, Status.MAX_ITERATIONS):
        race.runners.clear()  # see `stages.automatic`
        return iterate, {}
    for runner in race.runners.values():
        runner.counted_at(stage, race)
    return None, race.runners


def _fitting(problem: LocalProblem, r: FloatArray, pushed: FloatArray) -> float:
    """The multiple t of a start r (m,) that begins: where r is far too large that of the least t^2/2 r . W r + t r . q, else 1; pushed:
    W r. In steps after an impact what was hit still tells which contacts hold, at a tenth of the last impulses."""
    energy = float(r @ pushed)
    best = -float(r @ problem.q) / energy if energy > 0 else 1.0
    return best if 0 < best < FAR_TOO_LARGE else 1.0


def _first(race: Race) -> str | None:
    """The stage that goes first whatever joints there may be in W."""
    if on_springs(race) and newton_first(race) and NEWTON not in race.options.without:
        return NEWTON
    if swept_at_the_door(race) and interior_opens(race):
        return INTERIOR
    return PROXIMAL if proximal_first(race) else None


def _past_its_own(race: Race) -> bool:
    """Whether others are to be asked now."""
    if INTERIOR in race.runners:
        return not interior_opens(race)
    return PROXIMAL in race.runners and not at_first(race.runners[PROXIMAL])
