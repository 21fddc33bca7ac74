"""A masonry problem as a model to simulate: blocks rigid, deformable or both, loads over time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, is_number
from fcsim.assembly.loads import Force, ForceAtPoint, Load
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports.support import Support
from fcsim.brief import shown
from fcsim.contact_detection import Contacts, Everything
from fcsim.contact_law.as_built import AsBuilt
from fcsim.errors import InputError
from fcsim.masonry.bodies import moment_of, outline, rigid_blocks, supports, vector_of
from fcsim.masonry.problem import Block, MasonryProblem, PointForce, expect_problem
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, Part, RigidBody
from fcsim.mesh.solids.closed_surface import ClosedSurface
from fcsim.mesh.solids.meshed import meshed_polygon, meshed_solid

TimeFunction = Callable[[float], float]
BlocksAre = Literal["rigid", "deformable", "mixed"]


@dataclass(frozen=True)
class Stone:
    """What deformable blocks are made of, E [Pa] and nu, and the size of their cells as a share of the block's smallest edge."""

    E: float = 1e10
    nu: float = 0.2
    cells: float = 0.5
    beta: float = 1e-4

    def __post_init__(self) -> None:
        Material(self.E, self.nu, 1.0)  # which says what E and nu may be
        for name, least in (("cells", "> 0"), ("beta", ">= 0")):
            value = getattr(self, name)
            if not (is_number(value) and value >= 0 and (value > 0 or least == ">= 0")):
                raise InputError(f"Stone, {name}: expected a number {least}, got {shown(value)}")


def structure(
    problem: MasonryProblem,
    blocks_are: BlocksAre = "rigid",
    stone: Stone | None = None,
    *,
    multiplier: TimeFunction = lambda t: 0.0,
    staying: TimeFunction = lambda t: 1.0,
    held: Sequence[Support] | None = None,
    lumped: bool = True,
    over: float = 0.0,
) -> tuple[Model, tuple[str, ...]]:
    """Return the model of a problem and remarks on it; its loads are staying(t) times those that stay, multiplier(t) times the others,
    and where the ground shakes the inertia of blocks that are seen from it.

    held: in place of the problem's own supports; lumped: the mass of deformable blocks on their nodes, which gives coarse meshes too much
    inertia of rotation; over [s]: the step, over which the ground's acceleration is taken in the mean, or shorter pulses would count as
    they happen to lie. "mixed": every second block is deformable. Supports, blocks of a given mass and blocks
    with a force or a support upon them are rigid always. Blocks that are equal but for their place are one part, meshed once.
    """
    expect_problem(problem, "structure")
    if blocks_are not in ("rigid", "deformable", "mixed"):
        raise InputError(f"blocks_are: expected 'rigid', 'deformable' or 'mixed', got {blocks_are!r}")
    stone = stone or Stone()
    rigid = rigid_blocks(problem)
    stays = supports(problem) if held is None else held
    pushed = {load.block for load in problem.loads if isinstance(load, PointForce)} | {support.body for support in stays}
    meshed: dict[bytes, Part] = {}
    bodies: list[Body | RigidBody] = []
    stiff = 0
    for number, (block, body) in enumerate(zip(problem.blocks, rigid, strict=True)):
        soft = blocks_are == "deformable" or (blocks_are == "mixed" and number % 2 == 0)
        must = block.support or block.density is None or block.name in pushed
        stiff += soft and must and not block.support
        bodies.append(_deformable(problem, block, stone, meshed) if soft and not must else body)
    remarks = (f"{stiff} blocks of a given mass or with a force or a support upon them are rigid",) if stiff else ()
    still, growing = (np.array(vector_of(problem, problem.acceleration(scaled=scaled))) for scaled in (False, True))

    def gravity(t: float) -> FloatArray:
        steady = staying(t) * still + multiplier(t) * growing
        return steady - np.array(vector_of(problem, problem.ground(t, over))) if problem.shaking else steady

    loads: list[Load] = []
    for load in problem.loads:
        if isinstance(load, PointForce):
            loads.append(_point_force(problem, load, multiplier if load.scaled else staying))
    beta = 0.0 if blocks_are == "rigid" else stone.beta
    return build_model(bodies, supports=stays, loads=loads, gravity=gravity, beta=beta, lumped=lumped), remarks


def _point_force(problem: MasonryProblem, load: PointForce, factor: TimeFunction) -> Load:
    """At a point the force moves with it where the block turns: a load on top overturns what one at the centroid does not."""
    force, moment = vector_of(problem, load.value), tuple(moment_of(problem, load).tolist())
    if load.point is None or not any(load.value):
        return Force(load.block, force, moment, factor)
    return ForceAtPoint(load.block, force, vector_of(problem, load.point), moment, factor)


def touching(problem: MasonryProblem, model: Model) -> Contacts:
    """The contacts of the blocks as they were built, those of `limit_problem` where all are rigid."""
    return Everything(model, problem.friction, 1e-4 * problem.smallest)(model.reference)


def as_built(problem: MasonryProblem, model: Model) -> AsBuilt:
    """The law of statics by which the joints of `touching` are closed as the blocks were given, whatever gap or overlap they were left."""
    gap = touching(problem, model).gap
    return AsBuilt(closed=float(gap.max(initial=0.0)), overlap=float(-gap.min(initial=0.0)))


def free_nodes(problem: MasonryProblem, model: Model) -> BoolArray:
    """Which nodes (n_nodes,) of a problem's model are of blocks that are no supports."""
    free = [not problem.blocks[problem.number[body.name]].support for body in model.bodies]
    return np.repeat(free, np.diff(model.node_offset))


def _deformable(problem: MasonryProblem, block: Block, stone: Stone, meshed: dict[bytes, Part]) -> Body:
    """A block as a body of the part of its shape."""
    assert block.density is not None
    surface = block.surface
    origin = surface.points.min(axis=0)
    shape = surface.points - origin
    edges = np.linalg.norm(np.diff(shape[surface.triangles][:, [0, 1, 2, 0]], axis=1), axis=2)
    key = np.round(shape / edges.min(), 6).tobytes() + repr((surface.polygons, round(float(edges.min()), 12), block.density)).encode()
    if block.cells is not None:  # other cells may fill the same skin
        key += np.round((block.cells.points - origin) / edges.min(), 6).tobytes() + block.cells.cells.tobytes()
    if key not in meshed:
        material = Material(stone.E, stone.nu, block.density)
        if block.cells is not None:
            meshed[key] = Part(block.name, block.cells.points - origin, block.cells.cells, block.cells.cell_type, {}, material)
        elif problem.dimension == 2:
            corners, thickness = outline(block)
            size = stone.cells * float(np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1).min())
            meshed[key] = meshed_polygon(block.name, corners - origin[[0, 2]], material, size, thickness=thickness)
        else:
            whole = ClosedSurface(block.name, shape, surface.triangles, surface.polygons)
            meshed[key] = meshed_solid(whole, material, stone.cells * float(edges.min()))
    return Body(block.name, meshed[key], translation=origin if problem.dimension == 3 else origin[[0, 2]])
