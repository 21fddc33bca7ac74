"""Pulses that are about as short as a step are named as a run begins: their impulse is not what the body gets."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fcsim.assembly.loads import Force
from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.assembly.time_functions import AccelerationRecord, Table
from fcsim.contact_detection import Everything
from fcsim.mesh import rigid_box
from fcsim.timestep.remarks.over_time.lost_pulses import LOOKS, lost_pulses
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.theta import Theta

H, STEPS = 2e-3, 50
MASS, PUSH = 8.0, 1000.0
FLOOR = Support("floor", ("x", "y", "z", "rx", "ry", "rz"))


def struck(factor: Callable[[float], float]) -> tuple[float, list[str]]:
    """The speed of a body on a smooth floor after a push, and what was said."""
    bodies = [rigid_box("floor", (4, 4, 0.2), (0, 0, -0.1), 1.0), rigid_box("body", (0.2, 0.2, 0.2), (0, 0, 0.1), MASS)]
    loads = [Force("body", (PUSH, 0, 0), factor=factor)]
    model = build_model(bodies, supports=[FLOOR], loads=loads, gravity=lambda t: (0, 0, -9.81))
    said: list[str] = []
    speed = np.nan
    for step in Simulation(model, Everything(model, 0.0), Theta(H), STEPS):
        said += step.remarks
        speed = step.state.v[6]
    return float(speed), said


def switched(begin: float, end: float) -> Callable[[float], float]:
    return lambda t: float(begin < t < end)


TABLE = Table(np.array([0.0, 0.0401, 0.0402, 0.0412, 0.0413, 1.0]), np.array([0.0, 0, 1, 1, 0, 0]))


@pytest.mark.parametrize(
    ("factor", "impulse", "named"),
    [
        (switched(0.0401, 0.0411), 1e-3 * PUSH, True),  # between two steps: none of it is seen
        (TABLE, 1.1e-3 * PUSH, True),
        (lambda t: np.exp(-(((t - 0.04) / 1e-4) ** 2)), np.sqrt(np.pi) * 1e-4 * PUSH, True),  # at a step: eleven times of it
        (lambda t: np.sin(np.pi * (t - 0.0201) / 0.05) if 0.0201 < t < 0.0701 else 0.0, 0.1 / np.pi * PUSH, False),
        (switched(-1.0, 1.0), 0.1 * PUSH, False),
        (lambda t: np.exp(-t / 0.02), 0.02 * (1 - np.exp(-5.0)) * PUSH, False),
    ],
)
def test_what_steps_see_of_a_pulse(factor: Callable[[float], float], impulse: float, named: bool) -> None:
    speed, said = struck(factor)
    right = speed == pytest.approx(impulse / MASS, rel=0.05)
    assert right is not named
    assert [("the Force on body 'body' comes and goes" in text) for text in said] == [True] * named


def test_shapes_that_do_not_come_and_go_are_not_named() -> None:
    for factor in (switched(0.0013, 9.0), switched(-1.0, 0.0013), lambda t: np.sin(30 * t), lambda t: t**2):
        assert not struck(factor)[1]


def test_tables_of_long_runs_and_records_of_supports_are_looked_at_at_their_times() -> None:
    """More steps than would be looked at between their ends."""
    spike = AccelerationRecord(np.array([0.0, 4.0001, 4.0005, 4.0009, 40.0]), np.array([0.0, 0, 1, 0, 0]))
    floor = rigid_box("floor", (4, 4, 0.2), (0, 0, -0.1), 1.0)
    for velocity, named in ((spike, True), (spike.velocity, False)):  # the velocity stays: it is no pulse
        model = build_model([floor], supports=[Support("floor", ("x",), velocity=velocity)], gravity=lambda t: (0, 0, -9.81))
        assert bool(list(lost_pulses(model, Theta(H), 0.0, 2 * LOOKS))) is named


def test_a_run_without_end_is_not_looked_at() -> None:
    """A step of 1e-12 s asked for 7 TiB, and ended in a traceback."""
    floor = rigid_box("floor", (4, 4, 0.2), (0, 0, -0.1), 1.0)
    assert not list(lost_pulses(build_model([floor], supports=[FLOOR], gravity=lambda t: (0, 0, -9.81)), Theta(1e-12), 0.0, 10**12))
