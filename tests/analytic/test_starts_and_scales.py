"""Bodies that touch exactly as they begin, in units and sizes of all kinds, ladders and stacks at their limits, press fits; by statics."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from fcsim import (
    Everything,
    ExactContacts,
    Gap,
    Material,
    Simulation,
    SolverSettings,
    State,
    Step,
    Support,
    Theta,
    Witness,
    at_rest,
    build_model,
)
from fcsim.assembly.layout import DIRECTIONS
from fcsim.assembly.model import Model
from fcsim.contact_detection import Detection
from fcsim.contact_detection.friction import Friction
from fcsim.mesh import Body, RigidBody, brick, rigid_box, rigid_capsule, rigid_cylinder, rigid_sphere

G = 9.81
SLOW = pytest.mark.slow


def model_of(bodies: Sequence[Body | RigidBody], held: Sequence[str], gravity: Sequence[float] = (0, 0, -G)) -> Model:
    pull = np.array(gravity, float)
    return build_model(list(bodies), supports=[Support(name, DIRECTIONS[3]) for name in held], gravity=lambda t: pull, beta=1e-3)


def simulate(
    model: Model,
    steps: int,
    h: float,
    mu: Friction = 0.5,
    velocities: dict[str, Sequence[float]] | None = None,
    detection: Detection | None = None,
) -> Step:
    """The last step; the witness bears 1e-4 of a body."""
    start = at_rest(model)
    v = start.v.copy()
    for name, velocity in (velocities or {}).items():
        first = model.dof_offset[model.number[name]]
        v[first : first + 6] = velocity
    settings, witness = SolverSettings(name="auto", tol=1e-8), Witness(every=1, tolerance=1e-4)
    run = Simulation(
        model, detection or Everything(model, mu), Theta(h, 0.5, Gap()), steps, settings, State(0.0, start.x, v), witness=witness
    )
    *_, last = run
    return last


def turned(body: RigidBody, rotation: Rotation, low: float = 0.0) -> RigidBody:
    """A body turned about the origin, its lowest point at the height `low`."""
    R = rotation.as_matrix()
    points, centre = body.points @ R.T, R @ body.centre
    lift = np.array([0, 0, low - points[:, 2].min()])
    return RigidBody(body.name, body.mass, R @ body.inertia @ R.T, centre + lift, points + lift, body.surfaces)


def velocity_of(step: Step, name: str) -> np.ndarray:
    first = step.model.dof_offset[step.model.number[name]]
    return step.state.v[first : first + 6]


@pytest.mark.parametrize(
    ("centre", "rests"),
    [
        ((0.25, 0.25, 0.5), True),
        ((0.5, 0.0, 0.5), True),  # its centre over the edge
        ((0.25, 0.25, 0.5 + 1e-12), True),
        ((0.25, 0.25, 0.5 - 1e-12), True),
        ((1.0, 0.0, 0.5), False),  # edge on edge, sides flush
        ((1.0, 1.0, 0.5), False),  # corner on corner
        ((1.0, 0.0, -0.5), False),  # side by side
        ((1.0 + 1e-12, 0.0, 0.5), False),
        ((1.0 - 1e-12, 0.0, 0.5), False),
    ],
)
def test_a_cube_that_touches_another_exactly(centre: tuple[float, float, float], rests: bool) -> None:
    """By a face it rests; by an edge or a corner, flush sides and what is 1e-12 more or less than that, nothing holds it."""
    model = model_of([rigid_box("low", (1, 1, 1), (0, 0, -0.5), 1.0), rigid_box("cube", (1, 1, 1), centre, 1e3)], ["low"])
    velocity = velocity_of(simulate(model, 10, 2e-3), "cube")
    assert_allclose(velocity, [0, 0, 0.0 if rests else -G * 0.02, 0, 0, 0], atol=1e-6)


@pytest.mark.parametrize(
    ("unit", "density", "gravity"),
    [
        pytest.param(1e3, 2e-9, G * 1e3, marks=SLOW),  # mm, t, s
        pytest.param(1e6, 2e-15, G * 1e6, marks=SLOW),  # um
        pytest.param(1e-3, 2e3, G * 1e-3, marks=SLOW),
        pytest.param(1e3, 2e3, G * 1e3, marks=SLOW),
    ],
)
def test_a_block_dropped_askew_in_all_units(unit: float, density: float, gravity: float) -> None:
    box = rigid_box("box", np.array([0.2, 0.1, 0.15]) * unit, (0, 0, 0), 3e-3 * unit**3 * density)
    box = turned(box, Rotation.from_euler("xyz", [0.2, 0.4, 0.1]), 0.01 * unit)
    floor = rigid_box("floor", np.array([4, 4, 0.2]) * unit, (0, 0, -0.1 * unit), 1.0)
    model = model_of([floor, box], ["floor"], (0, 0, -gravity))
    last = simulate(model, 300, 2e-3, velocities={"box": [0.5 * unit, 0, 0, 2, 3, 0]})
    assert_allclose(last.contact_force_on(1) / (box.mass * gravity), [0, 0, 1], atol=1e-5)
    assert np.abs(velocity_of(last, "box")[:3]).max() < 1e-6 * unit


def test_a_block_of_a_millimetre_on_one_of_a_kilometre_and_the_other_way_round() -> None:
    small = rigid_box("small", (1e-3,) * 3, (0.1, 0.2, 5e-4), 2e-6)
    last = simulate(model_of([rigid_box("big", (1e3,) * 3, (0, 0, -500), 1.0), small], ["big"]), 10, 1e-4)
    assert_allclose(last.contact_force_on(1), [0, 0, 2e-6 * G], atol=1e-6 * 2e-6 * G)
    feet = [rigid_box(f"foot {x} {y}", (1e-3,) * 3, (x, y, 5e-4), 1.0) for x in (-300, 300) for y in (-300, 300)]
    big = rigid_box("big", (1e3,) * 3, (0, 0, 500 + 1e-3), 2e12)
    last = simulate(model_of([big, *feet], [foot.name for foot in feet]), 10, 1e-3)
    assert_allclose(last.contact_force_on(0), [0, 0, 2e12 * G], atol=1e-6 * 2e12 * G)


@pytest.mark.parametrize(("degrees", "stands"), [(48.0, False), (50.0, True), pytest.param(65.0, True, marks=SLOW)])
def test_a_ladder_against_a_wall(degrees: float, stands: bool) -> None:
    """It stands from tan(angle) = (1 - mu_floor mu_wall) / (2 mu_floor) on: 49.0 degrees. (Thickness 2 mm of 3 m: 0.1 degrees at most.)"""
    ladder = turned(rigid_box("ladder", (0.002, 0.4, 3.0), (0, 0, 0), 10.0), Rotation.from_euler("y", 90 - degrees, degrees=True))
    wall = rigid_box("wall", (0.2, 4, 8), (ladder.points[:, 0].max() + 0.1, 0, 4), 1.0)
    model = model_of([rigid_box("floor", (10, 4, 0.2), (0, 0, -0.1), 1.0), wall, ladder], ["floor", "wall"])
    last = simulate(model, 40, 2e-3, {("ladder", "floor"): 0.4, ("ladder", "wall"): 0.2, ("*", "*"): 0.0})
    fastest = np.abs(velocity_of(last, "ladder")[:3]).max()
    assert fastest < 1e-6 if stands else fastest > 5e-3


@pytest.mark.parametrize("mu", [0.3, pytest.param(0.7, marks=SLOW)])
@pytest.mark.parametrize("share", [0.99, 1.01])
def test_a_stack_on_a_slope_at_its_angle_of_friction(mu: float, share: float) -> None:
    """Three blocks, tan(slope) = mu (1 -+ 1 %): at rest, or all sliding off together at g (sin - mu cos) t."""
    slope = np.arctan(mu * share)
    blocks = [rigid_box(f"block {k}", (0.4, 0.3, 0.1), (0, 0, 0.05 + 0.1 * k), 24.0) for k in range(3)]
    model = model_of([rigid_box("floor", (8, 4, 0.2), (0, 0, -0.1), 1.0), *blocks], ["floor"], (G * np.sin(slope), 0, -G * np.cos(slope)))
    last = simulate(model, 50, 2e-3, mu)
    exact = max(0.0, G * (np.sin(slope) - mu * np.cos(slope)) * 0.1)
    assert_allclose([velocity_of(last, block.name)[0] for block in blocks], exact, atol=1e-6 + 2e-4 * exact)


@pytest.mark.parametrize("spin", [pytest.param(0.0, marks=SLOW), 100.0])
@pytest.mark.parametrize("kind", ["sphere", pytest.param("cylinder", marks=SLOW), pytest.param("capsule", marks=SLOW)])
def test_round_bodies_roll_down_a_slope_of_facets(kind: str, spin: float) -> None:
    """v = v0 + g sin t / (1 + I / (m r^2)), turning by 0.2 rad a step over the edges of a meshed floor."""
    slope, r = np.radians(10.0), 0.1
    body = {
        "sphere": rigid_sphere("body", r, (-2, 0, r), 10.0),
        "cylinder": rigid_cylinder("body", r, 0.3, (-2, 0, r), 10.0, axis=(0, 1, 0)),
        "capsule": rigid_capsule("body", r, 0.3, (-2, 0, r), 10.0, axis=(0, 1, 0)),
    }[kind]
    floor = rigid_box("floor", (40, 4, 0.2), (0, 0, -0.1), 1.0, (31, 3, 1))
    model = model_of([body, floor], ["floor"], (G * np.sin(slope), 0, -G * np.cos(slope)))
    start = {"body": [spin * r, 0, 0, 0, spin, 0]}
    velocity = velocity_of(simulate(model, 50, 2e-3, velocities=start, detection=ExactContacts(model, 0.5)), "body")
    exact = spin * r + G * np.sin(slope) / (1 + body.inertia[1, 1] / (10.0 * r**2)) * 0.1
    assert_allclose(velocity, [exact, 0, 0, 0, exact / r, 0], atol=1e-5 * (1 + spin))


@pytest.mark.slow
def test_an_elastic_block_pressed_into_a_slot_that_is_too_narrow() -> None:
    """nu = 0, 0.4 % too wide: begins within both walls, which take that back at a tenth of its size a second, and bear E A (w - s) / w."""
    block = Body("block", brick("block", (0.1004, 0.1, 0.1), (4, 4, 4), Material(1e7, 0.0, 1000.0)), translation=np.array([-0.0502, 0, 0]))
    walls = [rigid_box(f"wall {side}", (0.1, 0.3, 0.3), (0.1 * side, 0.05, 0.05), 1.0) for side in (-1, 1)]
    model = model_of([block, *walls], ["wall -1", "wall 1"], (0, 0, 0))
    witness = Witness(initial="allow", stop=False)
    run = Simulation(
        model, Everything(model, 0.5), Theta(5e-3), 150, SolverSettings(name="auto", tol=1e-8), witness=witness, created=np.inf
    )
    *_, last = run
    assert_allclose(last.contact_force_on(1), [-1e7 * 0.01 * 0.0004 / 0.1004, 0, 0], atol=1e-2)


@pytest.mark.slow
def test_thin_plates_fall_on_each_other_askew() -> None:
    """1 : 200, at rates of a thickness a step and more: none passes another (the witness ends the run)."""
    rng = np.random.default_rng(0)
    plates = [
        turned(rigid_box(f"plate {k}", (1, 1, 0.005), (0, 0, 0), 2.0), Rotation.from_rotvec(0.2 * rng.normal(size=3)), 0.2 + 0.5 * k)
        for k in range(3)
    ]
    last = simulate(model_of([rigid_box("floor", (4, 4, 0.2), (0, 0, -0.1), 1.0), *plates], ["floor"]), 350, 2e-3, 0.4)
    assert last.ledger.created <= 1e-4 * last.ledger.supplied
