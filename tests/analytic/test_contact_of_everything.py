"""Bodies on each other without any list of pairs, against statics: what was missed or held by side faces must rest or fall as it should."""

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Everything
from fcsim.mesh.blocks import brick, rigid_box
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, RigidBody
from fcsim.timestep.simulation import Simulation, SolverSettings, Step
from fcsim.timestep.state import State, at_rest
from fcsim.timestep.theta import Theta

G = 9.81
HELD = ("x", "y", "z", "rx", "ry", "rz")


def turned(name: str, size: Sequence[float], centre: Sequence[float], mass: float, rotation: Rotation) -> RigidBody:
    """A rigid box turned about its centre."""
    box, R = rigid_box(name, size, (0, 0, 0), mass), rotation.as_matrix()
    return RigidBody(name, mass, R @ box.inertia @ R.T, np.array(centre, float), box.points @ R.T + np.array(centre), box.surfaces)


def held_by_a_floor(bodies: Sequence[Body | RigidBody], held: Sequence[str], beta: float = 0.0) -> Model:
    return build_model(bodies, supports=[Support(name, HELD) for name in held], gravity=lambda t: (0, 0, -G), beta=beta)


def simulate(model: Model, steps: int, h: float = 1e-3, mu: float = 0.6, initial: State | None = None) -> list[Step]:
    return list(Simulation(model, Everything(model, mu), Theta(h), steps, SolverSettings(name="auto", tol=1e-9), initial))


def own_dofs(model: Model, name: str) -> slice:
    first = model.dof_offset[model.number[name]]
    return slice(first, first + 6)


@pytest.mark.parametrize("degrees", [0.0, 1e-9, 1e-6, 1e-5, 1e-4, 1e-3, 0.1, 7.0, 30.0, 44.999, 45.0, 60.0, 89.9999])
def test_a_cube_rests_on_an_equal_one_at_every_angle(degrees: float) -> None:
    """No vertex of either face is inside the other (but at 0); the octagon they share has eight corners where edges cross."""
    cube = turned("cube", (1, 1, 1), (0, 0, 0.5), 1000.0, Rotation.from_euler("z", degrees, degrees=True))
    model = held_by_a_floor([rigid_box("floor", (1, 1, 1), (0, 0, -0.5), 1.0), cube], ["floor"])
    last = simulate(model, 10)[-1]
    assert_allclose(last.contact_force_on(model.number["cube"]), [0, 0, 1000 * G], atol=1e-6 * 1000 * G)
    assert np.abs(last.state.v).max() < 1e-9
    assert len(last.contacts) == (4 if degrees < 2e-6 else 8)
    assert_allclose(np.abs(last.contacts.frame[:, 0, 2]), 1.0)


@pytest.mark.parametrize("shift", [0.1, 0.2, 0.3, 0.4, 0.45])
def test_a_shifted_cube_rests(shift: float) -> None:
    model = held_by_a_floor(
        [rigid_box("floor", (1, 1, 1), (0, 0, -0.5), 1.0), rigid_box("cube", (1, 1, 1), (shift, 0, 0.5), 1e3)], ["floor"]
    )
    last = simulate(model, 10, h=5e-3)[-1]
    assert_allclose(last.contact_force_on(model.number["cube"]), [0, 0, 1000 * G], atol=1e-6 * 1000 * G)
    assert np.abs(last.state.v).max() < 1e-9
    on_cube = np.where(last.contacts.bodies[:, 0] == model.number["cube"], 1.0, -1.0)
    weight = on_cube * last.force_in_space[:, 2]
    assert_allclose(weight @ last.contacts.point[:, 0] / weight.sum(), shift, atol=1e-6)  # under the centre of mass


@pytest.mark.parametrize("shift", [0.55, 0.6, 0.7, 0.8, 0.9])
def test_a_cube_shifted_over_the_edge_topples(shift: float) -> None:
    """About the edge: alpha = m g a / (m/6 + m (a^2 + 1/4)), a the centre's distance from it; mu = 0.6 holds the foot at the beginning."""
    model = held_by_a_floor(
        [rigid_box("floor", (1, 1, 1), (0, 0, -0.5), 1.0), rigid_box("cube", (1, 1, 1), (shift, 0, 0.5), 1e3)], ["floor"]
    )
    steps = simulate(model, 20)
    arm = shift - 0.5
    alpha = G * arm / (1 / 6 + arm**2 + 0.25)
    velocity = steps[-1].state.v[own_dofs(model, "cube")]
    assert_allclose(velocity[4], alpha * 0.02, rtol=0.02)
    assert_allclose(velocity[[1, 3, 5]], 0, atol=1e-7)
    assert_allclose(velocity[[0, 2]], alpha * 0.02 * np.array([0.5, -arm]), rtol=0.03)


