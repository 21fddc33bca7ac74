"""Blocks that stand or fall, on both sides of the limit: toppling, rocking on a shaken floor, overhanging stacks; rigid and stiff blocks.

Sources: statics of rigid blocks. A block of width b and height h topples on a slope iff tan(slope) > b / h (and slides iff it exceeds mu);
it begins to rock when the floor's acceleration exceeds (b / h) g (G. W. Housner, Bull. Seism. Soc. Am. 53, 1963); n equal bricks of length
L overhang a table by at most (L / 2) (1 + 1/2 + ... + 1/n).
"""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.layout import DIRECTIONS
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh.blocks import brick, rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, RigidBody
from fcsim.mesh.rigid import rigid_body
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta

G = 9.81
STIFF = Material(1e9, 0.2, 2000.0)
WIDTH, HEIGHT, H = 0.2, 0.5, 1e-3
ELASTIC = 20 * STIFF.density * G * HEIGHT**2 / STIFF.E  # a few times the shortening under its own weight [m]: it stands on a corner
RAMP = 0.02  # gravity comes up over this time [s], so that stiff blocks do not bounce


def placed(
    kind: str, d: int, name: str, size: tuple[float, ...], corner: tuple[float, ...], divisions: tuple[int, ...]
) -> Body | RigidBody:
    """A block of `size` = (length along x, height), in 3D as thick as long, with its lower left corner at `corner` = (x, height)."""
    if d == 2:
        part = rectangle(name, size, divisions, STIFF)
    else:
        part = brick(name, (size[0], size[0], size[1]), (divisions[0], 1, divisions[1]), STIFF)
    body = Body(name, part, translation=np.array(corner if d == 2 else (corner[0], -size[0] / 2, corner[1])))
    return rigid_body(body) if kind == "rigid" else body


def floor(d: int, right: float = 10.0, across: float = 20.0) -> RigidBody:
    """A rigid body with its top at height 0 that ends at x = right, in 3D `across` wide."""
    if d == 2:
        return rigid_rectangle("floor", (20, 1), (right - 10, -0.5), 1.0)
    return rigid_box("floor", (20, across, 1), (right - 10, 0, -0.5), 1.0)


def toppling_rate(drive: float, hold: float, seconds: float) -> float:
    """Angular velocity about the corner, small angles: phi'' = m (drive h - hold b) / (2 I) + p^2 phi, p^2 = m (hold h + drive b) / (2 I).

    drive, hold [m/s^2]: the accelerations along and into the floor; I = m (b^2 + h^2) / 3 about the corner.
    """
    inertia = (WIDTH**2 + HEIGHT**2) / 3
    start, p = (drive * HEIGHT - hold * WIDTH) / 2 / inertia, np.sqrt((hold * HEIGHT + drive * WIDTH) / 2 / inertia)
    return float(start / p * np.sinh(p * seconds))


def stack(
    blocks: list[Body | RigidBody], ground: RigidBody, gravity: Any, mu: float, steps: int, velocity: Any = 0.0, floor_nodes: bool = False
) -> tuple[Model, list[Step]]:
    """Run blocks that stand on each other, the first on the floor: the nodes of both sides of a joint are candidates (of the floor, whose
    corners are far away or its edge, where asked for)."""
    d = ground.dimension
    up = "xyz"[d - 1]
    others = DIRECTIONS[d][1:]
    model = build_model(
        [*blocks, ground],
        supports=[Support("floor", others), Support("floor", ("x",), velocity=velocity)],
        gravity=lambda t: np.asarray(gravity) * min(t / RAMP, 1.0),
        beta=2e-3,
    )
    pairs = []
    for lower, upper in pairwise([ground.name, *(block.name for block in blocks)]):
        below, above = contact_surface(model, [(lower, up + "+")]), contact_surface(model, [(upper, up + "-")])
        pairs.append(SurfacePair(above, below, mu, 5e-3))
        if lower != ground.name or floor_nodes:
            pairs.append(SurfacePair(below, above, mu, 5e-3))
    settings = SolverSettings(name="PPA-NSN-AC", tol=1e-9)
    return model, list(Simulation(model, Detector(pairs, model.n_nodes), Theta(H), steps, settings))


