"""Plates on knife-edges: what bends bears all along what is sharp, wherever the knives lie between its nodes; beside the same in the plane,
where a knife is a corner, and beside a knife that has vertices enough of its own."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from fcsim import Body, Everything, Limits, Material, QuasiStatic, Simulation, Step, Support, Theta, Traction, at_rest, build_model
from fcsim.arrays import BoolArray, FloatArray
from fcsim.assembly.model import Model
from fcsim.mesh import RigidBody, brick, rectangle, rigid_box, rigid_polygon, rigid_polyhedron
from fcsim.mesh.solids.closed_surface import closed_surface, rigid_solid

ALL = ("x", "y", "z", "rx", "ry", "rz")
E, HEIGHT, PRESSURE = 70e9, 0.02, 1000.0
SECTION = np.array([(-0.05, -0.1), (0.05, -0.1), (0.0, 0.0)])


def knife(name: str, x: float, width: float = 0.05, y: float = 0.7) -> RigidBody:
    """Its edge at z = 0 along y, its sides falling by 0.1 over the width."""
    points = [(x + width / 0.05 * a, b, z) for b in (-y, y) for a, z in SECTION]
    return rigid_polyhedron(name, np.array(points), 1000.0)


def sag(model: Model, step: Step, x: float) -> float:
    """Mean way down [m] of the plate's nodes above x."""
    nodes = np.abs(model.reference[: model.node_offset[1], 0] - x) < 1e-9
    return float(-(model.positions(step.state.x) - model.reference)[: model.node_offset[1]][nodes, -1].mean())


def bent_in_space(cells: int, overhang: float, elements: str, turn: bool, width: float = 0.05) -> tuple[float, Step]:
    part = brick("plate", (1 + 2 * overhang, 1, HEIGHT), (cells, 3, 1), Material(E, 0.0, 7800.0), elements=elements)
    plate = Body("plate", part, translation=(-0.5 - overhang, -0.5, 0.0))
    knives = [knife("left", -0.5, width), knife("right", 0.5, width)]
    bodies = [*knives, plate] if turn else [plate, *knives]
    held = [Support(k.name, ALL) for k in knives]
    model = build_model(bodies, supports=held, loads=[Traction("plate", "z+", (0.0, 0.0, -PRESSURE))])
    *_, last = Simulation(model, Everything(model, 0.2), QuasiStatic(0.5, eta=200.0), 3)
    return sag(model, last, 0.0), last


def bent_in_the_plane(cells: int, overhang: float, elements: str, width: float = 0.05) -> float:
    part = rectangle("plate", (1 + 2 * overhang, HEIGHT), (cells, 1), Material(E, 0.0, 7800.0), plane="stress", elements=elements)
    section = SECTION * np.array([width / 0.05, 1.0])
    knives = [rigid_polygon(n, section + np.array([x, 0.0]), density=1000.0) for n, x in (("left", -0.5), ("right", 0.5))]
    held = [Support(k.name, ("x", "y", "rz")) for k in knives]
    plate = Body("plate", part, translation=(-0.5 - overhang, 0.0))
    model = build_model([plate, *knives], supports=held, loads=[Traction("plate", "y+", (0.0, -PRESSURE))])
    *_, last = Simulation(model, Everything(model, 0.2), QuasiStatic(0.5, eta=200.0), 3)
    return sag(model, last, 0.0)


@pytest.mark.parametrize(
    ("cells", "overhang", "elements"),
    [(14, 0.2, "Q1-enhanced"), (14, 0.05, "Q1-enhanced"), (10, 0.125, "Q2"), (6, 0.03, "Q2")],
    ids=["knives under nodes", "between nodes", "second order, under nodes", "second order, between nodes"],
)
@pytest.mark.parametrize("turn", [False, True], ids=["plate first", "knives first"])
def test_a_plate_on_two_knives_bends_as_in_the_plane(cells: int, overhang: float, elements: str, turn: bool) -> None:
    """Between its outer edges nothing held it: it sank on to the knives' middles, and sagged twice as far. With nodes on the knives
    nothing was found at all, until it had slid aside."""
    flat, (deep, last) = bent_in_the_plane(cells, overhang, elements), bent_in_space(cells, overhang, elements, turn)
    assert_allclose(deep, flat, rtol=5e-3)
    load = PRESSURE * (1 + 2 * overhang)
    assert_allclose(last.contact_force_on("plate"), [0.0, 0.0, load], atol=1e-3 * load)
    assert_allclose(last.contact_force_on("left")[2], -load / 2, rtol=1e-3)
    if elements == "Q2":  # Euler and Bernoulli, with what bends it over the knives
        beam = PRESSURE / (E * HEIGHT**3 / 12) * (5 / 384 - overhang**2 / 16)
        assert_allclose(deep, beam, rtol=0.03)