@pytest.mark.parametrize("degrees", [90.0, 60.0, 30.0, 10.0])
def test_a_bar_balances_on_the_edge_of_another(degrees: float) -> None:
    """Two bars stand on an edge each and cross: one point holds one on the other."""
    on_edge, height = Rotation.from_euler("x", 45, degrees=True), 0.1 * np.sqrt(2)
    lower = turned("lower", (1, 0.2, 0.2), (0, 0, -height), 1.0, on_edge)
    upper = turned("upper", (1, 0.2, 0.2), (0, 0, height), 10.0, Rotation.from_euler("z", degrees, degrees=True) * on_edge)
    model = held_by_a_floor([lower, upper], ["lower"])
    last = simulate(model, 20)[-1]
    assert len(last.contacts) == 1
    assert_allclose(last.contacts.frame[0, 0], [0, 0, np.sign(last.contacts.frame[0, 0, 2])], atol=1e-9)
    assert_allclose(last.contacts.point[0], 0, atol=1e-9)
    assert_allclose(last.contact_force_on(model.number["upper"]), [0, 0, 10 * G], atol=1e-5)
    assert np.abs(last.state.v).max() < 1e-8


def test_planks_laid_crosswise_rest() -> None:
    """Six courses of two planks: no vertex of one course is over a face of the next."""
    bodies = [rigid_box("floor", (3, 3, 0.1), (0, 0, -0.05), 1.0)]
    for course in range(6):
        size = (2, 0.1, 0.05) if course % 2 else (0.1, 2, 0.05)
        for side in (-0.8, 0.8):
            centre = (0, side, 0.025 + 0.05 * course) if course % 2 else (side, 0, 0.025 + 0.05 * course)
            bodies.append(rigid_box(f"plank {course} {side}", size, centre, 10.0))
    model = held_by_a_floor(bodies, ["floor"])
    last = simulate(model, 5)[-1]
    assert len(last.contacts) == 2 * 4 + 5 * 4 * 4
    assert_allclose(last.contact_force_on(model.number["floor"]), [0, 0, -120 * G], atol=1e-6 * 120 * G)
    assert np.abs(last.state.v).max() < 1e-8


@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_thin_plates_stand_on_each_other(unit: float) -> None:
    """Aspect 100, each a little aside: the middle between the outer faces of two neighbours is on the faces by which they touch, where they
    were taken to overlap by both their thicknesses. Four corners for every two faces that overlap, and statics."""
    plates = [
        rigid_box(f"plate {k}", (unit, unit, unit / 100), (0.03 * k * unit, 0.02 * k * unit, (k + 0.5) * unit / 100), 1.0) for k in range(5)
    ]
    floor = rigid_box("floor", (4 * unit, 4 * unit, unit), (0, 0, -unit / 2), 1.0)
    model = held_by_a_floor([floor, *plates], ["floor"])
    last = simulate(model, 5)[-1]
    assert len(last.contacts) == 5 * 4
    assert_allclose(last.contact_force_on(model.number["floor"]), [0, 0, -5 * G], atol=1e-6 * 5 * G)
    assert np.abs(model.node_velocity(last.state.v, last.state.x)).max() < 1e-10  # [m/s] of corners, not of rotations


@pytest.mark.each_value
@pytest.mark.parametrize("bearing", [0.02, 0.05, 0.08, 0.15])
@pytest.mark.parametrize("kind", ["rigid", "deformable"])
def test_a_lintel_on_two_piers(kind: str, bearing: float) -> None:
    """Statics: the piers carry the weight, each a share that follows from where in the bearings it acts; half each of the one that bends.

    Its corners are `bearing` inside the side planes of the piers: no side face may be touched.
    """
    size, weight = (1.0, 0.2, 0.2), 0.04 * 2000 * G
    piers = [rigid_box(f"pier {x}", (0.4, 0.2, 0.5), (x, 0.1, -0.25), 1.0) for x in (bearing - 0.2, 1.2 - bearing)]
    part = brick("lintel", size, (20, 4, 4), Material(3e10, 0.2, 2000.0))
    lintel = Body("lintel", part) if kind == "deformable" else rigid_box("lintel", size, (0.5, 0.1, 0.1), 80.0, (20, 4, 4))
    names = [pier.name for pier in piers]
    model = held_by_a_floor([*piers, lintel], names, beta=0.0 if kind == "rigid" else 1e-3)
    last = simulate(model, 40)[-1]
    assert_allclose(np.abs(last.contacts.frame[:, 0, 2]), 1.0, atol=1e-4)
    forces = np.array([-last.contact_force_on(model.number[name]) for name in names])
    settled = 1e-6 if kind == "rigid" else 5e-3
    assert_allclose(forces.sum(axis=0), [0, 0, weight], atol=settled * weight)
    least = (0.5 - bearing) / (1.0 - bearing)
    assert np.all(forces[:, 2] >= (least - settled) * weight)
    if kind == "deformable":
        assert_allclose(forces[:, 2], weight / 2, rtol=settled)
    assert np.abs(last.state.v).max() < 1e-4
    assert np.abs(last.state.x).max() < 1e-5


