"""Collapse by simulation: which multipliers a structure of rigid blocks bears, held for a while.

Each trial begins at rest with the load upon it, which rigid blocks feel at once, and is watched for `duration`. What moves is either going
to fall or slips until it locks, and the two are told apart: first motion, 1e-6 of the structure's extent, and runaway, 1e-3 of it and
still moving. An excess eps of the multiplier accelerates a mechanism by about g eps, so that small excesses need time.

Deformable blocks are loaded by their weight at once and by what grows over a trial's time, then held for as long, by implicit Euler, which
damps their oscillations: their elastic displacements hide the first slips, and they fall or stand: first motion is that of the fall.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray, is_number, is_whole
from fcsim.brief import shown
from fcsim.contact_detection import Everything
from fcsim.errors import InputError, NotConverged
from fcsim.masonry.limit_analysis.limit import associative_limit
from fcsim.masonry.limit_analysis.limit_problem import LimitProblem, limit_problem
from fcsim.masonry.problem import GRAVITY, MasonryProblem, PointForce, expect_problem
from fcsim.masonry.structure import BlocksAre, Stone, free_nodes, structure
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta

FIRST, RUNAWAY = 1e-6, 1e-3
"""Shares of the structure's extent that blocks move by."""
_STEPS, _RESTING = 120, 12
"""Steps of a trial; so many in a row without motion end it: rigid blocks that rest under a held load meet the same problem again."""
_SHORTEST, _LONGEST, _LARGE = 0.2, 5.0, 10.0
"""Bounds [s] of a trial's duration, the upper one of structures up to an extent [m]."""
_SLOW = 1e-3
"""Share of the speed of a runaway below which blocks rest: an excess of the load by the resolution gives them 200 times that by then."""
_SOFT_REST = 1e-2
"""The same of deformable blocks, whose vibrations die away slowly."""
_WIDER, _LEAST = 0.05, 0.3
"""Share by which a bracket is widened at first, twice as much each further time; below a share of where it began it goes down to zero."""
_NOTHING, _MOST = 1e-6, 1e3
"""Multipliers whose loads are this share of the blocks' weight count as none; that many times the weight is more than any fall needs."""
_TOLERANCE, FINEST = 1e-7, 1e-10
"""What stands moves by 1e-8 of its extent in all steps of a trial at this tolerance, a hundredth of first motion; at 1e-6 blocks creep into
motion below the load at which they must move. Errors are shares of all forces: where forces press on light blocks it is finer, see
`tolerance_of`; from 1e-11 on round-off is all that is seen."""
_CREEP = 0.1
"""Share of first motion that a solver's errors may move a block by in a trial."""
_AFLOAT, _MOVING_TOLERANCE = 10, 1e-6
"""Times first motion from which on a trial has left its rest, and the tolerance from there on: whether what moves falls or locks is read at
displacements a hundred times as large, and moving corners of blocks cost tens of seconds a step at the finer one."""


@dataclass(frozen=True)
class Trial:
    """What became of a multiplier: largest displacement [m] of a block's corner, its speed [m/s] in the end, after `t` [s].

    moves: it went beyond first motion; falls: beyond runaway, and moving still
    rough: steps from rest did not converge to the tolerance asked, so that errors of the solver may count as first motion
    """

    multiplier: float
    displacement: float
    speed: float
    t: float
    moves: bool
    falls: bool
    rough: bool = False


@dataclass(frozen=True)
class Bracket:
    """Multipliers between which a structure begins to move, and to fall: (the last that did not, the first that did); (0, 0): under
    the loads that stay."""

    motion: tuple[float, float]
    fall: tuple[float, float]
    trials: tuple[Trial, ...]


Watch = Callable[[Trial], None]


def trial(
    problem: MasonryProblem,
    multiplier: float,
    *,
    duration: float,
    steps: int = _STEPS,
    blocks: BlocksAre = "rigid",
    stone: Stone | None = None,
    tolerance: float | None = None,
) -> Trial:
    """Hold the load at `multiplier` for `duration` [s], or until the structure has run away, or rests; blocks, stone: see `structure`.

    tolerance of a step from rest: by default so fine that what stands does not creep into motion."""
    if not (is_number(multiplier) and is_number(duration) and duration > 0 and is_whole(steps, 1)):
        raise InputError(
            "trial: expected a finite multiplier, a duration > 0 in s and a whole number of steps >= 1, got "
            f"{shown(multiplier)}, {shown(duration)} and {shown(steps)}"
        )
    displacement = speed = t = 0.0
    fast, resting = RUNAWAY * problem.size / duration, 0
    soft, rough = blocks != "rigid", False
    if tolerance is None:
        tolerance = _TOLERANCE if soft else max(tolerance_of(problem, multiplier, duration), FINEST)
    for step, displacement, speed in _HeldLoad(problem, multiplier, duration, steps, blocks, stone).moves(tolerance):
        t = step.state.t
        rough |= displacement <= _AFLOAT * FIRST * problem.size and step.result.error > (1 + 1e-6) * tolerance
        if soft:
            rests = t > duration and speed < _SOFT_REST * fast
        else:
            rests = speed < _SLOW * fast and displacement < _SLOW * RUNAWAY * problem.size
        resting = resting + 1 if rests else 0
        if resting == _RESTING:
            break
        if displacement > 3 * RUNAWAY * problem.size and speed > fast:
            break
    falls = displacement > RUNAWAY * problem.size and speed > fast
    return Trial(multiplier, displacement, speed, t, falls if soft else displacement > FIRST * problem.size, falls, rough and not soft)


