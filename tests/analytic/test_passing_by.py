"""Round bodies that pass another one within a step: untouched they go straight on, and those that touch are stopped along the normal."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim import ExactContacts, RigidBody, Simulation, State, Support, Theta, at_rest, build_model
from fcsim.mesh import rigid_box, rigid_capsule, rigid_sphere

R, TARGET = 0.02, 0.05  # [m]: radius of what flies; edge of the box, diameter of the ball that it passes
HELD = ("x", "y", "z", "rx", "ry", "rz")


def flown(kind: str, target: str, beside: float, speed: float, h: float, start: float) -> np.ndarray:
    """Velocities (steps, 3) of a body that flies along x over a fixed one, `beside` [m] above it; from -start [m], over it in mid-step."""
    fixed = (
        rigid_box("target", (TARGET, TARGET, TARGET), (0, 0, 0), 1.0)
        if target == "box"
        else rigid_sphere("target", TARGET / 2, (0, 0, 0), 1.0)
    )
    centre = (-start, 0.0, TARGET / 2 + R + beside)
    makes: dict[str, RigidBody] = {
        "ball": rigid_sphere("flies", R, centre, 1.0),
        "capsule": rigid_capsule("flies", R, 0.1, centre, 1.0, axis=(1, 0, 0)),
    }
    model = build_model([fixed, makes[kind]], supports=[Support("target", HELD)])
    state = at_rest(model)
    v = state.v.copy()
    v[6] = speed
    steps = Simulation(model, ExactContacts(model, 0.0), Theta(h), int(2 * start / speed / h) + 2, initial=State(0.0, state.x, v))
    return np.array([step.state.v[6:9] for step in steps])


@pytest.mark.parametrize("beside", [0.06 * R, 0.2 * R, 0.5 * R])
@pytest.mark.parametrize(("speed", "h", "start"), [(30.0, 2e-3, 1.01), (130.0, 1e-3, 1.33), (700.0, 1e-3, 1.62)])
@pytest.mark.parametrize("target", ["box", "ball"])
@pytest.mark.parametrize("kind", ["ball", "capsule"])
def test_what_touches_nothing_goes_straight_on(kind: str, target: str, speed: float, h: float, start: float, beside: float) -> None:
    """By up to 70 cm a step, past what is 5 cm long, beyond the alert distance."""
    for v in flown(kind, target, beside, speed, h, start):
        assert_allclose(v, [speed, 0.0, 0.0], atol=1e-9 * speed)


@pytest.mark.parametrize("depth", [0.1 * R, 0.3 * R, R])
@pytest.mark.parametrize(("speed", "h", "start"), [(30.0, 2e-3, 1.01), (130.0, 1e-3, 1.33), (700.0, 1e-3, 1.62)])
def test_a_ball_that_strikes_another_slides_off_it(speed: float, h: float, start: float, depth: float) -> None:
    """Without friction and restitution it keeps the part of its velocity across the normal, and is thrown up: to 0.28 where it flies 14 of
    its diameters further in the step, whose places of detection are half a radius apart."""
    last = flown("ball", "ball", -depth, speed, h, start)[-1]
    assert last[2] > 0.0
    assert np.linalg.norm(last) < speed * (1 + 1e-9)
    sine = 1.0 - depth / (TARGET / 2 + R)  # of the normal to the way, where they meet
    assert np.linalg.norm(last) / speed == pytest.approx(sine, abs=0.28)