def mean_velocity(model: Model, step: Step, body: int, reference: int) -> np.ndarray:
    """Velocity (d,) of a body's nodes on average, relative to a rigid body's."""
    d = model.dimension
    nodes = slice(model.node_offset[body], model.node_offset[body + 1])
    other = model.dof_offset[reference]
    return model.node_velocity(step.state.v, step.state.x)[nodes].mean(axis=0) - step.state.v[other : other + d]


def lifted(steps: list[Step], model: Model, body: int) -> float:
    """How far the highest lower corner of a block is above its reference height [m], in the end."""
    up = model.dimension - 1
    nodes = slice(model.node_offset[body], model.node_offset[body + 1])
    reference = model.reference[nodes, up]
    bottom = reference < reference.min() + 1e-9
    return float(model.node_displacement(steps[-1].state.x)[nodes, up][bottom].max())


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("factor", [0.995, 1.005])
def test_rigid_block_topples_on_a_slope(d: int, factor: float) -> None:
    slope = np.arctan(factor * WIDTH / HEIGHT)
    gravity = np.zeros(d)
    gravity[0], gravity[-1] = G * np.sin(slope), -G * np.cos(slope)
    model, steps = stack([placed("rigid", d, "block", (WIDTH, HEIGHT), (0, 0), (1, 1))], floor(d), gravity, 2.0, 120)
    omega = steps[-1].state.v[(2 if d == 2 else 4)] * (-1 if d == 2 else 1)
    if factor < 1:
        assert_allclose(steps[-1].state.v, 0, atol=1e-7)
        weight = model.rigid[0].mass * -gravity
        assert_allclose(steps[-1].contact_force_on(0), weight, atol=1e-5 * np.linalg.norm(weight))
    else:
        assert omega == pytest.approx(toppling_rate(G * np.sin(slope), G * np.cos(slope), 120 * H - RAMP / 2), rel=0.02)
        assert lifted(steps, model, 0) > 0


@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_stiff_block_topples_on_a_slope(factor: float) -> None:
    slope = np.arctan(factor * WIDTH / HEIGHT)
    block = placed("deformable", 2, "block", (WIDTH, HEIGHT), (0, 0), (4, 6))
    model, steps = stack([block], floor(2), (G * np.sin(slope), -G * np.cos(slope)), 2.0, 150)
    moved = mean_velocity(model, steps[-1], 0, 1)
    expected = HEIGHT / 2 * toppling_rate(G * np.sin(slope), G * np.cos(slope), 150 * H - RAMP / 2)  # of the centre along the slope
    if factor < 1:
        assert abs(moved[0]) < 0.05 * abs(expected)
        assert lifted(steps, model, 0) < ELASTIC
    else:
        assert moved[0] == pytest.approx(expected, rel=0.1)
        assert lifted(steps, model, 0) > 1e-3


@pytest.mark.each_value
@pytest.mark.parametrize("kind", ["rigid", "deformable"])
@pytest.mark.parametrize(("mu", "factor"), [(0.3, 1.05), (0.39, 0.98)])
def test_block_slides_before_it_topples(kind: str, mu: float, factor: float) -> None:
    """mu < b / h = 0.4: it stands or slides with g (sin - mu cos), and does not turn."""
    slope = np.arctan(factor * mu)
    model, steps = stack(
        [placed(kind, 2, "block", (WIDTH, HEIGHT), (0, 0), (4, 6))], floor(2), (G * np.sin(slope), -G * np.cos(slope)), mu, 80
    )
    down = mean_velocity(model, steps[-1], 0, 1)[0]
    expected = max(0.0, G * (np.sin(slope) - mu * np.cos(slope))) * (80 * H - RAMP / 2)
    assert down == pytest.approx(expected, rel=1e-3 if kind == "rigid" else 0.1, abs=1e-7 if kind == "rigid" else 2e-3)
    assert lifted(steps, model, 0) < (1e-8 if kind == "rigid" else ELASTIC)


