"""A nut runs down a screw by its weight: rigid threads, helicoids of twisted quadrilaterals, one across the thread.

A thread of lead p turns by k = 2 pi / p a metre of its way. Without friction m g z = (m + I k^2) v^2 / 2, so that the nut turns with
k g / (1 + I k^2 / m), and nothing is lost. Of facets of 15 degrees the slopes are off by their chords, 1.2 %."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from fcsim import Everything, RigidBody, Simulation, Support, Theta, build_model

R1, R2, LEAD, THICK, SIDES = 0.03, 0.05, 0.02, 0.004, 24  # m
MASS, INERTIA = 2.0, 0.003


def thread(name: str, bottom: float, turns: int, begin: float) -> RigidBody:
    """A rigid helical ribbon from the angle `begin` on, its outside in quadrilaterals."""
    n = SIDES * turns
    turned = 2 * np.pi * np.arange(n + 1) / SIDES
    angle, r = turned[:, None, None] + begin, np.array([R1, R2])[:, None]
    z = bottom + LEAD * turned[:, None, None] / (2 * np.pi) + np.array([0.0, THICK])
    x, y, z = np.broadcast_arrays(r * np.cos(angle), r * np.sin(angle), z)
    number = np.arange(4 * (n + 1)).reshape(n + 1, 2, 2)  # along the thread, across it, up
    a, b = number[:-1], number[1:]
    around = [((0, 1), (1, 1)), ((1, 0), (0, 0)), ((0, 0), (0, 1)), ((1, 1), (1, 0))]
    facets = [np.column_stack([a[:, *p], a[:, *q], b[:, *q], b[:, *p]]) for p, q in around]
    ends = [number[0][[0, 1, 1, 0], [0, 0, 1, 1]][None], number[-1][[0, 0, 1, 1], [0, 1, 1, 0]][None]]
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    return RigidBody(name, MASS, INERTIA * np.eye(3), np.zeros(3), points, {"all": np.vstack(facets + ends)})


def test_nut_runs_down_a_screw() -> None:
    screw, nut = thread("screw", 0.0, 2, 0.0), thread("nut", THICK + LEAD / 2, 1, np.pi)
    held = Support("screw", ("x", "y", "z", "rx", "ry", "rz")), Support("nut", ("x", "y", "rx", "ry"))
    model = build_model([screw, nut], supports=held, gravity=lambda t: (0.0, 0.0, -9.81))
    h, steps, k = 2e-3, 5, 2 * np.pi / LEAD
    found = list(Simulation(model, Everything(model, 0.0), Theta(h, 0.6), steps))
    turns, falls = found[-1].state.v[-1], found[-1].state.v[-4]
    assert_allclose(turns, -k * 9.81 / (1 + INERTIA * k**2 / MASS) * h * steps, rtol=0.015)
    assert_allclose(k * falls, turns, rtol=0.015)
    assert abs(sum(step.energy.normal_dissipation for step in found)) < 0.01 * sum(step.energy.load_work for step in found)
