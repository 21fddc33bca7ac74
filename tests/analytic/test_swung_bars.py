"""Capsules and cylinders of exact shape that swing fast, and strike a ball in the midst of a step: momentum and energy of the impact."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim import ExactContacts, Simulation, State, Support, Theta, at_rest, build_model
from fcsim.mesh import rigid_capsule, rigid_cylinder, rigid_sphere

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
