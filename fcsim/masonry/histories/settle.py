"""Supports that give way: what a structure's supports bear and how its joints open while one of them moves or turns.

Statics step by step: the support is moved along its path, the blocks follow in equilibrium. A dry structure has many states of
equilibrium at first; which one is there before the support moves is not known (the first row is one of them). A movement that parts the
blocks chooses: the thrust of an arch whose supports spread falls to its least admissible value at once, and stays near it while the arch
turns about its hinges (J. Heyman, "The stone skeleton", Int. J. Solids Struct. 2, 1966).

Floating blocks are regularised by their mass, by 1e-6 of their weight at the support's own pace; where a block moves far more than its
support the structure falls, and the table ends there.

Deformable blocks take their weight first, and the way begins from there. Their equilibrium is that of small rotations: forces are those of
the structure as it was built, and the way ends where a block has turned by a degree. What a structure bears by its shape until it falls is
for rigid blocks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from fcsim.arrays import BoolArray, FloatArray, is_vector
from fcsim.assembly.kinematics.deformation import DeformationMeasure
from fcsim.assembly.model import Model
from fcsim.assembly.supports.support import Support
from fcsim.brief import shown
from fcsim.contact_detection import Contacts, Everything
from fcsim.errors import InputError, NotConverged
from fcsim.masonry.bodies import HELD, supports, vector_of
from fcsim.masonry.collapse import RUNAWAY
from fcsim.masonry.limit_analysis.limit import associative_limit
from fcsim.masonry.limit_analysis.limit_problem import limit_problem
from fcsim.masonry.openings import OPEN, Opening, openings
from fcsim.masonry.problem import GRAVITY, MasonryProblem, expect_problem
from fcsim.masonry.structure import BlocksAre, Stone, free_nodes, structure, touching
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State
from fcsim.timestep.step import Step

_SHARE = 1e-6  # of the weight: the regularising force of a block that moves as its support does
_RUNS = 1e3  # times its support's pace: a block that moves so fast falls, by a thousandth of its weight out of balance
_QUICK = 1.5  # times it: a block that moves so fast may fall from one joint into another, and is looked at with its supports at rest
_STILL = 0.1  # of a step of its support: by how much a thousandth of its weight out of balance moves a block that is looked at so
_NEARLY = 10.0  # times that: what moves so far is followed to where it comes to rest, what moves farther falls
_SOFT_RUNAWAY = 0.1  # of it: farther than deformable blocks sink under their weight
STEPS = 100
ROTATION = 1.0
"""Degrees that deformable blocks may turn by: forces are wrong by what structures have changed their shape by, about its sine."""


@dataclass(frozen=True)
class Movement:
    """How a support moves in the end: displacement (3,) [m]; turn (3,), a rotation vector [rad], about a point (3,) [m] (None: its
    centroid)."""

    support: str
    displacement: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    about: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.support, str):
            raise InputError(f"Movement: expected the name of a support, got {shown(self.support)}")
        for name in ("displacement", "turn", "about"):
            value = getattr(self, name)
            if not (is_vector(value, 3) or (name == "about" and value is None)):
                raise InputError(f"movement of {self.support!r}, {name}: expected three finite numbers, got {shown(value)}")


@dataclass(frozen=True, eq=False)
class Settlement:
    """What a movement of supports makes of a structure; row 0 is before it.

    moved (n,) [m]: the largest displacement of a support's corner; forces: by support (n, d) [N], by which it holds the structure, in the
    shape that it has where the step begins, a row before;
    opening, slip (n,) [m]: the widest joint, the largest slip; open_joints (n,): how many joints have opened
    falls: the structure ran away after the last row, whose shape is the last that stands under its loads; turned: the way ends there
    because a deformable block has turned by more than
    `ROTATION`; joints: their openings in it; x: the configuration of `model` there
    """

    moved: FloatArray
    forces: Mapping[str, FloatArray]
    opening: FloatArray
    slip: FloatArray
    open_joints: FloatArray
    falls: bool
    turned: bool
    joints: tuple[Opening, ...]
    model: Model
    x: FloatArray

    def thrust(self, support: str) -> FloatArray:
        """Horizontal part (n,) [N] of a support's force."""
        size: FloatArray = np.linalg.norm(self.forces[support][:, :-1], axis=1)
        return size


