"""Contact that comes and goes: far bodies, lost and regained contact, edges, corners, one surface for all bodies. Source: statics."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.loads import Force
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair, split_at_sharp_edges, two_pass
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Gap
from fcsim.mesh.blocks import brick, rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, RigidBody
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta

E, HEIGHT, SIDE = 1e7, 0.2, 0.3
HELD = {2: ("x", "y", "rz"), 3: ("x", "y", "z", "rx", "ry", "rz")}


def driven_column(d: int, apart: float, lower: tuple[int, ...], upper: tuple[int, ...], moves: list[float]) -> Model:
    """Two blocks (nu = 0), the upper `apart` above the lower and its top driven down by each of `moves` [m] in steps of 1 s."""
    material, axis, size = Material(E, 0.0, 1000.0), "xyz"[d - 1], (*(SIDE,) * (d - 1), HEIGHT)
    make: Any = rectangle if d == 2 else brick
    rise = np.zeros(d)
    rise[-1] = HEIGHT + apart
    bodies = [Body("lower", make("lower", size, lower, material)), Body("upper", make("upper", size, upper, material), translation=rise)]
    sides = tuple("xy"[: d - 1])
    return build_model(
        bodies,
        supports=[
            Support("lower", (*sides, axis), axis + "-"),
            Support("upper", sides, axis + "+"),
            Support("upper", (axis,), axis + "+", velocity=lambda t: -moves[min(int(t), len(moves) - 1)]),
        ],
    )


def run(model: Model, pairs: Any, steps: int, scheme: Any, **settings: Any) -> list[Step]:
    return list(Simulation(model, Detector(list(pairs), model.n_nodes), scheme, steps, SolverSettings(**settings)))


@pytest.mark.each_value
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize(("rule", "matching"), [("nodes", True), ("faces", True), ("mortar", False), ("segments", False)])
def test_far_apart_lost_and_regained(rule: Any, matching: bool, d: int) -> None:
    """0.5 m apart at the start; pressed, lifted by 0.2 m, pressed again: at each step E A (approach - 0.5) / (2 height), or nothing."""
    moves = [0.05] * 10 + [0.002] * 2 + [-0.05] * 4 + [0.05] * 4 + [0.001, -0.003]
    lower: tuple[int, ...] = (3, 2) if d == 2 else (3, 2, 1)
    upper: tuple[int, ...] = lower if matching else (4, 2) if d == 2 else (4, 3, 1)
    model = driven_column(d, 0.5, lower, upper, moves)
    axis = "xyz"[d - 1]
    surfaces = contact_surface(model, [("upper", axis + "-")]), contact_surface(model, [("lower", axis + "+")])
    solver = {"name": "auto", "tol": 1e-9} if rule == "segments" else {"tol": 1e-9}
    steps = run(model, [SurfacePair(*surfaces, 0.4, 0.06, rule)], len(moves), QuasiStatic(1.0), **solver)
    approach = np.cumsum(moves)
    expected = E * SIDE ** (d - 1) * np.maximum(approach - 0.5, 0) / (2 * HEIGHT)
    found = np.array([step.contact_force_on(1) for step in steps])
    assert_allclose(found[:, -1], expected, atol=1e-6 * expected.max())
    assert_allclose(found[:, :-1], 0, atol=1e-6 * expected.max())
    assert sum(expected > 1e-9) == 5
    counts = np.array([len(step.contacts) for step in steps])
    assert (counts[:8] == 0).all() and counts[14] == 0 and counts[11] > 0 and counts[-1] > 0


@pytest.mark.parametrize("rule", ["nodes", "mortar"])
def test_a_step_longer_than_the_alert_distance(rule: Any) -> None:
    """What the alert distance missed is met at the end of the step, which is solved again with it, as long as it is not deeper than half
    a facet."""
    model = driven_column(2, 0.02, (3, 2), (3, 2), [0.025, 0.0])
    surfaces = contact_surface(model, [("upper", "y-")]), contact_surface(model, [("lower", "y+")])
    first, second = run(model, [SurfacePair(*surfaces, 0.4, 1e-3, rule)], 2, QuasiStatic(1.0), tol=1e-10)
    assert_allclose([first.penetration, second.penetration], [0.0, 0.0], atol=1e-9)
    assert_allclose([step.contact_force_on(1)[1] for step in (first, second)], E * SIDE * 0.005 / (2 * HEIGHT), rtol=1e-7)


def drawn_over_the_edge(rule: Any, steps: int) -> np.ndarray:
    """Vertical force (steps,) on a pressed block of 8 facets while it is drawn over the end of a rigid base, without friction."""
    block = rectangle("block", (0.4, 0.2), (8, 4), Material(E, 0.0, 1000.0))
    base = rigid_rectangle("base", (2.0, 1.0), (-0.5, -0.5), 1.0)  # ends at x = 0.5
    model = build_model(
        [Body("block", block), base],
        supports=[
            Support("base", HELD[2]),
            Support("block", ("x",), "y+", velocity=lambda t: 0.55 / steps if t > 1 else 0.0),
            Support("block", ("y",), "y+", velocity=lambda t: -0.001 if t < 1 else 0.0),
        ],
    )
    pair = SurfacePair(contact_surface(model, [("block", "y-")]), contact_surface(model, [("base", "y+")]), 0.0, 5e-3, rule)
    return np.array([step.contact_force_on(0)[1] for step in run(model, [pair], steps + 1, QuasiStatic(1.0), tol=1e-9)])[1:]


def test_drawn_over_an_edge() -> None:
    """The covered part alone carries. With the mortar rule the force falls in changes that go with the step, down to about a hundredth
    where a node's share vanishes (which acts at the edge to the last); with node-to-segment by a node's share at once, a sixteenth and
    more. In the end nothing is left; before that, the block's corner alone is on the base and pressed on as it was."""
    full = E * 0.4 * 0.001 / 0.2
    changes = {}
    for rule in ("mortar", "nodes"):
        histories = [drawn_over_the_edge(rule, steps) for steps in (33, 99)]
        changes[rule] = [np.abs(np.diff(h[h > 0])).max() / full for h in histories]
        for history in histories:
            assert_allclose(history[0], full, rtol=1e-6)
            assert history[-1] == 0
    assert changes["mortar"][1] < 0.4 * changes["mortar"][0]
    assert min(changes["nodes"]) > 1 / 16


