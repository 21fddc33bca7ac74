"""Spheres that fly by up to a hundred radii a step meet what is on their way: thin plates, small spheres, a third one behind the second."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from fcsim import Everything, ExactContacts, Gap, Simulation, SolverSettings, State, Step, Support, Theta, Witness, at_rest, build_model
from fcsim.assembly.layout import DIRECTIONS
from fcsim.mesh import RigidBody, rigid_box, rigid_sphere

H = 1e-3


def flown(bodies: Sequence[RigidBody], held: Sequence[str], velocities: dict[str, Sequence[float]], steps: int) -> list[Step]:
    """The steps of a flight without gravity; ends where the witness sees an overlap of more than 1e-4 of a body."""
    model = build_model(list(bodies), supports=[Support(name, DIRECTIONS[3]) for name in held])
    start = at_rest(model)
    v = start.v.copy()
    for name, velocity in velocities.items():
        first = model.dof_offset[model.number[name]]
        v[first : first + 3] = velocity
    settings, witness = SolverSettings(name="auto", tol=1e-9), Witness(every=1, tolerance=1e-4)
    detection = ExactContacts(model, 0.3)
    assert not isinstance(detection, Everything)  # no look ahead that is always on
    return list(Simulation(model, detection, Theta(H, 0.5, Gap()), steps, settings, State(0.0, start.x, v), witness=witness))


def place(step: Step, body: int) -> np.ndarray:
    first = step.model.dof_offset[body]
    return step.model.bodies[body].centre + step.state.x[first : first + 3]


SPEEDS = [
    0.7,
    pytest.param(3.0, marks=pytest.mark.slow),
    pytest.param(10.0, marks=pytest.mark.slow),
    31.0,
    pytest.param(100.0, marks=pytest.mark.slow),
]
"""Radii a step."""


@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("off", [0.0, 0.37])
def test_a_plate_a_fiftieth_of_a_radius_thick_stops_a_sphere(speed: float, off: float) -> None:
    """Where the sphere stands at the beginning of the step in which it would pass must not matter."""
    radius, thickness = 0.005, 1e-4
    ball = rigid_sphere("ball", radius, (-(5 + off * speed) * radius, 0.01, 0.02), 1.0)
    plate = rigid_box("plate", (thickness, 1, 1), (0, 0, 0), 1.0)
    steps = flown([ball, plate], ["plate"], {"ball": [speed * radius / H, 0.3 * speed * radius / H, 0]}, int(10 / speed) + 3)
    assert place(steps[-1], 0)[0] == pytest.approx(-radius - thickness / 2, rel=1e-4)
    assert abs(steps[-1].state.v[0]) < 1e-9 * speed * radius / H


@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("beside", [0.0, 0.5])
def test_a_sphere_meets_one_of_a_tenth_of_its_radius(speed: float, beside: float) -> None:
    """Head on they go on together, at m1 / (m1 + m2); beside, the small one is thrown to its side; momentum is kept."""
    radius, small = 0.05, 0.005
    balls = [
        rigid_sphere("ball", radius, (-(3 + 0.37 * speed) * radius, 0, 0), 1.0),
        rigid_sphere("small", small, (0, beside * (radius + small), 0), 1e-3),
    ]
    fast = speed * radius / H
    last = flown(balls, [], {"ball": [fast, 0, 0]}, int(6 / speed) + 3)[-1]
    velocity = last.model.rigid_part(last.state.v)[:, :3] / fast
    np.testing.assert_allclose([1.0, 1e-3] @ velocity, [1.0, 0, 0], atol=1e-8)
    apart = np.linalg.norm(place(last, 1) - place(last, 0))
    if beside:
        assert velocity[1, 1] > 0.1 and apart > radius + small
    else:
        np.testing.assert_allclose(velocity[:, 0], 1 / 1.001, rtol=1e-6)
        assert place(last, 1)[0] > place(last, 0)[0] and apart == pytest.approx(radius + small, rel=1e-4)


@pytest.mark.parametrize("speed", [1.0, pytest.param(10.0, marks=pytest.mark.slow), 100.0])
def test_a_sphere_that_is_thrown_against_a_third_in_the_same_step(speed: float) -> None:
    """Three alike, inelastic: a third of the velocity each."""
    radius = 0.01
    balls = [rigid_sphere(f"ball {k}", radius, (x * radius, 0, 0), 1.0) for k, x in enumerate((0.0, 2 + 0.3 * speed, 4 + 0.6 * speed))]
    last = flown(balls, [], {"ball 0": [speed * radius / H, 0, 0]}, 6)[-1]
    np.testing.assert_allclose(last.model.rigid_part(last.state.v)[:, 0], speed * radius / H / 3, rtol=1e-6)


@pytest.mark.parametrize("speed", [1.0, 100.0])
def test_two_plates_hold_what_flies_askew_between_them(speed: float) -> None:
    radius = 0.01
    bodies = [rigid_sphere("ball", radius, (0, 0, 0), 1.0)]
    bodies += [rigid_box(f"plate {x}", (1e-3, 20, 1), (x * radius, 0, 0), 1.0) for x in (-3, 3)]
    steps = flown(bodies, ["plate -3", "plate 3"], {"ball": [0.6 * speed * radius / H, 0.5 * speed * radius / H, 0]}, 6)
    assert place(steps[-1], 0)[0] <= 3 * radius - 5e-4 - radius * (1 - 1e-6)


@pytest.mark.parametrize("turn", [pytest.param(0.02, marks=pytest.mark.slow), 0.15, pytest.param(0.5, marks=pytest.mark.slow)])
def test_a_ball_rolls_over_the_edges_of_facets_without_a_kick(turn: float) -> None:
    """It turns by up to half a radian a step over a floor of triangles. The point that touches next is another one each time."""
    radius = 0.05
    ball = rigid_sphere("ball", radius, (-1.0, 0.013, radius), 1.0)
    floor = rigid_box("floor", (4.0, 1.0, 0.2), (0, 0, -0.1), 1.0, (7, 3, 1))
    model = build_model([ball, floor], supports=[Support("floor", DIRECTIONS[3])], gravity=lambda t: np.array([0, 0, -9.81]))
    start = at_rest(model)
    v = start.v.copy()
    first = model.dof_offset[model.number["ball"]]
    v[first : first + 6] = [turn * radius / H, 0, 0, 0, turn / H, 0]
    scheme, settings = Theta(H, 0.5, Gap()), SolverSettings(name="auto", tol=1e-10)
    simulation = Simulation(model, ExactContacts(model, 0.3), scheme, 40, settings, State(0.0, start.x, v), witness=None)
    for step in simulation:
        at = step.model.dof_offset[step.model.number["ball"]]
        assert abs(step.state.x[at + 2]) < 1e-6 * radius, step.number
    assert step.state.v[first] == pytest.approx(turn * radius / H, rel=1e-6)