def movements_of(problem: MasonryProblem) -> tuple[Movement, ...]:
    """The movements that a problem says itself: the velocities of its supports [m/s], held for 1 s."""
    return tuple(Movement(name, velocity) for name, velocity in problem.motion.items())


def settle(
    problem: MasonryProblem,
    movements: Sequence[Movement],
    *,
    steps: int = STEPS,
    blocks: BlocksAre = "rigid",
    stone: Stone | None = None,
    watch: Callable[[Step], None] = lambda step: None,
) -> Settlement:
    """Return the way of a structure under the loads that stay, its supports moving in proportion to their ends, in equal steps.

    blocks, stone: see `structure`; watch(step): called after each step.
    InputError where nothing moves, a name is no support's, blocks fall before anything moves; NotConverged of a step without an answer.
    """
    _checked(problem, movements, steps)
    limit = limit_problem(replace(problem, motion={}))
    if associative_limit(replace(limit, live=np.zeros_like(limit.live))).outcome == "falls":
        raise InputError(f"{problem.name!r}: expected a structure that stands before its supports move, got one that falls")
    reach = _reach(problem, movements)
    scheme = QuasiStatic(1.0 / steps, _SHARE * GRAVITY / (steps**2 * reach / steps))
    still, _ = structure(replace(problem, motion={}), blocks, stone)
    contacts = touching(problem, still)
    first = next(iter(Simulation(still, Everything(still, problem.friction), scheme, 1, _SOLVER, created=np.inf)))
    _refuse_fall(problem, first, max(_RUNS * reach / steps, (RUNAWAY if blocks == "rigid" else _SOFT_RUNAWAY) * problem.size))
    watch(first)
    rows, last, end = [_Row.of(0.0, first, contacts, problem)], first, ""
    moving, _ = structure(problem, blocks, stone, held=_driven(problem, movements))

    def stands(x: FloatArray) -> bool:
        return _stands(still, problem, scheme, x, reach / steps)

    ends = _Ends(moving, free_nodes(problem, moving), DeformationMeasure(moving.groups, len(moving.deformable)), reach / steps, stands)
    for step in _moving(problem, moving, scheme, steps, first.state.x if moving.deformable else None, stands):
        end = ends.after(step, last)
        if end != "":
            break
        watch(step)
        last = step
        rows.append(_Row.of(reach * step.number / steps, step, contacts, problem))
    x = last.state.x
    turned = end == "turned"
    standing = turned or stands(x)
    falls = end == "falls" or not standing
    if not standing and len(rows) > 1:
        rows, x = rows[:-1], last.previous.x  # it ran away from a shape that no force holds: the step to it had those of the one before
    names = list(rows[0].forces)
    moved, opening, slip, count = np.array([(row.moved, row.opening, row.slip, row.open_joints) for row in rows]).T
    forces = {name: np.array([row.forces[name] for row in rows]) for name in names}
    joints = openings(contacts, last.model, x)
    return Settlement(moved, forces, opening, slip, count, falls, turned, joints, last.model, x)


_SOLVER = SolverSettings(name="auto")


@dataclass(frozen=True)
class _Ends:
    """How the way of `model` ends before its supports have arrived; free (n_nodes,): the nodes of its free blocks; pace [m]: by how
    much a support moves in a step; stands(x): whether the structure stands in a configuration."""

    model: Model
    free: BoolArray
    measure: DeformationMeasure
    pace: float
    stands: Callable[[FloatArray], bool]

    def after(self, step: Step, before: Step) -> Literal["", "falls", "turned"]:
        """Whether blocks fall in this step, or a deformable one has turned too far; "": it goes on."""
        model = self.model
        way = model.node_displacement(step.state.x) - model.node_displacement(step.previous.x)
        moved = float(np.linalg.norm(way, axis=1)[self.free].max())
        if moved > _RUNS * self.pace or (moved > _QUICK * self.pace and not self.stands(before.state.x)):
            return "falls"
        rotation = self.measure(step.state.x).rotation
        return "turned" if np.degrees(rotation.max(initial=0.0)) > ROTATION else ""