WEIGHT = 10 * 9.81


def overhanging(pairs: Any, facets: int) -> Step:
    """A rigid block from x = 0 to 1 of `facets` segments on a base that ends at x = 0.6, after 20 ms; pairs(block, base)."""
    block = rigid_rectangle("block", (1.0, 0.2), (0.5, 0.1), 10.0, (facets, 1))
    base = rigid_rectangle("base", (1.6, 1.0), (-0.2, -0.5), 1.0)
    model = build_model([block, base], supports=[Support("base", HELD[2])], gravity=lambda t: (0, -9.81))
    surfaces = contact_surface(model, [("block", "y-")]), contact_surface(model, [("base", "y+")])
    return run(model, pairs(*surfaces), 20, Theta(1e-3, law=Gap()), tol=1e-10)[-1]


def test_an_edge_under_the_middle_of_a_facet() -> None:
    """The centre of mass, x = 0.5, is above the base, which ends at 0.6. The base's corner is no node of the block: one pass of
    node-to-segment lets it tip, two passes hold it with reactions 5/6 of the weight at 0.6 and 1/6 at 0."""
    one = overhanging(lambda block, base: [SurfacePair(block, base, 0.5, 0.01)], 1)
    assert one.state.v[2] < -0.1
    two = overhanging(lambda block, base: two_pass(block, base, 0.5, 0.01, name="edge"), 1)
    assert_allclose(two.state.v, 0, atol=1e-8)
    assert two.contacts.bodies.tolist() == [[0, 1], [1, 0]]
    assert_allclose(two.contacts.point[:, 0], [0, 0.6], atol=1e-9)
    assert_allclose(two.contact_force[:, 0], [WEIGHT / 6, WEIGHT * 5 / 6], rtol=1e-6)
    assert_allclose(two.contact_force_on(0), [0, WEIGHT], atol=1e-6)


def test_an_edge_between_the_nodes_of_the_mortar_rule() -> None:
    """Ten facets, the base ends in the middle of the seventh: the resultant stands under the centre of mass."""
    step = overhanging(lambda block, base: [SurfacePair(block, base, 0.5, 0.01, "mortar")], 10)
    assert_allclose(step.state.v, 0, atol=1e-8)
    force = step.contact_force[:, 0]
    assert_allclose(force.sum(), WEIGHT, rtol=1e-6)
    assert_allclose(force @ step.contacts.point[:, 0], 0.5 * WEIGHT, rtol=1e-6)
    assert step.contacts.point[:, 0].max() < 0.6


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("rule", ["nodes", "gauss", "mortar"])
def test_block_in_a_corner(rule: Any, d: int) -> None:
    """Pushed into the corner of a floor and a wall, without friction: the floor carries the weight, the wall the push. One pair, whose
    slave is bottom and side and whose master is both other bodies: a corner node has a contact with each."""
    size = (0.4, 0.3, 0.2) if d == 3 else (0.4, 0.2)
    up, make = "xyz"[d - 1], rigid_box if d == 3 else rigid_rectangle
    centre = tuple(s / 2 for s in size)
    block = make("block", size, centre, 10.0, (4, 3, 2) if d == 3 else (4, 2))
    floor = make("floor", (4,) * d, (*(0.2,) * (d - 1), -2.0), 1.0)  # type: ignore[arg-type]
    wall = make("wall", (4,) * d, (-2.0, *(0.1,) * (d - 1)), 1.0)  # type: ignore[arg-type]
    gravity, push = np.zeros(d), np.zeros(d)
    gravity[-1], push[0] = -9.81, -25.0
    model = build_model(
        [block, floor, wall],
        supports=[Support("floor", HELD[d]), Support("wall", HELD[d])],
        gravity=lambda t: gravity,
        loads=[Force("block", tuple(push))],
    )
    slave = contact_surface(model, [("block", up + "-"), ("block", "x-")])
    master = contact_surface(model, [("floor", up + "+"), ("wall", "x+")])
    step = run(model, [SurfacePair(slave, master, 0.0, 0.01, rule)], 5, Theta(1e-3, law=Gap()), tol=1e-10)[-1]
    assert_allclose(step.state.v, 0, atol=1e-8)
    assert_allclose(step.contact_force_on(1), WEIGHT * np.array([*(0,) * (d - 1), -1.0]), atol=1e-5)
    assert_allclose(step.contact_force_on(2), push, atol=1e-5)
    if rule == "nodes":
        corner = np.abs(step.contacts.point[:, [0, -1]]).max(axis=1) < 1e-9
        assert corner.sum() == 2 * (1 if d == 2 else 4)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("rule", ["nodes", "mortar", "mortar-faces"])
