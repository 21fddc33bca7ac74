"""A structure on ground that shakes: what moves, how far, and whether it falls.

Blocks are seen from the ground, whose acceleration acts as their inertia. Impacts are inelastic (Moreau's law, e = 0): a block that rocks
loses what Housner's angular momentum about the new toe says (G. W. Housner, Bull. Seismol. Soc. Am. 53, 1963). Of deformable blocks the
damping of their stone takes what impacts make of the motion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fcsim.arrays import FloatArray, is_number
from fcsim.assembly.forms.rotations import angle_of
from fcsim.assembly.kinematics.frames import FloatingGroup
from fcsim.assembly.model import Model
from fcsim.assembly.time_functions import AccelerationRecord
from fcsim.brief import shown
from fcsim.contact_detection import Everything
from fcsim.errors import InputError
from fcsim.masonry.problem import GRAVITY, BaseAcceleration, MasonryProblem, expect_problem
from fcsim.masonry.structure import BlocksAre, Stone, free_nodes, structure
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta

DOWN = 0.1
"""Share of its extent by which the centroid of a block that falls comes down."""
_ROUND_OFF = 1e-8  # of the extent, or of a turn by one: rigid blocks that move by less, a hundredth of first motion, do not move
_STEPS = 100  # in the time in which the smallest block falls by its own extent
_AFTER = 2.0  # [s] watched after the record


@dataclass(frozen=True, eq=False)
class Shake:
    """Histories (n,): t [s], the largest displacement of a corner [m], the largest turn of a block from where it began [rad].

    fallen: the names of the blocks that came down by more than `DOWN` of their extent; moving: whether corners moved faster than a
    hundredth of the structure's extent a second in the end; remarks: what the run says of its steps and of what it does not cover
    """

    t: FloatArray
    displacement: FloatArray
    turn: FloatArray
    fallen: tuple[str, ...]
    moving: bool
    remarks: tuple[str, ...] = ()


def shaken(problem: MasonryProblem, direction: tuple[float, float, float], record: AccelerationRecord) -> MasonryProblem:
    """Return the problem on ground that accelerates along a direction (3,) by the record [m/s^2], in place of its own shaking."""
    expect_problem(problem, "shaken")
    return replace(problem, shaking=(BaseAcceleration(direction, record),))


def shake(
    problem: MasonryProblem,
    *,
    duration: float | None = None,
    h: float | None = None,
    theta: float = 0.5,
    blocks: BlocksAre = "rigid",
    stone: Stone | None = None,
    watch: Callable[[Step, int], None] | None = None,
) -> Shake:
    """Return what the ground's shaking makes of a structure; blocks, stone: see `structure`; watch(step, steps): called after each
    step, with how many there are.

    duration [s]: by default the record's and two seconds; h [s]: the step, by default a hundredth of the time in which the smallest block
    falls by its extent. InputError where no ground shakes and no block begins moved.
    """
    expect_problem(problem, "shake")
    if duration is None:
        if not problem.shaking:
            raise InputError(
                f"{problem.name!r}: expected a record (--record FILE.csv), base_acceleration in its file or a --duration, got none"
            )
        ends = [float(each.record.times[-1]) for each in problem.shaking if isinstance(each.record, AccelerationRecord)]
        if len(ends) < len(problem.shaking):
            raise InputError(f"{problem.name!r}: expected a duration, since its ground shakes by a function, which has no end")
        duration = max(ends) + _AFTER
    if not (is_number(duration) and duration > 0):
        raise InputError(f"duration: expected a time > 0 in s, got {shown(duration)}")
    usual = float(np.sqrt(2 * problem.smallest / GRAVITY)) / _STEPS
    if h is None and usual > duration:
        raise InputError(f"duration: expected at least one step, which is {usual:.4g} s unless h says another, got {duration:g}")
    h = usual if h is None else h
    if not (is_number(h) and 0 < h <= duration):
        raise InputError(f"h: expected a step > 0 in s, at most the duration of {duration:g} s, got {shown(h)}")
    model, _ = structure(problem, blocks, stone, lumped=False, over=h)
    simulation = Simulation(
        model, Everything(model, problem.friction), Theta(h, theta), int(np.ceil(duration / h)), SolverSettings(name="auto"), created=np.inf
    )
    corners = free_nodes(problem, model)
    t, displacement, turn, speed, remarks = [], [], [], 0.0, list[str]()
    drop = np.zeros(len(model.bodies))
    for step in simulation:
        if watch is not None:
            watch(step, simulation.steps)
        t.append(step.state.t)
        remarks += step.remarks
        displacement.append(float(np.linalg.norm(model.node_displacement(step.state.x)[corners], axis=1).max()))
        turns, drop = _turns_and_drops(model, step.state.x)
        turn.append(float(turns.max()))
        speed = float(np.linalg.norm(model.node_velocity(step.state.v, step.state.x)[corners], axis=1).max())
    history, turns = np.array(displacement), np.array(turn)
    if blocks == "rigid":  # deformable ones sink under their weight by as little
        history[history <= _ROUND_OFF * problem.size] = 0.0
        turns[turns <= _ROUND_OFF] = 0.0
    extents = [np.ptp(problem.blocks[problem.number[body.name]].surface.points, axis=0).max() for body in model.bodies]
    fallen = tuple(body.name for body, by, extent in zip(model.bodies, drop, extents, strict=True) if by > DOWN * extent)
    return Shake(np.array(t), history, turns, fallen, speed > 0.01 * problem.size, tuple(remarks))


def _turns_and_drops(model: Model, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Of each body (n_bodies,) how far it has turned [rad] and how far its centroid came down [m]; of deformable ones their frames and
    the mean of their volume."""
    d, count = model.dimension, len(model.deformable)
    turn, drop = np.zeros((2, len(model.bodies)))
    rows = model.rigid_part(x)
    turn[count:], drop[count:] = np.linalg.norm(rows[:, d:], axis=1), -rows[:, d - 1]
    for group in model.groups:
        floating = FloatingGroup(group)
        moved = floating.displacement(x)
        turn[group.members] = angle_of(floating.frames(x).rotation)
        drop[group.members] = -(floating.weight @ moved)[:, d - 1]
    return turn, drop