def _stands(still: Model, problem: MasonryProblem, scheme: QuasiStatic, x: FloatArray, pace: float) -> bool:
    """Whether the structure stands in the configuration x (n_dofs,), its supports, which moved by `pace` [m] a step, at rest.

    A step of so large an eta that falling is slow first closes the joints that the last step's turning left open, by its square. In the
    next one a block out of balance by a thousandth of its weight moves by `_STILL`. Forces are known to the solver's tolerance alone, so
    what moves a little more stands where it comes to rest, and falls where it runs away as on the way.
    """

    def rested(x: FloatArray, eta: float) -> tuple[FloatArray, float]:
        """x and the farthest way [m] of a free node after a step by so many times the scheme's eta."""
        initial, slow = State(0.0, x, np.zeros(still.n_dofs)), replace(scheme, eta=eta * scheme.eta)
        step = next(iter(Simulation(still, Everything(still, problem.friction), slow, 1, _SOLVER, initial=initial, created=np.inf)))
        way = still.node_displacement(step.state.x) - still.node_displacement(x)
        return step.state.x, float(np.linalg.norm(way, axis=1)[free_nodes(problem, still)].max())

    try:
        closed, _ = rested(x, _RUNS * _RUNS / _STILL)
        moved, way = rested(closed, _RUNS / _STILL)
        if _STILL * pace < way <= _NEARLY * _STILL * pace:
            return rested(moved, 1.0)[1] <= _RUNS * pace
    except (NotConverged, InputError):  # of a shape that has fallen so far that bodies lie in each other
        return False
    return way <= _STILL * pace


def _refuse_fall(problem: MasonryProblem, first: Step, far: float) -> None:
    """InputError where the step before anything moves takes a block farther than `far` [m]: falling along its joints without a force is
    an answer of Coulomb's law, too, where only a wedging that nothing brings about would hold a block."""
    moved = np.linalg.norm(first.model.node_displacement(first.state.x), axis=1)
    if moved[free_nodes(problem, first.model)].max() <= far:
        return
    node = int(moved.argmax())
    name = first.model.bodies[int(np.searchsorted(first.model.node_offset, node, side="right")) - 1].name
    raise InputError(
        f"{problem.name!r}: expected a structure that stands before its supports move, got one whose block {name!r} falls: friction could "
        "hold it once it is wedged, but nothing presses its joints together. Joints that lean, or a load across them, would"
    )


def _moving(
    problem: MasonryProblem, model: Model, scheme: QuasiStatic, steps: int, begin: FloatArray | None, stands: Callable[[FloatArray], bool]
) -> Iterator[Step]:
    """The steps of the way; begin (n_dofs,): the configuration under the loads that stay, None: the reference. They end before
    a step without an answer where the structure does not stand (`stands(x)`): what falls has none in statics."""
    x = None
    initial = None if begin is None else State(0.0, begin, np.zeros(model.n_dofs))
    detector = Everything(model, problem.friction)
    try:
        for step in Simulation(model, detector, scheme, steps, _SOLVER, initial=initial, created=np.inf):
            x = step.state.x
            yield step
    except NotConverged as error:
        if x is None or stands(x):
            raise NotConverged(f"{problem.name!r}, supports moving: {error}") from None


@dataclass(frozen=True)
class _Row:
    moved: float
    forces: Mapping[str, FloatArray]
    opening: float
    slip: float
    open_joints: int

    @classmethod
    def of(cls, moved: float, step: Step, contacts: Contacts, problem: MasonryProblem) -> _Row:
        joints = openings(contacts, step.model, step.state.x)
        number = {body.name: k for k, body in enumerate(step.model.bodies)}
        forces = {}
        slave, master = step.contacts.bodies.T if len(step.contacts) else (np.empty(0), np.empty(0))
        for block in problem.blocks:
            k = number[block.name]
            if block.support and (contacts.bodies == k).any():
                total = step.force_in_space[master == k].sum(axis=0) - step.force_in_space[slave == k].sum(axis=0)
                forces[block.name] = total if len(step.contacts) else np.zeros(problem.dimension)
        wide = [joint.opening for joint in joints]
        count = sum(opening > OPEN * problem.size for opening in wide)
        return cls(moved, forces, max(wide, default=0.0), max((joint.slip for joint in joints), default=0.0), count)