BEAM = 5 * PRESSURE / 384 / (E * HEIGHT**3 / 12)
"""Sag [m] of a beam on two supports with a span of 1 m, by Euler and Bernoulli."""


@pytest.mark.parametrize("beyond", [0.0, 1e-4, 1e-5, -1e-5])
@pytest.mark.parametrize("width", [0.03, 0.1, 0.2], ids=["steep", "45 degrees", "flat"])
def test_a_plate_that_ends_on_knives_does_not_lean_on_their_sides(width: float, beyond: float) -> None:
    """Its rim went down the inner sides by 1e-6 of a facet and was wedged between them: half of the sag, ten times the load as thrust."""
    assert_allclose(bent_in_the_plane(14, beyond, "Q1-enhanced", width), BEAM, rtol=0.03)


@pytest.mark.parametrize(("width", "beyond", "turn"), [(0.03, 0.0, False), (0.05, 1e-4, True), (0.1, 0.0, True), (0.2, -1e-5, False)])
def test_nor_does_it_in_space(width: float, beyond: float, turn: bool) -> None:
    deep, last = bent_in_space(14, beyond, "Q1-enhanced", turn, width)
    assert_allclose(deep, BEAM, rtol=0.03)
    thrust, _, down = last.contact_force_on("left")
    assert abs(thrust) <= (0.2 + 1e-3) * abs(down)  # friction's, mu = 0.2, and of the normal, which turns by 9e-4 as the beam's end


@pytest.mark.parametrize("turn", [0.0, 0.7])
@pytest.mark.parametrize("beyond", [0.0, 1e-9, -1e-9, 0.01])
@pytest.mark.parametrize(("m", "slope"), [(1.0, 0.6), (1.0, 4.0), (1e3, 2.0)])
def test_a_rigid_plank_that_ends_on_smooth_knives_has_no_thrust(m: float, slope: float, beyond: float, turn: float) -> None:
    """Each bears half of its weight across it; on the sides of steep knives it leant with slope / 2 of its weight. Units: 1 / m metres."""
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[c, -s], [s, c]])
    section = m * np.array([(-0.1, -0.1 * slope), (0.1, -0.1 * slope), (0.0, 0.0)])
    half = m * (0.5 + beyond)
    outline = np.array([(-half, 0.0), (half, 0.0), (half, 0.1 * m), (-half, 0.1 * m)])
    knives = [rigid_polygon(n, (section + np.array([x * m, 0.0])) @ R.T, density=1000.0) for n, x in (("left", -0.5), ("right", 0.5))]
    plank = rigid_polygon("plank", outline @ R.T, density=2000.0 / m**2)
    held = [Support(k.name, ("x", "y", "rz")) for k in knives]
    model = build_model([*knives, plank], supports=held, gravity=tuple(R @ (0.0, -9.81 * m)))
    *_, last = Simulation(model, Everything(model, 0.0), Theta(1e-3), 5)
    weight = 2000.0 * (1.0 + 2 * beyond) * 0.1 * 9.81 * m
    for name in ("left", "right"):
        assert_allclose(R.T @ last.contact_force_on(name), [0.0, -weight / 2], atol=1e-6 * weight)


@pytest.mark.parametrize("sectors", [5, 6, 7])
def test_the_corners_of_walls_that_merely_meet_at_an_angle_are_not_held_by_tips(sectors: int) -> None:
    """Blocks around a common corner, turned: none lies over another, but those with a common face."""
    blocks = []
    for k in range(sectors):  # around the origin
        a = 2 * np.pi / sectors * np.array([k, k + 0.5, k + 1])
        blocks.append(rigid_polygon(f"{k}", np.array([(0.0, 0.0), *zip(np.cos(a), np.sin(a), strict=True)]), density=1000.0))
    model = build_model(blocks)
    pairs = {tuple(sorted(pair)) for pair in Everything(model, 0.5)(model.reference).bodies.tolist()}
    assert pairs == {tuple(sorted((k, (k + 1) % sectors))) for k in range(sectors)}


