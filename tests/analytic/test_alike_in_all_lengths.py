"""A run has the same answers in all units of length and however slow it is: no motion is too small to count."""

from __future__ import annotations

import numpy as np
import pytest

from fcsim import Body, Everything, Material, QuasiStatic, Simulation, State, Support, Theta, build_model
from fcsim.mesh import brick, rigid_box

YOUNG, STEP, MU = 1e9, 1e-4, 0.3


def sheared(length: float) -> list[tuple[float, float]]:
    """Two blocks pressed and sheared to and fro: the lower one's tangential and normal force over Y length^2 STEP, by steps."""
    material = Material(E=YOUNG, nu=0.0, density=2e3)
    lower = brick("lower", (length, length, 0.5 * length), (4, 3, 2), material)
    upper = brick("upper", (0.8 * length, 0.8 * length, 0.5 * length), (3, 4, 2), material)
    model = build_model(
        [Body("lower", lower), Body("upper", upper, translation=(0.1 * length, 0.07 * length, 0.5 * length))],
        supports=[
            Support("lower", ("x", "y", "z"), surface="z-"),
            Support("upper", ("y",), surface="z+"),
            Support("upper", ("x",), surface="z+", velocity=lambda t: 3 * STEP * length * (1 if t < 4.5 else -1)),
            Support("upper", ("z",), surface="z+", velocity=lambda t: -STEP * length if t < 3 else 0.0),
        ],
    )
    force = YOUNG * length**2 * STEP
    steps = Simulation(model, Everything(model, mu=MU), QuasiStatic(1.0), steps=6)
    return [(step.contact_force_on(1)[0] / force, step.contact_force_on(1)[2] / force) for step in steps]


def test_statics_of_blocks_of_all_lengths() -> None:
    metres = np.array(sheared(1.0))
    # E A d / h of two blocks in a row: with 0.64 m^2 all the way down, and with all of the lower one's 1 m^2 under an even strain
    assert 0.64 < metres[0, 1] < 1 / (0.5 / 0.64 + 0.5) and metres[2, 1] == pytest.approx(3 * metres[0, 1], rel=2e-3)
    ratio = metres[:, 0] / (MU * metres[:, 1])  # all but the part of friction that lies across
    assert -1 <= ratio[2] < -0.995 and 0.995 < ratio[5] <= 1 and abs(ratio[4]) < 0.2  # slips, is let go, slips back
    for length in (1e-4, 1e-8, 1e5):
        assert np.array(sheared(length)) == pytest.approx(metres, rel=1e-5, abs=1e-5), length


@pytest.mark.parametrize(("length", "speed"), [(1.0, 1.0), (1e-6, 1e-10), (1.0, 1e-12), (1e3, 1e-9)])
def test_dynamics_of_blocks_of_all_speeds(length: float, speed: float) -> None:
    """A block meets one of three times its mass and stays with it: a quarter of the speed."""
    edge = (length,) * 3
    bodies = [
        rigid_box("light", edge, (0.5 * length, 0.0, 0.0), 1.0),
        rigid_box("heavy", edge, (1.503 * length, 0.0, 0.0), 3.0),
    ]
    model = build_model(bodies)
    v = np.zeros(model.n_dofs)
    v[0] = speed
    scheme = Theta(1e-3 * length / speed, 0.5)
    *_, last = Simulation(model, Everything(model, mu=MU), scheme, steps=6, initial=State(0.0, np.zeros(model.n_dofs), v))
    assert last.state.v[[0, 6]] == pytest.approx([speed / 4, speed / 4], rel=1e-6, abs=0.0)
