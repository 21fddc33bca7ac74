"""A masonry problem as a model of rigid bodies: where it may move, what may touch, which loads grow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.loads import Force, Load
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Everything
from fcsim.errors import InputError
from fcsim.masonry.problem import GRAVITY, Acceleration, Block, MasonryProblem, PointForce
from fcsim.mesh.part import RigidBody
from fcsim.mesh.solids.closed_surface import rigid_solid
from fcsim.mesh.solids.rigid_polygon import rigid_polygon

HELD = {2: ("x", "y", "rz"), 3: ("x", "y", "z", "rx", "ry", "rz")}
PLANE = {2: (0, 2), 3: (0, 1, 2)}
"""The coordinates that a problem of this dimension moves in."""
Multiplier = Callable[[float], float]


@dataclass(frozen=True, eq=False)
class BlockModel:
    """The model of a problem, and the loads [N] (n_dofs,) that stay (`dead`) and that the multiplier scales (`live`)."""

    problem: MasonryProblem
    model: Model
    dead: FloatArray
    live: FloatArray

    def contact(self, alert: float | None = None) -> Everything:
        """All blocks may touch each other, with the problem's friction; alert [m]: see `Everything`."""
        problem = self.problem
        mu = {("*", "*"): problem.mu, **problem.between} if problem.between else problem.mu
        return Everything(self.model, mu, alert)

    @property
    def weight(self) -> float:
        """Sum [N] of the free blocks' loads that stay, without their sign."""
        d = self.model.dimension
        return float(np.abs(self.model.rigid_part(self.dead)[:, :d]).sum())


def vector_of(problem: MasonryProblem, value: tuple[float, ...] | FloatArray) -> tuple[float, ...]:
    """The components of a vector (3,) that the problem's plane has."""
    return tuple(float(value[k]) for k in PLANE[problem.dimension])


def rigid_blocks(problem: MasonryProblem) -> list[RigidBody]:
    """The blocks as rigid bodies; supports without density as if they had that of water, which nothing asks for."""
    return [_rigid(block, problem.dimension) for block in problem.blocks]


def rigid_model(problem: MasonryProblem, multiplier: Multiplier = lambda t: 0.0) -> BlockModel:
    """Return the problem with rigid blocks, its loads those that stay and multiplier(t) times the others.

    Forces act at their points' arm from the centroid in the reference configuration, as a force and a moment that stay.
    """
    bodies = rigid_blocks(problem)
    supports = []
    for block in problem.blocks:
        if block.support:
            velocity = vector_of(problem, problem.motion.get(block.name, (0.0, 0.0, 0.0)))
            names = HELD[problem.dimension]
            supports += [Support(block.name, (axis,), velocity=v) for axis, v in zip(names, velocity, strict=False)]
            supports.append(Support(block.name, names[len(velocity) :]))
    dead_g, live_g = (np.array(vector_of(problem, problem.acceleration(scaled=scaled))) for scaled in (False, True))
    loads: list[Load] = []
    for load in problem.loads:
        if isinstance(load, PointForce):
            body = bodies[problem.number[load.block]]
            force, moment = force_and_moment(problem, load, body)
            loads.append(Force(body.name, force, moment, multiplier) if load.scaled else Force(body.name, force, moment))
    model = build_model(bodies, supports=supports, loads=loads, gravity=lambda t: dead_g + multiplier(t) * live_g)
    parts: list[FloatArray] = []
    for scaled in (False, True):
        total = np.zeros(model.n_dofs)
        rows = model.rigid_part(total)
        mass = np.array([body.mass for body in bodies])
        rows[:, : model.dimension] += mass[:, None] * (live_g if scaled else dead_g)
        for load in problem.loads:
            if isinstance(load, PointForce) and load.scaled == scaled:
                number = problem.number[load.block]
                rows[number] += np.concatenate(force_and_moment(problem, load, bodies[number]))
        total[model.driven_dofs] = 0.0
        parts.append(total)
    return BlockModel(problem, model, parts[0], parts[1])


