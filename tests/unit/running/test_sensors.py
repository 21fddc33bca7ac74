"""Sensors on a block that is pressed and dragged by a rigid platen: statics, and the same numbers from the step's own arrays."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, Everything, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.errors import InputError
from fcsim.mesh.blocks import brick, rectangle, rigid_box
from fcsim.mesh.material import Material, saint_venant_kirchhoff
from fcsim.mesh.part import Body
from fcsim.running.case import Sensor
from fcsim.running.sensors import contact_force, displacement, joint_opening, stress, support_force
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta

SOFT = Material(1e6, 0.3, 1000.0)
G, MASS = 9.81, 40.0


@pytest.fixture(scope="module")
def pressed() -> Simulation:
    """A block held at its base under a platen of 40 kg that is dragged along x; another block stands beside, nothing touches it."""
    block = brick("block", (0.4, 0.3, 0.2), (3, 2, 2), SOFT)
    platen = rigid_box("platen", (1.0, 1.0, 0.1), (0.2, 0.15, 0.25), MASS)
    beside = Body("beside", block, translation=np.array([0.4, 0.0, 0.0]))
    model = build_model(
        [Body("block", block), beside, platen],
        supports=[
            Support("block", ("x", "y", "z"), "z-"),
            Support("beside", ("x", "y"), "z-", velocity=lambda t: 0.1),
            Support("beside", ("z",), "z-"),
            Support("platen", ("x",), velocity=0.05),
            Support("platen", ("y", "rx", "ry", "rz")),
        ],
        gravity=lambda t: (0, 0, -G),
        beta=0.05,
    )
    pair = SurfacePair(contact_surface(model, [("block", "z+")]), contact_surface(model, [("platen", "z-")]), 0.3, 1e-2)
    return Simulation(model, Detector([pair], model.n_nodes), Theta(5e-3), 100)


@pytest.fixture(scope="module")
def last(pressed: Simulation) -> Step:
    return list(pressed)[-1]


def test_forces_are_statics(pressed: Simulation, last: Step) -> None:
    """Weights below, Coulomb's bound along, and nothing on the block's sides."""
    model = pressed.model
    weight = SOFT.density * 0.4 * 0.3 * 0.2 * G
    expected = {
        contact_force("a", model, "platen", "z"): MASS * G,
        contact_force("b", model, "block", "z"): -MASS * G,
        contact_force("c", model, "block", "z", "z+"): -MASS * G,
        contact_force("d", model, "block", "z", "z-"): 0.0,
        contact_force("e", model, "platen", "x", "z-"): -0.3 * MASS * G,
        contact_force("f", model, "beside", "x"): 0.0,
        support_force("g", model, "block", "z"): MASS * G + weight,
        support_force("h", model, "block", "z", "z-"): MASS * G + weight,
        support_force("i", model, "block", "x", "z-"): -0.3 * MASS * G,
        support_force("j", model, "platen", "x"): 0.3 * MASS * G,
        support_force("k", model, "platen", "z"): 0.0,
    }
    for sensor, value in expected.items():
        assert_allclose(sensor.measure(last), value, atol=0.01 * MASS * G, err_msg=sensor.label)
        assert sensor.unit == "N"
    assert last.contacts.bodies.shape[0] > 4


def test_a_moment_of_a_support(pressed: Simulation, last: Step) -> None:
    """What the contacts do about the platen's centre, its supports undo."""
    arm = last.contacts.point - (pressed.model.bodies[2].centre + last.state.x[-6:-3])  # type: ignore[union-attr]
    moment = np.cross(arm, -last.force_in_space).sum(axis=0)
    for direction, axis in (("rx", 0), ("ry", 1), ("rz", 2)):
        sensor = support_force("m", pressed.model, "platen", direction)
        assert sensor.unit == "N m"
        assert_allclose(sensor.measure(last), -moment[axis], atol=0.02 * MASS * G)


def test_displacements(pressed: Simulation, last: Step) -> None:
    model = pressed.model
    number = int(np.flatnonzero(np.all(np.isclose(model.reference, [0.4, 0.3, 0.2]), axis=1))[0])
    assert displacement("u", model, "block", "z", (0.4, 0.3, 0.2)).measure(last) == last.state.x[3 * number + 2]
    platen = displacement("u", model, "platen", "x", (0.7, 0.65, 0.2))
    assert_allclose(platen.measure(last), 0.05 * 0.5, rtol=1e-3)


