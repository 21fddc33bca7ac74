"""Capsules and cylinders of exact shape that swing fast, and strike a ball in the midst of a step: momentum and energy of the impact."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim import ExactContacts, Simulation, State, Support, Theta, Witness, at_rest, build_model
from fcsim.errors import Penetration
from fcsim.mesh import rigid_box, rigid_capsule, rigid_cylinder, rigid_sphere

OMEGA, R, BALL = 100.0, 0.4, 0.02  # [rad/s], [m] from the axis, [m] radius


@pytest.mark.each_value
@pytest.mark.parametrize("kind", ["capsule", "cylinder"])
@pytest.mark.parametrize("h", [1e-3, 2e-3, 5e-3])
@pytest.mark.parametrize("ahead", [0.25, 0.5])
def test_a_bar_swings_against_a_ball(kind: str, h: float, ahead: float) -> None:
    """A bar of 1 m that turns by up to half a radian a step about its held middle, a ball `ahead` [rad] of it, no friction, e = 0.

    I w and the ball's m x v keep their sum, and the impact leaves I / (I + m s^2) of the energy, s from the axis to where it strikes. Its
    end goes 50 times as far as what stands a radius from its middle, and on straight ways a turning bar shrinks.
    """
    make = {"capsule": rigid_capsule, "cylinder": rigid_cylinder}[kind]
    bar = make("bar", 0.01, 1.0, (0, 0, 0), 1.0, axis=(1, 0, 0))
    place = R * np.array([np.cos(ahead), np.sin(ahead), 0.0])
    ball = rigid_sphere("ball", BALL, place, 1.0)
    model = build_model([bar, ball], supports=[Support("bar", ("x", "y", "z", "rx", "ry"))])
    start = at_rest(model)
    v = start.v.copy()
    v[5] = OMEGA
    *_, last = Simulation(model, ExactContacts(model, 0.0), Theta(h), round(0.015 / h) + 1, initial=State(0.0, start.x, v))
    inertia = bar.inertia[2, 2]
    (spin, speed), x = (last.state.v[5], last.state.v[6:8]), place[:2] + last.state.x[6:8]
    s2 = R**2 - (BALL + 0.01) ** 2
    assert_allclose(inertia * spin + x[0] * speed[1] - x[1] * speed[0], inertia * OMEGA, rtol=0.01)
    assert_allclose(inertia * spin**2 + speed @ speed, inertia * OMEGA**2 * inertia / (inertia + s2), rtol=0.02)


def struck_box(kind: str, h: float, spin: tuple[float, float, float], every: int, cuttings: int = 5) -> Simulation:
    """The same bar and a box of 4 cm, 0.25 rad ahead of it, which spins."""
    make = {"capsule": rigid_capsule, "cylinder": rigid_cylinder}[kind]
    bar = make("bar", 0.01, 1.0, (0, 0, 0), 1.0, axis=(1, 0, 0))
    box = rigid_box("box", (0.04, 0.04, 0.04), R * np.array([np.cos(0.25), np.sin(0.25), 0.0]), 0.1)
    model = build_model([bar, box], supports=[Support("bar", ("x", "y", "z", "rx", "ry"))])
    start = at_rest(model)
    v = start.v.copy()
    v[5], v[9:] = OMEGA, spin
    contact, steps, initial = ExactContacts(model, 0.0), round(0.015 / h), State(0.0, start.x, v)
    return Simulation(model, contact, Theta(h), steps, initial=initial, witness=Witness(every=every), cuttings=cuttings)


@pytest.mark.each_value
@pytest.mark.parametrize("kind", ["capsule", "cylinder"])
@pytest.mark.parametrize(
    ("h", "spin"), [(1e-3, (0.0, 0.0, 0.0)), (2e-3, (0.0, 0.0, 0.0)), (1e-3, (100.0, 100.0, -600.0)), (2e-3, (100.0, 100.0, -600.0))]
)
def test_a_bar_swings_against_a_small_box(kind: str, h: float, spin: tuple[float, float, float]) -> None:
    """Struck at its edge the box spins by a radian a step; where it turns by 1.2 the step is cut. It stays before the bar until it is past
    its end, e = 0 and no friction: the moment of momentum about the bar's axis is kept, and energy never grows."""
    simulation = struck_box(kind, h, spin, every=1)
    (bar, box), model = simulation.model.rigid, simulation.model
    steps = list(simulation)
    place = box.centre + np.array([step.state.x[6:9] for step in steps])
    v = np.array([step.state.v for step in steps])
    turned = np.array([model.rigid_mass(step.state.x)[1, 3:, 3:] @ step.state.v[9:] for step in steps])
    moment = bar.inertia[2, 2] * v[:, 5] + box.mass * (place[:, 0] * v[:, 7] - place[:, 1] * v[:, 6]) + turned[:, 2]
    assert_allclose(moment, moment[0], rtol=2e-3)
    ahead = np.arctan2(place[:, 1], place[:, 0]) - np.array([step.state.x[5] for step in steps])
    beside = np.hypot(*place[:, :2].T)
    assert ahead[beside < 0.48].min() > 0.02 / 0.48
    off = [np.linalg.norm(step.contacts.point - at, axis=1).max(initial=0.0) for step, at in zip(steps, place, strict=True)]
    assert max(off) < 0.05 + 50 * h, "points of contacts lie on the box, half a step before it stands there"
    assert max(step.energy.contact_gain for step in steps) < 1e-3 * 0.5 * bar.inertia[2, 2] * OMEGA**2


def test_a_bar_that_goes_through_what_spins_by_more_than_a_radian_a_step_ends_the_run() -> None:
    """1.2 rad a step, which may not be cut: too long for detection. It would be out of the box where the witness looks next."""
    with pytest.raises(Penetration, match=r"step 1, .*'bar' and 'box' go through each other within 0.002 s"):
        list(struck_box("capsule", 2e-3, (100.0, 100.0, -600.0), every=10, cuttings=0))