@pytest.mark.parametrize("off", [0.0, 1e-5, -1e-5])
@pytest.mark.parametrize("kind", ["elastic", "rigid"])
def test_a_plank_with_nodes_on_smooth_knives_lies_still(kind: str, off: float) -> None:
    """Nodes within a thousandth of a cell of a knife's edge leant on its side, by a force along x: of an elastic plank that ended the run
    with energy created."""
    knives = [knife("left", -0.25, 0.1), knife("right", 0.25, 0.1)]
    part = brick("plank", (1, 0.4, 0.05), (4, 2, 1), Material(1e8, 0.2, 1000.0), elements="Q1-enhanced")
    elastic = Body("plank", part, translation=(-0.5 + off, -0.2, 0.0))
    plank = elastic if kind == "elastic" else rigid_box("plank", (1, 0.4, 0.05), (off, 0.0, 0.025), 20.0, divisions=(4, 2, 1))
    model = build_model([*knives, plank], supports=[Support(k.name, ALL) for k in knives], gravity=(0, 0, -9.81), beta=1e-3)
    steps = list(Simulation(model, Everything(model, 0.0), Theta(1e-3, 1.0), 40))
    forces = np.array([step.contact_force_on("plank") for step in steps])
    weight = 20.0 * 9.81
    assert np.abs(forces[:, :2]).max() < 1e-5 * weight
    assert_allclose(forces[-20:, 2].mean(), weight, rtol=0.05)  # it swings


def test_a_divided_rigid_plank_that_falls_with_its_nodes_over_the_knives_is_held() -> None:
    """It went into them: the edges of its rim met the knives at their ends, which vertices were to hold."""
    knives = [knife("left", -0.25, 0.1), knife("right", 0.25, 0.1)]
    plank = rigid_box("plank", (1, 0.4, 0.05), (0.0, 0.0, 0.025 + 1e-3), 20.0, divisions=(4, 2, 1))
    model = build_model([*knives, plank], supports=[Support(k.name, ALL) for k in knives], gravity=(0, 0, -9.81))
    *_, last = Simulation(model, Everything(model, 0.0), Theta(2e-3), 40, initial=at_rest(model))
    dof = model.dof_offset[model.number["plank"]]
    assert_allclose(last.state.x[dof : dof + 3], [0.0, 0.0, -1e-3], atol=1e-6)


def wedge_with(vertices: int, tilt: float) -> RigidBody:
    """A blunt wedge, its edge down, above x = 3 mm, from y = -20 mm on over the block's rim, rising by the tilt."""
    section = np.array([(0.0, 0.0), (0.05, 0.03), (0.0, 0.1), (-0.05, 0.03)]) + np.array([0.003, 0.0])
    y = np.linspace(-0.02, 0.2, vertices)
    points = np.array([(x, b, z + np.tan(tilt) * (b - y[0])) for b in y for x, z in section])
    ends = [[0, 1, 2, 3], [len(points) - 4 + k for k in (3, 2, 1, 0)]]
    sides = [[4 * i + (k + 1) % 4, 4 * i + k, 4 * i + 4 + k, 4 * i + 4 + (k + 1) % 4] for i in range(vertices - 1) for k in range(4)]
    return rigid_solid(closed_surface("wedge", points, [*ends, *sides]), density=1000.0)


@pytest.mark.parametrize("tilt", [0.0, np.deg2rad(2.0)])
def test_a_wedge_of_two_vertices_presses_as_one_of_thirty(tilt: float) -> None:
    force = {}
    for vertices in (2, 30):
        part = brick("block", (0.2, 0.1, 0.1), (8, 4, 4), Material(1e7, 0.3, 1000.0), origin=(-0.1, -0.05, -0.1))
        wedge = wedge_with(vertices, tilt)
        held = [Support("block", ("x", "y", "z"), "z-"), Support("wedge", ("x", "y", "rx", "ry", "rz"))]
        model = build_model([Body("block", part), wedge], supports=[*held, Support("wedge", ("z",), displacement=lambda t: -0.006 * t)])
        *_, last = Simulation(model, Everything(model, 0.0), QuasiStatic(1 / 6), 6)
        force[vertices] = last.contact_force_on("wedge")
    assert_allclose(force[2], force[30], atol=0.02 * force[30][2])


def everywhere(x: FloatArray) -> BoolArray:
    return np.isfinite(x[0])


def bent_over(degrees: float, edge: float, push: float) -> tuple[float, Step]:
    """How far [m] a block's nodes are inside a wedge of such sides, its edge at x = edge from y = -20 mm on, that is pushed on to it."""
    part = brick("block", (0.2, 0.1, 0.1), (8, 4, 4), Material(1e7, 0.3, 1000.0), origin=(-0.1, -0.05, -0.1))
    slope = np.tan(np.deg2rad(degrees))
    section = np.array([(0.0, 0.0), (0.1, 0.1 * slope), (0.0, 0.15), (-0.1, 0.1 * slope)]) + np.array([edge, 0.0])
    wedge = rigid_polyhedron("wedge", np.array([(x, y, z) for y in (-0.02, 0.2) for x, z in section]), 1000.0)
    held = [Support("block", ("x", "y", "z"), "z-"), Support("wedge", ("x", "y", "rx", "ry", "rz"))]
    model = build_model([Body("block", part), wedge], supports=[*held, Support("wedge", ("z",), displacement=lambda t: -push * t)])
    unlimited = Limits(strain=np.inf, rotation=np.inf)
    *_, last = Simulation(model, Everything(model, 0.0), QuasiStatic(1 / 6), 6, limits=unlimited)
    x, _, z = model.positions(last.state.x)[(model.reference[:, 2] == 0.0) & (np.abs(model.reference[:, 1] - 0.01) < 0.03)].T
    return float((z - (slope * np.abs(x - edge) - push)).max()), last