def stacked(n: int) -> Model:
    """n x n x n unit cubes on a floor, every second course shifted by half a cube both ways."""
    cubes = [
        rigid_box(f"{k} {j} {i}", (1, 1, 1), (i + k % 2 / 2 - n / 2, j + k % 2 / 2 - n / 2, k + 0.5), 1000.0)
        for k in range(n)
        for j in range(n)
        for i in range(n)
    ]
    return held_by_a_floor([rigid_box("floor", (4 * n, 4 * n, 1), (0, 0, -0.5), 1.0), *cubes], ["floor"])


@pytest.mark.parametrize("n", [3, pytest.param(10, marks=pytest.mark.slow)])
def test_stacked_cubes_rest(n: int) -> None:
    model = stacked(n)
    for step in simulate(model, 3, mu=0.5):
        assert_allclose(step.contact_force_on(model.number["floor"]), [0, 0, -(n**3) * 1000 * G], atol=1e-6 * n**3 * 1000 * G)
        assert np.abs(step.state.v).max() < 1e-7
    level = np.abs(step.contacts.frame[:, 0, 2]) > 0.5
    beds, joints = 4 * (n**2 + (n - 1) * (2 * n - 1) ** 2), 4 * 2 * n**2 * (n - 1)
    assert (level.sum(), (~level).sum()) == (beds, joints)  # four corners for every two faces that overlap, none else


@pytest.mark.parametrize("aside", [pytest.param(0.0, marks=pytest.mark.slow), 0.05])
def test_a_box_slides_over_flush_tiles(aside: float) -> None:
    """Frictionless, over the joints of tiles whose tops are level: nothing may stop or lift it."""
    tiles = [rigid_box(f"tile {i} {j}", (0.3, 0.3, 0.1), (0.3 * i, 0.3 * j, -0.05), 1.0) for i in range(5) for j in range(2)]
    model = held_by_a_floor([*tiles, rigid_box("box", (0.2, 0.2, 0.2), (0, 0.1, 0.1), 10.0)], [tile.name for tile in tiles])
    own = own_dofs(model, "box")
    initial = at_rest(model)
    initial.v[own] = [1.0, aside, 0, 0, 0, 0]
    last = simulate(model, 200, h=5e-3, mu=0.0, initial=initial)[-1]
    assert_allclose(last.state.v[own], [1.0, aside, 0, 0, 0, 0], atol=1e-7)
    assert_allclose(last.state.x[own], [1.0, aside, 0, 0, 0, 0], atol=1e-7)


@pytest.mark.parametrize("speed", [5.0, 50.0])
def test_what_flies_faster_than_a_facet_a_step_is_stopped(speed: float) -> None:
    """A block of 10 cm against a plate of 2 cm, by half a metre a step: it comes to rest on the plate, where it meets it."""
    plate, block = rigid_box("plate", (1, 1, 0.02), (0, 0, -0.01), 1.0), rigid_box("block", (0.1, 0.1, 0.1), (0.013, 0.021, 0.5), 2.0)
    model = held_by_a_floor([plate, block], ["plate"])
    own = own_dofs(model, "block")
    initial = at_rest(model)
    initial.v[own.start + 2] = -speed
    steps = simulate(model, 20, h=1e-2, initial=initial)
    assert min(step.state.x[own.start + 2] for step in steps) > -0.45 - 1e-9
    assert_allclose(steps[-1].state.v[own], 0, atol=1e-8)
    assert_allclose(steps[-1].state.x[own.start + 2], -0.45, atol=1e-8)
