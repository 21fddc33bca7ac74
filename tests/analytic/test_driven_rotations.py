"""Driven rotations: a spun body's moments, a shaft of several turns, a tilting table, a turning drum. Closed forms in each test."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import DrivenRotation, Support
from fcsim.contact_detection import Detector, Everything, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.errors import InputError
from fcsim.mesh.blocks import brick, rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.material import Material, neo_hooke
from fcsim.mesh.part import Body, RigidBody
from fcsim.mesh.rigid import rigid_body
from fcsim.running.sensors import support_force, support_moment
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.generalised_alpha import GeneralisedAlpha
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State, at_rest
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta

AXIS = np.array([1.0, 2.0, -0.5]) / np.linalg.norm([1.0, 2.0, -0.5])


def steps(model: Model, scheme: Any, count: int) -> list[Step]:
    return list(Simulation(model, Everything(model, 0.3), scheme, count, witness=None))


@pytest.mark.parametrize("scheme", [Theta(4e-3), pytest.param(Theta(4e-3, 1.0), marks=pytest.mark.slow), GeneralisedAlpha(4e-3, 0.8)])
def test_a_body_spun_about_an_odd_axis(scheme: Any) -> None:
    """A box, its centre off the axis, turned by 3 t + t^2 / 2: it stands where the angle says; the support's force is m (a + g), its moment
    about the centre J omega' + omega x J omega; the power it supplies is what the kinetic energy and the weight take."""
    m, point = 2.0, np.array([0.0, 0.1, 0.0])
    box = rigid_box("b", (0.1, 0.3, 0.5), (0.2, 0.1, 0.0), m)
    turn = DrivenRotation("b", lambda t: 3 * t + 0.5 * t**2, (0.0, 0.1, 0.0), tuple(AXIS))
    model = build_model([box], supports=[turn], gravity=lambda t: np.array([0, 0, -9.81]))
    found = steps(model, scheme, 100)
    last = found[-1]

    def rotation(t: float) -> np.ndarray:
        return Rotation.from_rotvec(AXIS * (3 * t + 0.5 * t**2)).as_matrix()

    t = last.state.t
    assert_allclose(last.state.x[:3], (rotation(t) - np.eye(3)) @ (box.centre - point), atol=1e-13)
    assert_allclose(model.rigid_rotation(last.state.x)[0], rotation(t), atol=1e-13)
    assert_allclose(last.state.v, [*np.cross(AXIS * (3 + t), rotation(t) @ (box.centre - point)), *(AXIS * (3 + t))], rtol=1e-8, atol=1e-8)
    t -= 0.5 * scheme.h  # an impulse is the mean over the step
    R, omega = rotation(t), AXIS * (3 + t)
    J, arm = R @ box.inertia @ R.T, R @ (box.centre - point)
    acceleration = np.cross(AXIS, arm) + np.cross(omega, np.cross(omega, arm))
    scale = m * np.linalg.norm(acceleration)
    assert_allclose(last.support_impulse[:3] / scheme.h, m * (acceleration + np.array([0, 0, 9.81])), atol=5e-3 * scale)
    moment = J @ AXIS + np.cross(omega, J @ omega)
    assert_allclose(last.support_impulse[3:] / scheme.h, moment, atol=5e-3 * np.linalg.norm(moment))
    supplied = sum(step.energy.support_work for step in found)
    kinetic = [0.5 * m * np.linalg.norm(v[:3]) ** 2 + 0.5 * v[3:] @ (S @ box.inertia @ S.T) @ v[3:] for v, S in ends(found, model)]
    lifted = -sum(step.energy.load_work for step in found)
    assert_allclose(lifted, m * 9.81 * last.state.x[2], rtol=1e-3 if scheme != Theta(4e-3, 1.0) else 0.05)
    numerical = sum(step.energy.numerical_dissipation for step in found)
    assert_allclose(supplied, kinetic[1] - kinetic[0] + lifted + numerical, atol=2e-3 * kinetic[1])
    assert max(abs(step.energy.residual) for step in found) < 1e-13


