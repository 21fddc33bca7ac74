"""Collapse by simulation: which multipliers a structure of rigid blocks bears, held for a while.

Each trial begins at rest with the load upon it, which rigid blocks feel at once, and is watched for `duration`. What moves is either going
to fall or slips until it locks, and the two are told apart: first motion, 1e-6 of the structure's extent, and runaway, 1e-3 of it and
still moving. An excess eps of the multiplier accelerates a mechanism by about g eps, so that small excesses need time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from fcsim.contact_detection import Everything
from fcsim.errors import InputError
from fcsim.masonry.limit_analysis.limit_problem import limit_problem
from fcsim.masonry.problem import MasonryProblem
from fcsim.masonry.structure import structure
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta

FIRST, RUNAWAY = 1e-6, 1e-3
"""Shares of the structure's extent that blocks move by."""
_STEPS, _RESTING = 120, 12
"""Steps of a trial; so many in a row without motion end it: rigid blocks that rest under a held load meet the same problem again."""
_SLOW = 1e-3
"""Share of the speed of a runaway below which blocks rest: an excess of the load by the resolution gives them 200 times that by then."""
_SOLVER = SolverSettings(tol=1e-7)
"""What stands moves by 1e-8 of its extent in all steps of a trial at this tolerance, a hundredth of first motion; at 1e-6 blocks creep into
motion below the load at which they must move."""


@dataclass(frozen=True)
class Trial:
    """What became of a multiplier: largest displacement [m] of a block's corner, its speed [m/s] in the end, after `t` [s].

    moves: it went beyond first motion; falls: beyond runaway, and moving still
    """

    multiplier: float
    displacement: float
    speed: float
    t: float
    moves: bool
    falls: bool


@dataclass(frozen=True)
class Bracket:
    """Multipliers between which a structure begins to move, and to fall: (the last that did not, the first that did)."""

    motion: tuple[float, float]
    fall: tuple[float, float]
    trials: tuple[Trial, ...]


Watch = Callable[[Trial], None]


def trial(problem: MasonryProblem, multiplier: float, *, duration: float, steps: int = _STEPS) -> Trial:
    """Hold the load at `multiplier` for `duration` [s], or until the structure has run away, or rests."""
    displacement = speed = t = 0.0
    fast, resting = RUNAWAY * problem.size / duration, 0
    for step, displacement, speed in _held(problem, multiplier, duration, steps):
        t = step.state.t
        resting = resting + 1 if speed < _SLOW * fast and displacement < _SLOW * RUNAWAY * problem.size else 0
        if resting == _RESTING:
            break
        if displacement > 3 * RUNAWAY * problem.size and speed > fast:
            break
    falls = displacement > RUNAWAY * problem.size and speed > fast
    return Trial(multiplier, displacement, speed, t, displacement > FIRST * problem.size, falls)


def fallen(problem: MasonryProblem, multiplier: float, *, share: float = 0.01, duration: float = 5.0) -> Step:
    """Return the step at which a structure under a held load has moved by a share of its extent, or the last within `duration` [s]."""
    last = None
    for step, displacement, _ in _held(problem, multiplier, duration, int(np.ceil(duration / 0.01))):
        last = step
        if displacement > share * problem.size:
            break
    assert last is not None
    return last


def _held(problem: MasonryProblem, multiplier: float, duration: float, steps: int) -> Iterator[tuple[Step, float, float]]:
    """Steps under a held load, the largest displacement [m] and speed [m/s] of a free block's corner."""
    model, _ = structure(problem, multiplier=lambda t: multiplier)
    simulation = Simulation(model, Everything(model, problem.friction), Theta(duration / steps), steps, _SOLVER, created=np.inf)
    free = np.repeat([not block.support for block in problem.blocks], np.diff(model.node_offset))
    for step in simulation:
        moved = np.linalg.norm(model.node_displacement(step.state.x)[free], axis=1)
        speeds = np.linalg.norm(model.node_velocity(step.state.v, step.state.x)[free], axis=1)
        yield step, float(moved.max()), float(speeds.max())


def bracket(problem: MasonryProblem, low: float, high: float, *, resolution: float = 0.005, watch: Watch = lambda trial: None) -> Bracket:
    """Return between which multipliers the structure begins to move and to fall, each to `resolution` of the multiplier, by bisection.

    low, high: where to begin, as limit analysis says; widened as long as low moves or high does not fall. InputError where the problem has
    no load that grows.
    """
    if not problem.scaled:
        raise InputError(f"{problem.name!r}: expected a load that the multiplier scales, got none")
    if not 0 < resolution < 1:
        raise InputError(f"resolution: expected a share of the multiplier between 0 and 1, got {resolution}")
    known: dict[float, Trial] = {}
    pull = _acceleration(problem)

    def at(multiplier: float) -> Trial:
        if multiplier not in known:
            # an excess of the resolution, at a tenth of the acceleration that it would give all blocks, runs away in that time
            excess = 0.1 * resolution * multiplier * pull
            duration = float(np.clip(np.sqrt(2 * RUNAWAY * problem.size / max(excess, 1e-300)), 0.2, 5.0))
            known[multiplier] = trial(problem, multiplier, duration=duration)
            watch(known[multiplier])
        return known[multiplier]

    low, high = max(low, 0.0), max(high, low, 1e-6)
    while low > 0 and at(low).moves:
        high, low = (low if at(low).falls else high), (low * 0.95 if low > 1e-4 else 0.0)
    while not at(high).falls and high < 1e3:
        high *= 1.05
    fall = _bisected(low, high, resolution, lambda multiplier: at(multiplier).falls)
    begun = [multiplier for multiplier, seen in known.items() if seen.moves]
    still = [multiplier for multiplier, seen in known.items() if not seen.moves and multiplier < min(begun)]
    motion = _bisected(max(still, default=0.0), min(begun), resolution, lambda multiplier: at(multiplier).moves)
    return Bracket(motion, fall, tuple(sorted(known.values(), key=lambda seen: seen.multiplier)))


def _acceleration(problem: MasonryProblem) -> float:
    """What the loads that grow give all free blocks together at the multiplier 1 [m/s^2], without regard to signs."""
    limit = limit_problem(problem)
    model = limit.model
    mass = sum(body.mass for body, block in zip(model.rigid, problem.blocks, strict=True) if not block.support)
    return float(np.abs(model.rigid_part(limit.live)[:, : model.dimension]).sum() / mass)


def _bisected(low: float, high: float, resolution: float, happens: Callable[[float], bool]) -> tuple[float, float]:
    while high - low > resolution * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if happens(middle) else (middle, high)
    return low, high