def force_and_moment(problem: MasonryProblem, load: PointForce, body: RigidBody) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Force [N] and moment [N m] about the centroid."""
    force = vector_of(problem, load.value)
    if load.point is None:
        return force, (0.0,) * (3 if problem.dimension == 3 else 1)
    arm = np.array(vector_of(problem, load.point)) - body.centre
    if problem.dimension == 2:
        return force, (float(arm[0] * force[1] - arm[1] * force[0]),)
    return force, tuple(float(x) for x in np.cross(arm, force))


def pushed(problem: MasonryProblem, direction: tuple[float, float, float]) -> MasonryProblem:
    """Return the problem with another load in place of those that grow: the weight of every block (g = 9.81 m/s^2) in a direction."""
    x, y, z = (GRAVITY * unit(problem, direction)).tolist()
    kept = tuple(load for load in problem.loads if not load.scaled)
    return replace(problem, loads=(*kept, Acceleration((x, y, z), scaled=True)))


def tilted(problem: MasonryProblem, direction: tuple[float, float, float]) -> MasonryProblem:
    """Return the problem with the load of a table that tilts, whose tangent is the multiplier.

    In the axes of the table all loads turn by the angle a, those down (-z) towards the horizontal `direction`: cos a D + sin a D', which is
    in equilibrium iff D + tan a D' is, since forces without tension or cohesion scale. Loads that grow already are left out.
    """
    along = unit(problem, direction)
    if abs(along[2]) > 1e-9:
        raise InputError(f"direction: expected a horizontal one to tilt to, got {direction}")

    def turned(value: tuple[float, float, float]) -> tuple[float, float, float]:
        forward = float(np.dot(value, along))
        x, y, z = (-value[2] * along + np.array([0.0, 0.0, forward])).tolist()
        return x, y, z

    kept = tuple(load for load in problem.loads if not load.scaled)
    return replace(problem, loads=(*kept, *(replace(load, value=turned(load.value), scaled=True) for load in kept)))


def unit(problem: MasonryProblem, direction: tuple[float, float, float]) -> FloatArray:
    """The direction (3,) at the length 1; InputError where it has none, or leaves the plane of a plane problem."""
    length = float(np.linalg.norm(direction))
    if not (len(direction) == 3 and np.isfinite(length) and length > 0):
        raise InputError(f"direction: expected three finite numbers, not all 0, got {direction}")
    if problem.dimension == 2 and direction[1] != 0:
        raise InputError(f"direction: expected one in the plane of x and z, got {direction}")
    return np.asarray(direction, dtype=np.float64) / length


def _rigid(block: Block, dimension: int) -> RigidBody:
    density = block.density if block.mass is not None or block.density is not None else 1000.0
    if dimension == 3:
        return rigid_solid(block.surface, density=density, mass=block.mass)
    points, thickness = outline(block)
    return rigid_polygon(block.name, points, density=density, mass=block.mass, thickness=thickness)


def outline(block: Block) -> tuple[FloatArray, float]:
    """Corners (n, 2) of a prism along y in the plane of x and z, counter-clockwise, and its thickness [m]; InputError for other shapes."""
    points = block.surface.points
    low, high = points[:, 1].min(), points[:, 1].max()
    flat = 1e-6 * float(np.ptp(points, axis=0).max())
    front, back = points[:, 1] < low + flat, points[:, 1] > high - flat
    if not (front ^ back).all() or front.sum() != back.sum():
        raise InputError(f"block {block.name!r}: expected a prism along y in a plane problem, got corners between its two ends")
    for polygon in block.surface.polygons:
        if front[list(polygon)].all():
            corners = points[list(polygon)][:, [0, 2]]
            x, z = corners.T
            area = x @ np.roll(z, -1) - np.roll(x, -1) @ z
            return (corners if area > 0 else corners[::-1]), float(high - low)
    raise InputError(f"block {block.name!r}: expected one face at each end of a prism along y, got several")
