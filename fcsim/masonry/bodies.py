"""The blocks of a problem as bodies: rigid, plane or solid, held or moved; forces upon them."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.supports import Support
from fcsim.errors import InputError
from fcsim.masonry.problem import Block, MasonryProblem, PointForce
from fcsim.mesh.part import RigidBody
from fcsim.mesh.solids.closed_surface import rigid_solid
from fcsim.mesh.solids.rigid_polygon import rigid_polygon

HELD = {2: ("x", "y", "rz"), 3: ("x", "y", "z", "rx", "ry", "rz")}
PLANE = {2: (0, 2), 3: (0, 1, 2)}
"""The coordinates that a problem of this dimension moves in."""


def vector_of(problem: MasonryProblem, value: tuple[float, ...] | FloatArray) -> tuple[float, ...]:
    """The components of a vector (3,) that the problem's plane has."""
    return tuple(float(value[k]) for k in PLANE[problem.dimension])


def rigid_blocks(problem: MasonryProblem) -> list[RigidBody]:
    """The blocks as rigid bodies; supports without density as if they had that of water, which nothing asks for."""
    return [_rigid(block, problem.dimension) for block in problem.blocks]


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
    ends = block.surface.triangles[front[block.surface.triangles].all(axis=1)].tolist()
    corners = points[_around(ends, block.name)][:, [0, 2]]
    x, z = corners.T
    area = x @ np.roll(z, -1) - np.roll(x, -1) @ z
    return (corners if area > 0 else corners[::-1]), float(high - low)


def _around(faces: list[list[int]], name: str) -> list[int]:
    """The corners around the triangles of one end, one after the other: the sides that belong to one triangle alone."""
    sides = [side for face in faces for side in zip(face, face[1:] + face[:1], strict=True)]
    following = {first: last for first, last in sides if (last, first) not in sides}
    loop = [next(iter(following), -1)]
    while len(loop) <= len(following) and following.get(loop[-1], -1) != loop[0]:
        loop.append(following.get(loop[-1], -1))
    if len(loop) != len(following) or -1 in loop:
        raise InputError(
            f"block {name!r}: expected one outline at each end of a prism along y, got {len(following)} sides that are not one"
        )
    return loop


def force_and_moment(problem: MasonryProblem, load: PointForce, body: RigidBody) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Force [N] and moment [N m] about the centroid."""
    force, moment = vector_of(problem, load.value), moment_of(problem, load)
    if load.point is None:
        return force, tuple(moment.tolist())
    arm = np.array(vector_of(problem, load.point)) - body.centre
    if problem.dimension == 2:
        return force, (float(moment[0] + arm[0] * force[1] - arm[1] * force[0]),)
    return force, tuple((moment + np.cross(arm, force)).tolist())


def moment_of(problem: MasonryProblem, load: PointForce) -> FloatArray:
    """Its moment alone (3,), 2D (1,) [N m]."""
    return np.array(load.moment) if problem.dimension == 3 else -np.array(load.moment[1:2])  # the turn from x to z is one about -y


def supports(problem: MasonryProblem) -> list[Support]:
    """The supports of a problem, held or driven."""
    found = []
    for block in problem.blocks:
        if block.support:
            velocity = vector_of(problem, problem.motion.get(block.name, (0.0, 0.0, 0.0)))
            names = HELD[problem.dimension]
            found += [Support(block.name, (axis,), velocity=v) for axis, v in zip(names, velocity, strict=False)]
            found.append(Support(block.name, names[len(velocity) :]))
    return found
