"""The push of a structure by displacement: how the load that it bears grows and falls away.

The blocks upon which loads grow are moved at a pace, the mean of their displacements along the load weighted by the loads; the multiplier
is what that takes (`fcsim.Control`). Statics step by step: between the maximum and the multiplier zero, beyond which the structure falls
by itself, the curve is its descending branch, of one block about its toe tan(alpha - theta) with the angle theta by which it has turned.
Floating blocks are regularised by a mass whose forces are 1e-5 of their weight; the work that they take is not counted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray, is_number
from fcsim.brief import shown
from fcsim.contact_detection import Everything
from fcsim.errors import InputError, NotConverged
from fcsim.linkage import Control, Linkage
from fcsim.masonry.bodies import rigid_blocks, vector_of
from fcsim.masonry.limit_analysis.limit import associative_limit
from fcsim.masonry.limit_analysis.limit_problem import limit_problem
from fcsim.masonry.problem import GRAVITY, MasonryProblem, PointForce, expect_problem
from fcsim.masonry.structure import structure
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step

_SHARE = 1e-5  # of the weight: the regularising force of a block that moves with the load
_NOTHING = 1e-4  # of the largest multiplier: what is less holds nothing
_DROP, _SMALLEST = 0.02, 1e-3  # of it: what drops more in a step is looked at by shorter ones, down to a share of the step
_SAME = 0.1
"""Of the drop: what half a step changes of it by less has dropped on the way to where the step begins, and shorter ones show no more."""
_TURN = 0.02
"""[rad] A block turns by no more in a step: a corner leaves its place by half the square, since statics move it as the step begins."""
NAME = "push"


@dataclass(frozen=True)
class Branch:
    """displacement (n,) [m], the mean along the load, and multiplier (n,); first the multiplier that sets the structure in motion.

    held: whether there was a state of rest at every displacement; False where the structure ran away from the last one though the push was
    held: a further joint opens, or a block comes off
    """

    displacement: FloatArray
    multiplier: FloatArray
    held: bool = True

    @property
    def largest(self) -> float:
        """The largest multiplier that was borne."""
        return float(self.multiplier.max())

    @property
    def end(self) -> float | None:
        """Displacement [m] at which nothing holds the structure back any more, the multiplier 0; None where the curve ends before it."""
        after = np.flatnonzero((self.multiplier[1:] <= _NOTHING * self.largest) & (self.multiplier[:-1] > 0))
        if not len(after):
            return None
        k = int(after[0])
        (d0, d1), (m0, m1) = self.displacement[k : k + 2], self.multiplier[k : k + 2]
        return float(d0 + (d1 - d0) * m0 / (m0 - m1))


def push_by_displacement(
    problem: MasonryProblem,
    *,
    step: float | None = None,
    to: float | None = None,
    watch: Callable[[float, float], None] | None = None,
    tell: Callable[[str], None] | None = None,
) -> Branch:
    """Return the curve of multiplier by displacement until the multiplier is zero, it runs away, or the displacement is `to` [m].

    step [m]: of the displacement, by default 2.5e-4 of the structure's extent; shorter where the multiplier drops or a block turns by
    more than a degree. to: by default half its extent. watch(displacement, multiplier): called after each step; tell(text): with what is
    begun, and with steps taken again in parts. InputError where loads that grow have several directions, move nothing, or find a
    structure that falls already.
    """
    steps = []
    for _, displacement, multiplier in branch_steps(problem, step=step, to=to, tell=tell):
        steps.append((displacement, multiplier))
        if watch is not None and np.isfinite(multiplier):
            watch(displacement, multiplier)
    ran_away = len(steps) > 1 and steps[-1][1] < _as_before(steps[:-1], steps[-1][0]) - _DROP * max(multiplier for _, multiplier in steps)
    curve = np.array(steps[:-1] if ran_away else steps)
    return Branch(curve[:, 0], curve[:, 1], not ran_away)


def _as_before(steps: list[tuple[float, float]], displacement: float) -> float:
    """The multiplier at a displacement [m] behind the last of `steps` as it has fallen so far; 0 where it would not be below."""
    if len(steps) < 2:
        return 0.0
    (before, more), (last, less) = steps[-2:]
    return min(0.0, less - max(more - less, 0.0) * (displacement - last) / (last - before))


def default_step(problem: MasonryProblem) -> float:
    """Displacement [m] of a step of `push_by_displacement` where none is asked for."""
    return 2.5e-4 * problem.size


def default_end(problem: MasonryProblem) -> float:
    """Displacement [m] at which `push_by_displacement` ends where none is asked for."""
    return 0.5 * problem.size


def branch_steps(
    problem: MasonryProblem, *, step: float | None = None, to: float | None = None, tell: Callable[[str], None] | None = None
) -> Iterator[tuple[Step, float, float]]:
    """Yield the steps of `push_by_displacement`, each with its displacement [m] and multiplier.

    The last multiplier may be below zero. It is -inf where the structure ran away: in that step, however short, it moves as far as the
    regularising mass lets it. What contacts bear goes on smoothly there, but the mechanism is another one, that of a joint which has
    just opened, or of a block that came off, and the push by which it was held does not hold that.
    """
    expect_problem(problem, "push by displacement")
    step = default_step(problem) if step is None else step
    to = default_end(problem) if to is None else to
    if not (is_number(step) and is_number(to) and 0 < step <= to):
        raise InputError(f"step, to: expected displacements in m with 0 < step <= to, got {shown(step)} and {shown(to)}")
    tell = tell or (lambda text: None)
    control, load = _control(problem)
    tell(f"limit analysis of {len(problem.blocks)} blocks: whether the loads that grow set them in motion")
    stands = associative_limit(limit_problem(problem)).outcome
    if stands in ("unbounded", "falls"):
        got = "one that bears every multiplier" if stands == "unbounded" else "one that falls under the loads that stay"
        raise InputError(f"{problem.name!r}: expected a structure that its growing loads set in motion, got {got}")
    model, _ = structure(problem)
    linkage, detector = Linkage(model, [control]), Everything(model, problem.friction)
    tell("at rest: the multiplier that sets them in motion")
    along, largest, before = np.array(control.direction), 0.0, None
    moment, h, near, seen = None, step, 1e-9 * step, np.inf
    while moment is None or moment.state.t <= to + near:  # the step that begins at `to` has the forces of `to`
        left = to if moment is None else to - moment.state.t
        h = min(h, left) if left > near else h
        # the control's pace is 1: times are displacements; eta h/h^2 = _SHARE g
        scheme, number = QuasiStatic(h, _SHARE * GRAVITY * h), 0 if moment is None else moment.number
        simulation = Simulation(model, detector, scheme, number + 1, SolverSettings(name="auto"), linkage=linkage, created=np.inf)
        try:
            taken = next(iter(simulation.run(moment)))
        except NotConverged:
            if h <= _SMALLEST * step:
                raise
            h *= 0.5
            tell(f"{1e3 * (0.0 if moment is None else moment.state.t):.6g} mm: no answer in {2e3 * h:.4g} mm: again in half of that")
            continue
        lost = _regularisation(taken) / h / load
        multiplier = float(taken.link_force(NAME) @ along) / load - lost
        drop = 0.0 if before is None else before - multiplier
        if drop > _DROP * largest and abs(multiplier - seen) > _SAME * drop and h > _SMALLEST * step:
            h, seen = 0.5 * h, multiplier
            at = f"{1e3 * taken.previous.t:.6g} mm, multiplier {multiplier + drop:.4g}"
            tell(f"{at}: it drops to {multiplier:.4g} in {2e3 * h:.4g} mm: again in half of that, {len(taken.contacts)} contacts")
            continue
        if h > _SMALLEST * step and (turn := _turn(taken)) > _TURN:
            h *= 0.5
            tell(f"{1e3 * taken.previous.t:.6g} mm: a block turns by {turn:.2g} rad in {2e3 * h:.4g} mm: again in half of that")
            continue
        if before is not None and lost > _DROP * largest:
            yield taken, taken.previous.t, -np.inf
            return
        largest, before, seen = max(largest, multiplier), multiplier, np.inf
        yield taken, taken.previous.t, multiplier  # the forces are those of where the step begins
        if multiplier < _NOTHING * largest:
            return
        moment, h = taken.moment, min(2 * h, step)


def _turn(step: Step) -> float:
    """[rad] The largest turn of a body in a step."""
    rates = step.model.rigid_part(step.state.v)[:, step.model.dimension :]
    return step.scheme.h * float(np.linalg.norm(rates, axis=1).max(initial=0.0))


def _regularisation(step: Step) -> float:
    """Work [J] against the regularising mass in a step."""
    scheme, model = step.scheme, step.model
    assert isinstance(scheme, QuasiStatic)
    dx = scheme.h * step.state.v
    return scheme.eta / scheme.h**2 * float(dx @ model.apply_mass(dx, model.rigid_mass(step.previous.x)))


def _control(problem: MasonryProblem) -> tuple[Control, float]:
    """The control of the loads that grow, and their sum [N]."""
    places: list[tuple[str, FloatArray, FloatArray]] = []
    growing = problem.acceleration(scaled=True)
    centres = {}
    for block, body in zip(problem.blocks, rigid_blocks(problem), strict=True):
        centres[block.name] = body.centre
        if growing.any() and not block.support:
            places.append((block.name, body.centre, body.mass * np.array(vector_of(problem, growing))))
    for load in problem.loads:
        if isinstance(load, PointForce) and load.scaled:
            point = centres[load.block] if load.point is None else np.array(vector_of(problem, load.point))
            places.append((load.block, point, np.array(vector_of(problem, load.value))))
    if not places:
        raise InputError(f"{problem.name!r}: expected a load that the multiplier scales, got none")
    total = np.sum([force for *_, force in places], axis=0)
    size = float(np.linalg.norm(total))
    along = total / (size or 1.0)
    weights = [float(force @ along) for *_, force in places]
    off = max(float(np.linalg.norm(force - weight * along)) for (*_, force), weight in zip(places, weights, strict=True))
    if not size or min(weights) <= 0 or off > 1e-9 * size:
        raise InputError(f"{problem.name!r}: expected loads that grow in one direction to push by displacement, got several directions")
    points = tuple((name, tuple(place.tolist()), weight) for (name, place, _), weight in zip(places, weights, strict=True))
    return Control(NAME, points, tuple(along.tolist()), 1.0), size