def test_a_corner_of_one_body(rule: Any, d: int) -> None:
    """Floor and wall are one body's surface, the block's skin is the slave; both split at sharp edges: the corner has both contacts."""
    ends = np.array([[2.0, 0], [0, 0], [0, 2]])
    if d == 2:
        points, facets = ends, np.array([[0, 1], [1, 2]])
    else:  # the same from y = -1 to 1
        points = np.array([[x, y, z] for x, z in ends for y in (-1.0, 1.0)])
        facets = np.array([[0, 1, 3, 2], [2, 3, 5, 4]])
    corner = RigidBody("corner", 1.0, np.eye(1 if d == 2 else 3), np.zeros(d), points, {"inside": facets})
    size, centre = ((0.4, 0.2), (0.2, 0.1)) if d == 2 else ((0.4, 0.3, 0.2), (0.2, 0.0, 0.1))
    block = (rigid_rectangle if d == 2 else rigid_box)("block", size, centre, 10.0, (4, 2) if d == 2 else (4, 3, 2))
    gravity, push = np.zeros(d), np.zeros(d)
    gravity[-1], push[0] = -9.81, -25.0
    model = build_model(
        [block, corner],
        supports=[Support("corner", HELD[d])],
        gravity=lambda t: gravity,
        loads=[Force("block", tuple(push))],
    )
    skin = contact_surface(model, [("block", side) for side in block.surfaces])
    inside = contact_surface(model, [("corner", "inside")])
    slaves, masters = (split_at_sharp_edges(surface, model.reference) for surface in (skin, inside))
    assert len(slaves) == d and len(masters) == 2
    pairs = [SurfacePair(slave, master, 0.0, 0.01, rule) for slave in slaves for master in masters]
    step = run(model, pairs, 5, Theta(1e-3, law=Gap()), name="auto", tol=1e-10)[-1]
    assert_allclose(step.state.v, 0, atol=1e-7)
    assert_allclose(step.contact_force_on(1), push + 10 * gravity, atol=1e-5)
    normal = np.abs(step.contacts.frame[:, 0])
    assert_allclose(np.sort(normal, axis=1)[:, -1], 1.0)  # floor or wall, nothing between
    if rule == "nodes":
        on_edge = np.abs(step.contacts.point[:, [0, -1]]).max(axis=1) < 1e-6
        assert on_edge.sum() == 2 * (1 if d == 2 else 4)


def test_one_surface_for_all_bodies() -> None:
    """Every face of every body is slave and master of the one pair, never of its own body: each joint carries what stands on it."""
    names = ["one", "two", "three"]
    blocks = [rigid_rectangle(name, (0.4, 0.2), (0.5 + 0.03 * k, 0.1 + 0.2 * k), 10.0, (2, 1)) for k, name in enumerate(names)]
    plane = rigid_rectangle("plane", (1, 1), (0.5, -0.5), 1.0)
    model = build_model([*blocks, plane], supports=[Support("plane", HELD[2])], gravity=lambda t: (0, -9.81))
    skin = contact_surface(model, [(body.name, side) for body in model.bodies for side in ("x-", "x+", "y-", "y+")])
    step = run(model, [SurfacePair(skin, skin, 0.5, 0.01)], 5, Theta(1e-3, law=Gap()), name="auto", tol=1e-9)[-1]
    assert_allclose(step.state.v, 0, atol=1e-7)
    assert (step.contacts.bodies[:, 0] != step.contacts.bodies[:, 1]).all()
    for k in range(3):
        below = model.number["plane"] if k == 0 else k - 1
        joint = [(step.contacts.bodies == order).all(axis=1) for order in ([k, below], [below, k])]
        force = step.force_in_space[joint[0]].sum(axis=0) - step.force_in_space[joint[1]].sum(axis=0)
        assert_allclose(force, [0, (3 - k) * WEIGHT], atol=1e-5 * WEIGHT)