def fallen(
    problem: MasonryProblem,
    multiplier: float,
    *,
    share: float = 0.01,
    duration: float = 5.0,
    blocks: BlocksAre = "rigid",
    stone: Stone | None = None,
) -> Step:
    """Return the step at which a structure under a held load has moved by a share of its extent, or the last within `duration` [s]."""
    last = None
    for step, displacement, _ in _HeldLoad(problem, multiplier, duration, int(np.ceil(duration / 0.01)), blocks, stone).moves(_TOLERANCE):
        last = step
        if displacement > share * problem.size:
            break
    assert last is not None
    return last


@dataclass(frozen=True)
class _HeldLoad:
    """A structure under the load at `multiplier`, held for `duration` [s] in `steps`; on deformable blocks it grows to that in this time,
    and is held as long again."""

    problem: MasonryProblem
    multiplier: float
    duration: float
    steps: int
    blocks: BlocksAre
    stone: Stone | None

    def _at(self, t: float) -> float:
        """The multiplier at t [s]."""
        return self.multiplier if self.blocks == "rigid" else self.multiplier * min(t / self.duration, 1.0)

    def moves(self, tolerance: float) -> Iterator[tuple[Step, float, float]]:
        """Steps, the largest displacement [m] and speed [m/s] of a free block's node.

        A step that does not converge at `tolerance` goes on at coarser ones: of that trial first motion may be an error's."""
        problem, soft = self.problem, self.blocks != "rigid"
        model, _ = structure(problem, self.blocks, self.stone, multiplier=self._at)
        scheme = Theta(self.duration / self.steps, 1.0) if soft else Theta(self.duration / self.steps)
        count = 2 * self.steps if soft else self.steps
        detector = Everything(model, problem.friction)
        free = free_nodes(problem, model)
        tolerances = sorted({tolerance, max(_TOLERANCE, tolerance), max(_MOVING_TOLERANCE, tolerance)})
        done, begin = 0, None
        for tol in tolerances:
            if done == count:
                return
            try:
                for step in Simulation(model, detector, scheme, count - done, SolverSettings(tol=tol), initial=begin, created=np.inf):
                    done, begin = done + 1, step.state
                    moved = float(np.linalg.norm(model.node_displacement(step.state.x)[free], axis=1).max())
                    yield step, moved, float(np.linalg.norm(model.node_velocity(step.state.v, step.state.x)[free], axis=1).max())
                    if tol < tolerances[-1] and not soft and moved > _AFLOAT * FIRST * problem.size:
                        break
                else:
                    return
            except NotConverged:
                if tol == tolerances[-1]:
                    raise


def pressed(problem: MasonryProblem) -> float:
    """How large the point forces are, those that grow as the multiplier 1 has them, beside the weight of all free blocks."""
    return _point_forces(problem, 1.0) / (GRAVITY * float(_masses(problem).sum()))


def _masses(problem: MasonryProblem) -> FloatArray:
    """Of the free blocks [kg]."""
    free = [block for block in problem.blocks if not block.support]
    return np.array([block.mass or (block.density or 0.0) * block.surface.moments()[0] for block in free])


def _point_forces(problem: MasonryProblem, multiplier: float) -> float:
    """Sum of their amounts [N]."""
    forces = [load for load in problem.loads if isinstance(load, PointForce)]
    return float(sum(float(np.linalg.norm(load.value)) * (multiplier if load.scaled else 1.0) for load in forces))


def tolerance_of(problem: MasonryProblem, multiplier: float, duration: float) -> float:
    """The tolerance at which errors of the solver do not count as first motion within `duration` [s].

    An error eps of all forces F upon the lightest block, of mass m, moves it by eps F t^2 / 2 m; without point forces `_TOLERANCE`.
    Blocks that the forces act on are left out where there are others: plates, without weight maybe, that are held by what presses them.
    """
    forces, masses = _point_forces(problem, multiplier), _masses(problem)
    if forces == 0:
        return _TOLERANCE
    loaded = {load.block for load in problem.loads if isinstance(load, PointForce)}
    free = [block.name for block in problem.blocks if not block.support]
    alone = masses[[name not in loaded for name in free]]
    lightest = float((alone if len(alone) else masses).min())
    creep = 0.5 * (forces + GRAVITY * float(masses.sum())) * duration**2 / lightest  # [m] at an error of 1
    return min(_TOLERANCE, _CREEP * FIRST * problem.size / creep)