def _checked(problem: MasonryProblem, movements: Sequence[Movement], steps: int) -> None:
    expect_problem(problem, "settlement")
    what = f"settlement of {problem.name!r}"
    if not (isinstance(steps, int) and steps >= 1):
        raise InputError(f"{what}, steps: expected a whole number >= 1, got {steps!r}")
    if not isinstance(movements, tuple | list) or not all(isinstance(movement, Movement) for movement in movements):
        raise InputError(f"{what}: expected a list of movements, got {shown(movements)}")
    if not movements:
        raise InputError(f"{what}: expected supports that move, got none")
    held = [block.name for block in problem.blocks if block.support]
    for movement in movements:
        if movement.support not in held:
            raise InputError(f"{what}: expected the name of a support ({', '.join(held[:8])}), got {movement.support!r}")
        if not any((*movement.displacement, *movement.turn)):
            raise InputError(f"{what}, {movement.support!r}: expected a displacement or a turn, got none")
        (_, dy, _), (rx, _, rz) = movement.displacement, movement.turn
        if problem.dimension == 2 and any((dy, rx, rz)):
            given = f"move {movement.displacement}, turn {tuple(round(float(np.degrees(turn)), 9) for turn in movement.turn)} degrees"
            raise InputError(f"{what}, {movement.support!r}: expected a motion in the plane of x and z, a turn about y alone, got {given}")
    names = [movement.support for movement in movements]
    if len(set(names)) < len(names):
        raise InputError(f"{what}: expected one movement a support, got {', '.join(names)}")


def _moved_points(problem: MasonryProblem, movement: Movement, share: float, points: FloatArray) -> FloatArray:
    """Points (n, 3) of a support when it has gone a share of its way."""
    about = _about(problem, movement)
    turned: FloatArray = Rotation.from_rotvec(share * np.array(movement.turn)).apply(points - about)
    return turned + about + share * np.array(movement.displacement)


def _about(problem: MasonryProblem, movement: Movement) -> FloatArray:
    if movement.about is not None:
        return np.array(movement.about)
    return problem.blocks[problem.number[movement.support]].surface.moments()[1]


def _reach(problem: MasonryProblem, movements: Sequence[Movement]) -> float:
    """The largest displacement [m] of a corner of a support in the end."""
    ends = []
    for movement in movements:
        points = problem.blocks[problem.number[movement.support]].surface.points
        ends.append(np.linalg.norm(_moved_points(problem, movement, 1.0, points) - points, axis=1).max())
    return float(max(ends))


def _driven(problem: MasonryProblem, movements: Sequence[Movement]) -> list[Support]:
    """The problem's supports, those that move driven from time 0 to 1."""
    moving = {movement.support: movement for movement in movements}
    found = [support for support in supports(replace(problem, motion={})) if support.body not in moving]
    for name, movement in moving.items():
        centre = problem.blocks[problem.number[name]].surface.moments()[1][None]

        def velocity(axis: int, movement: Movement = movement, centre: FloatArray = centre) -> Callable[[float], float]:
            def at(t: float) -> float:
                before, after = (_moved_points(problem, movement, t + dt, centre)[0] for dt in (-_DT, _DT))
                return vector_of(problem, (after - before) / (2 * _DT))[axis]

            return at

        names = HELD[problem.dimension]
        d = problem.dimension
        turn = movement.turn if d == 3 else (-movement.turn[1],)  # the turn from x to z is one about -y
        found += [Support(name, (names[axis],), velocity=velocity(axis)) for axis in range(d)]
        found += [Support(name, (direction,), velocity=rate) for direction, rate in zip(names[d:], turn, strict=True)]
    return found


_DT = 1e-4
"""Half the span of time over which a support's centroid is differenced."""
