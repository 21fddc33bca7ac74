"""A nut runs down a screw by its weight: rigid threads, helicoids of twisted quadrilaterals, one across the thread.

A thread of lead p turns by k = 2 pi / p a metre of its way. Without friction m g z = (m + I k^2) v^2 / 2, so that the nut turns with
k g / (1 + I k^2 / m), and nothing is lost. Of facets of 15 degrees the slopes are off by their chords, 1.2 %."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim import Detector, Everything, RigidBody, Simulation, Support, SurfacePair, Theta, build_model, contact_surface
from fcsim.arrays import FloatArray

R1, R2, LEAD, THICK, SIDES = 0.03, 0.05, 0.02, 0.004, 24  # m
MASS, INERTIA = 2.0, 0.003
H = 2e-3  # s


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
    up, down = facets[:2]
    return RigidBody(name, MASS, INERTIA * np.eye(3), np.zeros(3), points, {"all": np.vstack(facets + ends), "up": up, "down": down})


def test_nut_runs_down_a_screw() -> None:
    screw, nut = thread("screw", 0.0, 2, 0.0), thread("nut", THICK + LEAD / 2, 1, np.pi)
    held = Support("screw", ("x", "y", "z", "rx", "ry", "rz")), Support("nut", ("x", "y", "rx", "ry"))
    model = build_model([screw, nut], supports=held, gravity=lambda t: (0.0, 0.0, -9.81))
    h, steps, k = H, 5, 2 * np.pi / LEAD
    found = list(Simulation(model, Everything(model, 0.0), Theta(h, 0.6), steps))
    turns, falls = found[-1].state.v[-1], found[-1].state.v[-4]
    assert_allclose(turns, -k * 9.81 / (1 + INERTIA * k**2 / MASS) * h * steps, rtol=0.015)
    assert_allclose(k * falls, turns, rtol=0.015)
    assert abs(sum(step.energy.normal_dissipation for step in found)) < 0.01 * sum(step.energy.load_work for step in found)


RULES = ["nodes", "smooth", "mortar", "mortar-faces", "segments"]


def under_rule(
    rule: str, bodies: tuple[RigidBody, RigidBody], sides: list[tuple[str, str]], free: tuple[str, ...], g: FloatArray
) -> FloatArray:
    """Velocity (6,) of the first body, free in those directions, after five steps on the second one, which is held."""
    others = tuple(direction for direction in ("x", "y", "z", "rx", "ry", "rz") if direction not in free)
    size = np.ptp(bodies[0].points, axis=0).max()
    held = [Support(bodies[0].name, others), Support(bodies[1].name, ("x", "y", "z", "rx", "ry", "rz"))]
    model = build_model(list(bodies), supports=held, gravity=lambda t: g)
    pairs = [
        SurfacePair(
            contact_surface(model, [(bodies[0].name, one)]),
            contact_surface(model, [(bodies[1].name, other)]),
            0.0,
            0.01 * size,
            "nodes" if rule == "smooth" else rule,
            normals="smooth" if rule == "smooth" else "facet",
        )
        for one, other in sides
    ]
    return [step.state.v for step in Simulation(model, Detector(pairs, model.n_nodes), Theta(H, 0.6), 5)][-1][:6]


def sheet(name: str, points: FloatArray, mass: float, inertia: float) -> RigidBody:
    """A rigid body of quadrilaterals between points (n, m, 3), "up" one way and "down" the other."""
    n, m = points.shape[:2]
    k = np.arange(n * m).reshape(n, m)
    facets = np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], axis=-1).reshape(-1, 4)
    surfaces = {"up": facets, "down": facets[:, ::-1]}
    return RigidBody(name, mass, inertia * np.eye(3), np.zeros(3), points.reshape(-1, 3), surfaces)


@pytest.mark.parametrize("rule", RULES)
def test_screw_under_each_rule(rule: str) -> None:
    screw, nut = thread("screw", 0.0, 2, 0.0), thread("nut", THICK + LEAD / 2, 1, np.pi)
    k = 2 * np.pi / LEAD
    v = under_rule(rule, (nut, screw), [("down", "up")], ("z", "rz"), np.array([0.0, 0.0, -9.81]))
    assert_allclose(v[5], -k * 9.81 / (1 + INERTIA * k**2 / MASS) * 5 * H, rtol=0.015)
    assert_allclose(k * v[2], v[5], rtol=0.015)


@pytest.mark.parametrize(("rule", "length"), [("nodes", 1.0), ("smooth", 1e3), ("mortar", 1e-3), ("segments", 1e3)])
def test_saddle_slides_along_its_rulings_as_it_turns(rule: str, length: float) -> None:
    """z = x y / c shifted by a along x is itself turned by a / c about x, near x = 0: a force F along x moves a body by
    F / (m + I / c^2) t^2 / 2.
    Facets reach across it: their mean normals are upright."""
    c, mass, ratio = 0.4 * length, 2.0, 0.5  # ratio = I / (m c^2)
    x, y = np.meshgrid(length * np.linspace(-0.01, 0.01, 3), length * np.linspace(-0.15, 0.15, 2), indexing="ij")
    points = np.stack([x, y, x * y / c], axis=-1)
    bodies = sheet("saddle", points, mass, ratio * mass * c**2), sheet("mate", 1.5 * points * [1, 1, 1.5], 1.0, 1.0)
    v = under_rule(rule, bodies, [("down", "up")], ("x", "z", "rx"), np.array([1.0, 0.0, -30.0]) * length)
    assert_allclose(v[[0, 2]], [length * 5 * H / (1 + ratio), 0.0], atol=5e-3 * 5 * H * length)
    assert_allclose(c * v[3], v[0], rtol=5e-3)


@pytest.mark.parametrize(("rule", "length"), [("nodes", 1e-3), ("smooth", 1.0), ("mortar", 1e3), ("segments", 1.0)])
def test_twisted_blade_is_pushed_through_its_slot(rule: str, length: float) -> None:
    """A blade twisted by k a metre of its axis, one facet wide, both sides in a slot that fits: it turns by k a metre, as a screw does."""
    k, mass, ratio = 2.0 / length, 3.0, 0.7  # ratio = I k^2 / m

    def blade(thick: float, low: float, high: float, n: int, side: float) -> FloatArray:
        z = length * np.linspace(low, high, n + 1)[:, None]
        s, t = length * np.array([-0.1, 0.1]), 0.5 * length * side * thick
        return np.stack(np.broadcast_arrays(s * np.cos(k * z) - t * np.sin(k * z), s * np.sin(k * z) + t * np.cos(k * z), z), axis=-1)

    both = []
    for name, thick, low, high, n in (("blade", 0.02, 0.0, 0.4, 8), ("slot", 0.020002, -0.2, 0.6, 16)):
        front, back = (sheet(name, blade(thick, low, high, n, side), mass, ratio * mass / k**2) for side in (1.0, -1.0))
        number = len(front.points)
        surfaces = {"front up": front.surfaces["up"], "front down": front.surfaces["down"]}
        surfaces |= {"back up": back.surfaces["up"] + number, "back down": back.surfaces["down"] + number}
        points = np.concatenate([front.points, back.points])
        both.append(RigidBody(name, mass, ratio * mass / k**2 * np.eye(3), np.zeros(3), points, surfaces))
    sides = [("front up", "front down"), ("back down", "back up")]
    v = under_rule(rule, (both[0], both[1]), sides, ("z", "rz"), np.array([0.0, 0.0, -10.0]) * length)
    assert_allclose(v[2], -10.0 * length * 5 * H / (1 + ratio), rtol=5e-3)
    assert_allclose(v[5], k * v[2], rtol=5e-3)