def bracket(
    problem: MasonryProblem,
    low: float,
    high: float,
    *,
    resolution: float = 0.005,
    watch: Watch = lambda trial: None,
    blocks: BlocksAre = "rigid",
    stone: Stone | None = None,
    tolerance: float | None = None,
) -> Bracket:
    """Return between which multipliers the structure begins to move and to fall, each to `resolution` of the multiplier, by bisection.

    low, high: where to begin, as limit analysis says; widened as long as low moves or high does not fall; blocks, stone: see `structure`;
    tolerance [m]: at which limit analysis takes blocks to touch, see `limit_problem`; trials have their gaps.
    InputError where the problem has no load that grows; NotConverged where nothing makes it fall.
    """
    expect_problem(problem, "bracket")
    if not problem.scaled:
        raise InputError(f"{problem.name!r}: expected a load that the multiplier scales, got none")
    if not (is_number(resolution) and 0 < resolution < 1):
        raise InputError(f"resolution: expected a share of the multiplier between 0 and 1, got {shown(resolution)}")
    for name, value in (("low", low), ("high", high)):
        if not is_number(value):
            raise InputError(f"{name}: expected a multiplier to begin with, a finite number, got {shown(value)}")
    known: dict[float, Trial] = {}
    limit = limit_problem(problem, tolerance=tolerance)
    pull, upper = _acceleration(problem, limit), associative_limit(limit)

    def at(multiplier: float) -> Trial:
        if multiplier not in known:
            # an excess of the resolution, at a tenth of the acceleration that it would give all blocks, runs away in that time
            duration = _running_away(problem.size, 0.1 * resolution * multiplier * pull)
            # above the associative limit no state of rest exists that errors of the solver might spoil
            sure = blocks == "rigid" and upper.outcome == "limit" and multiplier > (1 + _MOVING_TOLERANCE) * upper.multiplier
            step_tolerance = _MOVING_TOLERANCE if sure else None
            known[multiplier] = trial(problem, multiplier, duration=duration, blocks=blocks, stone=stone, tolerance=step_tolerance)
            watch(known[multiplier])
        return known[multiplier]

    nothing = _NOTHING * GRAVITY / pull
    low, high = max(low, 0.0), max(high, low, nothing)
    most, begin, wider = max(high, GRAVITY / pull) * _MOST, low, _WIDER
    while low > 0 and at(low).moves:
        high, low, wider = (low if at(low).falls else high), low * (1 - min(wider, 0.5)), 2 * wider
        low = low if low > _LEAST * begin else 0.0
    wider = _WIDER
    while not at(high).falls:
        if high > most:
            raise NotConverged(f"{problem.name!r}: expected a structure that falls, got one that stands at the multiplier {high:.4g} still")
        high, wider = high * (1 + wider), 2 * wider
    stands = max((seen.multiplier for seen in known.values() if not seen.falls and seen.multiplier < high), default=low)
    fall = (0.0, 0.0) if low == 0 and at(0.0).falls else _bisected(stands, high, resolution, nothing, lambda value: at(value).falls)
    if low == 0 and at(0.0).moves:
        return Bracket((0.0, 0.0), fall, _sorted(known))
    begun = [multiplier for multiplier, seen in known.items() if seen.moves]
    still = [multiplier for multiplier, seen in known.items() if not seen.moves and multiplier < min(begun)]
    motion = _bisected(max(still, default=0.0), min(begun), resolution, nothing, lambda multiplier: at(multiplier).moves)
    return Bracket(motion, fall, _sorted(known))


def _running_away(extent: float, acceleration: float) -> float:
    """[s] in which a structure of that extent [m] runs away at an acceleration [m/s^2], within bounds."""
    longest = _LONGEST * np.sqrt(max(extent / _LARGE, 1.0))  # what is four times as large falls in twice the time
    return float(np.clip(np.sqrt(2 * RUNAWAY * extent / max(acceleration, 1e-300)), _SHORTEST, longest))


def _sorted(known: Mapping[float, Trial]) -> tuple[Trial, ...]:
    return tuple(sorted(known.values(), key=lambda seen: seen.multiplier))


def _acceleration(problem: MasonryProblem, limit: LimitProblem) -> float:
    """What the loads that grow give all free blocks together at the multiplier 1 [m/s^2], without regard to signs: by their forces, or
    by their moments, as forces with the block's extent as the arm, where these are more.

    InputError where none of them acts on a free block.
    """
    model, free = limit.model, np.array([not block.support for block in problem.blocks])
    mass = sum(body.mass for body, block in zip(model.rigid, problem.blocks, strict=True) if not block.support)
    rows, d = np.abs(model.rigid_part(limit.live))[free], model.dimension
    extents = np.array([np.ptp(block.surface.points, axis=0).max() for block in problem.blocks])[free]
    pull = max(float(rows[:, :d].sum()), float((rows[:, d:] / extents[:, None]).sum())) / mass
    if pull == 0:
        raise InputError(f"{problem.name!r}: expected a load that grows on a free block, got loads on supports or of no size alone")
    return pull


def _bisected(low: float, high: float, resolution: float, nothing: float, happens: Callable[[float], bool]) -> tuple[float, float]:
    while high - low > max(resolution * high, nothing):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if happens(middle) else (middle, high)
    return low, high