def test_a_rigid_point_turns_with_its_body() -> None:
    bodies = [rigid_box("a", (1, 1, 1), (2, 0, 0), 1.0), rigid_box("far", (1, 1, 1), (99, 0, 0), 1.0)]
    model = build_model(bodies, supports=[Support("a", ("rz",), velocity=np.pi / 2), Support("far", ("x",))])
    pair = SurfacePair(contact_surface(model, [("a", "x+")]), contact_surface(model, [("far", "x-")]), 0.0, 1e-3)
    end = list(Simulation(model, Detector([pair], model.n_nodes), Theta(0.1), 10))[-1]
    moved = [displacement("u", model, "a", axis, (2.5, 0, 0)).measure(end) for axis in "xyz"]
    assert_allclose(moved, [-0.5, 0.5, 0], atol=1e-9)  # from (0.5, 0) to (0, 0.5) about the centre


def test_the_opening_of_a_joint(pressed: Simulation, last: Step) -> None:
    """The block beside is pulled away at 0.1 m/s for half a second; the platen goes down with the block."""
    model = pressed.model
    joint = joint_opening("o", model, ("block", "x+"), ("beside", "x-"))
    way = 0.1 * 0.5
    assert_allclose(joint.measure(last), way, atol=0.1 * way)
    assert_allclose(joint_opening("o", model, ("beside", "x-"), ("block", "x+")).measure(last), joint.measure(last), rtol=1e-12)
    assert abs(joint_opening("o", model, ("platen", "z-"), ("block", "z+")).measure(last)) < 5e-3


def test_a_joint_in_the_plane() -> None:
    part = rectangle("part", (1.0, 0.5), (4, 2), SOFT)
    upper = Body("upper", part, translation=np.array([0.5, 0.5]))
    lift = Support("upper", ("y",), velocity=0.2)
    model = build_model([Body("lower", part), upper], supports=[Support("lower", ("x", "y")), lift, Support("upper", ("x",))])
    pair = SurfacePair(contact_surface(model, [("upper", "y-")]), contact_surface(model, [("lower", "y+")]), 0.0, 1e-3)
    step = next(iter(Simulation(model, Detector([pair], model.n_nodes), Theta(0.1), 3)))
    for first, second in ((("lower", "y+"), ("upper", "y-")), (("upper", "y-"), ("lower", "y+"))):
        assert_allclose(joint_opening("o", model, first, second).measure(step), 0.2 * 0.1, rtol=1e-9)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda m: contact_force("a", m, "blok", "z"), "body 'blok': expected one of"),
        (lambda m: contact_force("a", m, "block", "rz"), "direction: expected one of x, y, z, got 'rz'"),
        (lambda m: contact_force("a", m, "block", "z", "top"), "body 'block': expected a surface among"),
        (lambda m: support_force("a", m, "platen", "z", "z-"), "expected no surface and a direction among x, y, z, rx"),
        (lambda m: support_force("a", m, "block", "rz"), "direction: expected one of x, y, z"),
        (lambda m: displacement("a", m, "block", "z", (0.4, 0.3)), "expected a point of 3 finite coordinates"),
        (
            lambda m: displacement("a", m, "block", "z", (0.41, 0.3, 0.2)),
            r"expected a point at a node.* nearest is at \(0\.4, 0\.3, 0\.2\)",
        ),
        (lambda m: joint_opening("a", m, ("block", "x+"), ("beside", "front")), "body 'beside': expected a surface among"),
    ],
)
def test_refusals(pressed: Simulation, make: Callable[[object], Sensor], message: str) -> None:
    with pytest.raises(InputError, match=message):
        make(pressed.model)


@pytest.mark.parametrize("material", [Material(1e6, 0.0, 1000.0), saint_venant_kirchhoff(1e6, 0.0, 1000.0)])
def test_the_stress_of_a_body_that_has_turned_is_along_the_axes_of_the_world(material: Material) -> None:
    """A bar placed at 30 degrees, drawn by 1e-4 along itself and turned by 50 more: E 1e-4 a a^T, a at 80 degrees."""
    placed, turn = (np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) for a in np.radians([30.0, 50.0]))
    bar = Body("bar", rectangle("bar", (0.4, 0.1), (4, 1), material), rotation=placed)
    model = build_model([bar])
    drawn = bar.part.points * (1 + 1e-4, 1.0) @ (turn @ placed).T
    start = State(0.0, (drawn - bar.points).ravel(), np.zeros(model.n_dofs))
    (step,) = Simulation(model, Everything(model, mu=0.0), Theta(1e-9), 1, initial=start)
    along = turn @ placed @ (1.0, 0.0)
    expected = 1e6 * 1e-4 * np.outer(along, along)
    point = tuple(bar.points[0].tolist())
    found = [stress("s", model, "bar", component, point).measure(step) for component in ("xx", "yy", "xy")]
    assert_allclose(found, [expected[0, 0], expected[1, 1], expected[0, 1]], atol=5e-4 * 1e2)