@pytest.mark.parametrize(("kind", "factor"), [("rigid", 0.99), ("rigid", 1.01), ("deformable", 0.9), ("deformable", 1.1)])
def test_rocking_of_a_shaken_block(kind: str, factor: float) -> None:
    """The floor moves with the constant acceleration factor (b / h) g from RAMP on; above 1 the block rocks about its rear corner,
    below it goes with the floor."""
    a = factor * WIDTH / HEIGHT * G
    block = placed(kind, 2, "block", (WIDTH, HEIGHT), (0, 0), (4, 6))
    model, steps = stack([block], floor(2), (0.0, -G), 2.0, 170, velocity=lambda t: a * max(t - RAMP, 0.0))
    relative = mean_velocity(model, steps[-1], 0, 1)
    expected = -HEIGHT / 2 * toppling_rate(a, G, 170 * H - RAMP)
    if factor < 1:
        assert abs(relative[0]) < (1e-7 if kind == "rigid" else 0.05 * abs(expected))
        assert lifted(steps, model, 0) < (1e-8 if kind == "rigid" else ELASTIC)
        assert steps[-1].contact_force_on(0)[0] == pytest.approx(a * STIFF.density * WIDTH * HEIGHT, rel=1e-4 if kind == "rigid" else 0.05)
    else:
        assert relative[0] == pytest.approx(expected, rel=0.02 if kind == "rigid" else 0.1)
        assert lifted(steps, model, 0) > 1e-4


LENGTH, BRICKS = 0.2, 4


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("factor", [0.99, 1.01])
def test_overhanging_stack_of_rigid_bricks(d: int, factor: float) -> None:
    check_overhang("rigid", d, factor, 150)


@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_overhanging_stack_of_stiff_bricks(factor: float) -> None:
    check_overhang("deformable", 2, factor, 150)


def check_overhang(kind: str, d: int, factor: float, count: int) -> None:
    """Brick k from the top stands out by factor L / (2 k) over the one below it, the lowest over the edge of a table."""
    right = factor * LENGTH / 2 * np.cumsum(1 / np.arange(BRICKS, 0, -1))  # of each brick's end over the edge, from the lowest up
    blocks = [
        placed(kind, d, f"brick {k}", (LENGTH, 0.06), (end - LENGTH, 0.06 * k), (4, 1) if kind == "deformable" else (1, 1))
        for k, end in enumerate(right)
    ]
    assert right[-1] == pytest.approx(factor * LENGTH / 2 * (1 + 1 / 2 + 1 / 3 + 1 / 4))
    gravity = (0.0, -G) if d == 2 else (0.0, 0.0, -G)
    model, steps = stack(blocks, floor(d, right=0.0, across=LENGTH), gravity, 1.0, count, floor_nodes=True)
    top = BRICKS - 1
    tip = model.node_displacement(steps[-1].state.x)[model.node_offset[top] : model.node_offset[top + 1], d - 1].min()
    if factor < 1:
        assert tip > (-1e-7 if kind == "rigid" else -1e-4)
        speed = np.abs(steps[-1].state.v).max()
        assert speed < (1e-6 if kind == "rigid" else 5e-3)
        weight = model.load(1.0).reshape(-1, 6 if d == 3 else 3)[:, d - 1] if kind == "rigid" else None
        if weight is not None:
            assert steps[-1].contact_force_on(model.number["floor"])[d - 1] == pytest.approx(weight[:-1].sum(), rel=1e-6)
    else:
        assert tip < -1e-3