def test_a_block_bent_over_a_flat_wedge_lies_on_its_sides() -> None:
    """Sides of 15 degrees make one smooth surface. Of a block across their edge, nodes one cell away were not held by either once it
    was bent by 5 degrees: they went in by 1.1 mm."""
    assert bent_over(15.0, 0.003, 0.015)[0] < 1e-5


@pytest.mark.parametrize(("degrees", "push"), [(3.0, 0.005), (15.0, 0.015), (30.0, 0.015)])
def test_a_block_bent_over_a_wedge_under_its_middle_is_not_pushed_aside(degrees: float, push: float) -> None:
    """Nodes on the edge, of its rim and within, leant on one side of it, or of themselves: by a hundredth of the force."""
    inside, last = bent_over(degrees, 0.0, push)
    force = last.contact_force_on("wedge")
    assert inside < 1e-5
    assert_allclose(force[0], 0.0, atol=1e-6 * force[2])


def test_an_edge_at_an_angle_to_the_cells_is_held_once_the_face_is_folded_beneath_it() -> None:
    """Where cells are folded by more than 6 degrees their edges bore nothing: a bar went in, one of 24 cells along its edge did not."""
    force = {}
    for cells in (1, 24):
        part = brick("block", (0.2, 0.1, 0.1), (8, 4, 4), Material(1e7, 0.3, 1000.0), elements="Q1-enhanced", origin=(-0.1, -0.05, -0.1))
        bar = brick("bar", (0.04, 0.16, 0.04), (2, cells, 2), Material(1e8, 0.3, 1000.0), elements="Q1-enhanced", origin=(0.0, -0.08, 0.0))
        turned = Rotation.from_euler("ZY", [37.0, 45.0], degrees=True).as_matrix()
        bodies = [Body("block", part), Body("bar", bar, rotation=turned, translation=(0.0, 0.0, 0.04 / np.sqrt(2.0)))]
        driven = [Support("bar", ("x", "y"), at=everywhere), Support("bar", ("z",), at=everywhere, displacement=lambda t: -0.004 * t)]
        model = build_model(bodies, supports=[Support("block", ("x", "y", "z"), "z-"), *driven])
        unlimited = Limits(strain=np.inf, rotation=np.inf)
        *_, last = Simulation(model, Everything(model, 0.0), QuasiStatic(0.2), 5, limits=unlimited)
        force[cells] = last.contact_force_on("bar")[2]
    assert 0.8 * force[24] < force[1] < force[24]  # it is held at fewer places


@pytest.mark.parametrize(("length", "mass"), [(1.0, 1.0), (1e3, 1e-3)], ids=["m, kg", "mm, t"])
def test_a_plate_on_three_knives_has_the_reactions_of_a_beam_of_two_spans(length: float, mass: float) -> None:
    """Clapeyron's equation of three moments: M_0 = -q a^2 / 2 over the outer knives, 4 M_1 + 2 M_0 = -q l^2 / 2 over the inner one."""
    a, span, stress = 0.05, 0.5, mass / length  # lengths as shares of the unit
    part = brick(
        "plate",
        (length * (1 + 2 * a), 0.4 * length, HEIGHT * length),
        (13, 3, 1),
        Material(E * stress, 0.0, 7800.0 * mass / length**3),
        elements="Q1-enhanced",
    )
    plate = Body("plate", part, translation=(-(span + a) * length, -0.2 * length, 0.0))
    knives = [
        rigid_polyhedron(n, length * np.array([(x + s, y, z) for y in (-0.7, 0.7) for s, z in SECTION]), 1000.0 * mass / length**3)
        for n, x in (("left", -span), ("middle", 0.0), ("right", span))
    ]
    held = [Support(k.name, ALL) for k in knives]
    model = build_model([plate, *knives], supports=held, loads=[Traction("plate", "z+", (0.0, 0.0, -PRESSURE * stress))])
    *_, last = Simulation(model, Everything(model, 0.2), QuasiStatic(0.5, eta=200.0), 3)
    outer = -(a**2) / 2
    inner = -(span**2) / 8 - outer / 2
    side = a + span / 2 + (inner - outer) / span
    share = np.array([-last.contact_force_on(k.name)[2] for k in knives]) / (PRESSURE * stress * 0.4 * length**2)
    assert_allclose(share, [side, 1 + 2 * a - 2 * side, side], rtol=0.01)