def ends(found: list[Step], model: Model) -> list[tuple[np.ndarray, np.ndarray]]:
    return [(state.v, model.rigid_rotation(state.x)[0]) for state in (found[0].previous, found[-1].state)]


def smooth(turns: float, time: float) -> Any:
    """An angle that begins and ends at rest."""
    return lambda t: 2 * np.pi * turns * (min(t, time) / time - np.sin(2 * np.pi * min(t, time) / time) / (2 * np.pi))


@pytest.mark.parametrize(("d", "scheme"), [(2, Theta(2e-3)), (3, Theta(2e-3, 0.7)), (3, QuasiStatic(4e-3))])
def test_a_shaft_turned_by_its_end_makes_a_turn(d: int, scheme: Any) -> None:
    """A stiff shaft, one face turned once about an axis out of its middle: it ends where it began and hardly strained, each step's energy
    is balanced, its face stands where the angle says, and at rest nothing is needed to hold it."""
    material = Material(2e9, 0.3, 2000.0)
    part = brick("s", (0.3, 0.1, 0.1), (3, 1, 1), material) if d == 3 else rectangle("s", (0.3, 0.1), (3, 1), material)
    angle, point = smooth(1.0, 0.4), (0.0, 0.02, 0.03)[:d]
    turn = DrivenRotation("s", angle, point, (2.0, 0.0, 0.0) if d == 3 else None, surface="x-")
    model = build_model([Body("s", part)], supports=[turn], beta=2e-4)
    assert model.elastic.turning
    static = isinstance(scheme, QuasiStatic)
    found = steps(model, scheme, 110 if static else 220)
    face = np.unique(model.facets("s", "x-"))
    for step in found[:: len(found) // 7]:
        a = angle(step.state.t)
        R = Rotation.from_rotvec([a, 0, 0]).as_matrix() if d == 3 else np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
        assert_allclose(model.positions(step.state.x)[face], (model.reference[face] - point) @ R.T + point, atol=1e-12)
    exchanged = sum(abs(step.energy.support_work) for step in found)
    scale = 2e9 * 0.1**d if static else exchanged  # in statics nothing is exchanged
    assert max(abs(step.energy.residual) for step in found) < 1e-8 * scale
    last = found[-1]
    assert_allclose(last.state.x, 0, atol=1e-6 if static else 2e-4)
    force = support_force("F", model, "s", "y", "x-")
    moment = support_moment("M", model, "s", "rx" if d == 3 else "rz", point)
    most = max(abs(moment.measure(step)) for step in found)
    assert abs(moment.measure(last)) < (2e9 * 0.1**3 * 1e-6 if static else 0.05 * most)
    assert abs(force.measure(last)) < 2e9 * 0.1**2 * 1e-6


@pytest.mark.parametrize("kind", ["rigid", "deformable"])
def test_a_block_slides_off_a_tilting_table_at_the_angle_of_friction(kind: str) -> None:
    """Turned slowly about an edge, mu = 0.4: at tan^-1 mu all contacts begin to slide, within three steps (0.05 degrees)."""
    mu, h, rate, size = 0.4, 1e-2, np.radians(1.8), 0.1
    limit, material = np.arctan(mu), Material(1e7, 0.2, 2000.0)
    table = Body("table", brick("table", (4 * size, 2 * size, 0.2 * size), (4, 2, 1), material))
    place = np.array([2.5, 0.8, 0.2]) * size
    block = Body("block", brick("block", (0.4 * size, 0.4 * size, 0.2 * size), (2, 2, 1), material), translation=place)
    before = limit - np.radians(0.7)

    def angle(t: float) -> float:
        """Two smooth starts."""
        tilt = before * 0.5 * (1 - np.cos(np.pi * min(t, 1.0)))
        return float(tilt + (0.5 * rate * (t - 1) ** 2 / 0.3 if 1 < t < 1.3 else rate * max(t - 1.15, 0.0)))

    bodies = [table, block] if kind == "deformable" else [rigid_body(table), rigid_body(block)]
    turn = DrivenRotation("table", angle, (0, 0, 0), (0, -1, 0), surface="z-" if kind == "deformable" else None)
    model = build_model(bodies, supports=[turn], gravity=lambda t: np.array([0, 0, -9.81]), beta=1e-3)
    for step in Simulation(model, Everything(model, mu), Theta(h, 0.6), 170, SolverSettings(name="auto"), witness=None):
        pressed = step.result.r.reshape(-1, 3)[:, 0] > 0
        if step.state.t > 1.1 and np.linalg.norm(step.result.u.reshape(-1, 3)[pressed, 1:], axis=1).min() > 3e-5:
            break
    assert limit <= angle(step.state.t) < limit + 3 * rate * h
    on_block = step.contact_force_on(model.body_number("block"))
    weight = 0.4 * 0.4 * 0.2 * size**3 * 2000 * 9.81
    assert_allclose(on_block, [0, 0, weight], atol=0.01 * weight)


@pytest.mark.parametrize("scheme", [Theta(2e-3, 0.7), GeneralisedAlpha(2e-3, 0.9)])
def test_a_soft_shaft_of_finite_strain_is_spun_up(scheme: Any) -> None:
    """Neo-Hookean, with 80 rad/s^2: the balance of energy closes to what Newton's method leaves."""
    part = brick("s", (0.3, 0.1, 0.1), (3, 1, 1), neo_hooke(1e7, 0.3, 1000.0))
    turn = DrivenRotation("s", lambda t: 40 * t**2, (0.0, 0.02, 0.03), (1.0, 0.0, 0.0), surface="x-")
    model = build_model([Body("s", part)], supports=[turn], beta=1e-4)
    found = steps(model, scheme, 25)
    supplied = sum(step.energy.support_work for step in found)
    assert supplied > found[-1].energy.kinetic > 0.05
    assert max(abs(step.energy.residual) for step in found) < 1e-8 * supplied


def drum(radius: float, facets: int) -> RigidBody:
    """A ring, its inner side the surface "inside"."""
    at = 2 * np.pi * np.arange(facets) / facets
    points = radius * np.stack([np.cos(at), np.sin(at)], axis=1)
    inside = np.stack([(np.arange(facets) + 1) % facets, np.arange(facets)], axis=1)
    return RigidBody("drum", 5.0, np.array([[1.0]]), np.zeros(2), points, {"inside": inside})


def test_a_block_in_a_turning_drum_stays_at_the_angle_of_friction() -> None:
    """Two edges on the circle at angles -+ beta of its middle, its centre of mass at the distance a of the axis: the forces along and
    across it and the moment about the axis, mu R (N1 + N2) = W a sin phi, give
    tan phi = mu R / (a cos beta (1 + mu^2) - mu^2 R). Let go beside
    it, while the drum slides beneath, it swings about phi, and the drum's moment is W a sin phi on average."""
    R, mu, omega, width, height = 0.5, 0.5, 1.0, 0.12, 0.06
    beta = np.arcsin(0.5 * width / R)
    a = R * np.cos(beta) - 0.5 * height
    phi = np.arctan(mu * R / (a * np.cos(beta) * (1 + mu**2) - mu**2 * R))
    block = rigid_rectangle("block", (width, height), (0.0, -a), 1.0)
    turn = DrivenRotation("drum", lambda t: omega * t, (0.0, 0.0))
    model = build_model([drum(R, 720), block], supports=[turn], gravity=lambda t: np.array([0.0, -9.81]))
    pair = SurfacePair(contact_surface(model, [("block", "y-")]), contact_surface(model, [("drum", "inside")]), mu, 0.01, "nodes")
    moment = support_moment("M", model, "drum", "rz", (0.0, 0.0))
    first = model.dof_offset[model.body_number("block")]
    start = at_rest(model, h=5e-3)
    begin = phi - 0.05
    start.x[first : first + 3] = a * np.sin(begin), a - a * np.cos(begin), begin
    places, moments = [], []
    for step in Simulation(model, Detector([pair], model.n_nodes), Theta(5e-3), 290, initial=start, witness=None):
        x, y = step.state.x[first : first + 2] - [0, a]
        places.append(np.arctan2(x, -y))
        moments.append(moment.measure(step))
    assert_allclose(0.5 * (max(places) + min(places)), phi, atol=2e-3)
    assert max(places) - min(places) > 0.09
    assert_allclose(np.mean(moments), 9.81 * a * np.sin(phi), rtol=0.02)


def test_a_resumed_run_turns_on(tmp_path: Any) -> None:
    """From the end of a step the same steps follow, bit by bit."""
    part = brick("s", (0.4, 0.1, 0.1), (2, 1, 1), Material(2e9, 0.3, 2000.0))
    turn = DrivenRotation("s", lambda t: 5.0 * t**2, (0.0, 0.02, 0.03), (1.0, 0.0, 0.0), surface="x-")
    model = build_model([Body("s", part)], supports=[turn])
    simulation = Simulation(model, Everything(model, 0.3), Theta(2e-3), 30)
    whole = list(simulation)
    rest = list(simulation.run(whole[9].moment, whole[9].anchor))
    assert np.array_equal(rest[-1].state.x, whole[-1].state.x) and np.array_equal(rest[-1].state.v, whole[-1].state.v)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"angle": 1.0}, "driven rotation of body 'b': expected functions of time for the angle and its rate, got 1.0 and None"),
        ({"axis": None}, "driven rotation of body 'b', axis: expected 3 finite numbers, got None"),
        ({"axis": (0, 0, 0)}, "axis: expected a direction"),
        ({"point": (0, 0)}, "point: expected 3 finite numbers"),
        ({"surface": "z-"}, "driven rotation of body 'b': expected no surface"),
        ({"body": "c"}, "body 'c': expected one of 'b'"),
        ({"angle": lambda t: np.nan}, "expected an angle that is a finite number, got nan"),
        ({"angle": lambda t: 0.1 + t}, "expected the angle 0 in the reference configuration, got 0.1 rad at t = 0 s"),
        ({"rate": lambda t: "fast"}, "expected an angular velocity that is a finite number, got 'fast'"),
    ],
)
def test_driven_rotations_that_are_none_are_refused(change: dict[str, Any], message: str) -> None:
    given = {"body": "b", "angle": lambda t: t, "point": (0, 0, 0), "axis": (0, 0, 1)} | change
    with pytest.raises(InputError, match=message):
        at_rest(build_model([rigid_box("b", (1, 1, 1), (0, 0, 0), 1.0)], supports=[DrivenRotation(**given)]))


def test_what_contradicts_a_driven_rotation_is_refused() -> None:
    """A support that holds what is turned; an initial state that is elsewhere."""
    box = rigid_box("b", (1, 1, 1), (0, 0, 0), 1.0)
    turn = DrivenRotation("b", lambda t: 2 * t, (1, 0, 0), (0, 0, 1))
    with pytest.raises(InputError, match="supports 0, 1 of body 'b': expected the same motion where they hold one node"):
        build_model([box], supports=[turn, Support("b", ("y",))])
    build_model([box], supports=[turn, Support("b", ("z", "rx", "ry"))])  # these agree
    model = build_model([box], supports=[turn])
    with pytest.raises(InputError, match="initial state: expected what driven rotations turn where their angles at t = 1 s say"):
        Simulation(model, Everything(model, 0.3), Theta(1e-3), 1, initial=State(1.0, np.zeros(6), np.zeros(6)))
    with pytest.raises(InputError, match=r"axis: expected None in 2D"):
        square = rigid_rectangle("b", (1, 1), (0, 0), 1.0)
        build_model([square], supports=[DrivenRotation("b", lambda t: t, (0, 0), (0, 0, 1))])
