"""Shapes that no rule was written for: hooks, wedges, keys, dovetails, chains, tops; against statics, closed forms, momentum and energy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from fcsim import Everything, Gap, Simulation, SolverSettings, State, Step, Support, Theta, Witness, at_rest, build_model
from fcsim.assembly.layout import DIRECTIONS
from fcsim.assembly.model import Model
from fcsim.mesh import RigidBody, rigid_box, rigid_polyhedron
from fcsim.mesh.solids.closed_surface import closed_surface, rigid_solid

G = 9.81
Polygon = Sequence[tuple[float, float]]


def prism(name: str, polygon: Polygon, half: float, density: float = 1000.0) -> RigidBody:
    """A polygon in x, z, convex or not, from -half to half along y."""
    p, n = np.asarray(polygon, float), len(polygon)
    points = np.concatenate([np.insert(p, 1, y, axis=1) for y in (-half, half)])
    faces = [list(range(n)), list(range(n, 2 * n)), *([i, (i + 1) % n, n + (i + 1) % n, n + i] for i in range(n))]
    return rigid_solid(closed_surface(name, points, faces), density=density)


def ring(name: str, inner: float, outer: float, half: float, corners: int, centre: Sequence[float], across: int) -> RigidBody:
    """A polygonal ring about the axis `across`; with flat sides where it is lowest and highest."""
    angle = 2 * np.pi * (np.arange(corners) + 0.5) / corners
    points = np.empty((4 * corners, 3))
    for k, (radius, along) in enumerate(((inner, -half), (outer, -half), (inner, half), (outer, half))):
        rows = points[k * corners : (k + 1) * corners]
        rows[:, [a for a in range(3) if a != across]] = radius * np.column_stack([np.cos(angle), np.sin(angle)])
        rows[:, across] = along
    quads = [[a * corners + i, a * corners + (i + 1) % corners, b * corners + (i + 1) % corners, b * corners + i] for a, b in
             ((0, 1), (2, 3), (0, 2), (1, 3)) for i in range(corners)]  # fmt: skip
    return rigid_solid(closed_surface(name, points + centre, quads), density=7800.0)


def model_of(bodies: Sequence[RigidBody], held: Sequence[str], gravity: Sequence[float] = (0, 0, -G)) -> Model:
    pull = np.array(gravity, float)
    return build_model(list(bodies), supports=[Support(name, DIRECTIONS[3]) for name in held], gravity=lambda t: pull)


def simulate(
    model: Model, steps: int, mu: float = 0.5, h: float = 1e-3, velocities: dict[str, Sequence[float]] | None = None, tol: float = 1e-8
) -> Step:
    """The last step; no overlap above 1e-4 of a body at any, and no energy from nothing."""
    start = at_rest(model)
    v = start.v.copy()
    for name, velocity in (velocities or {}).items():
        first = model.dof_offset[model.number[name]]
        v[first : first + 6] = velocity
    settings, witness = SolverSettings(name="auto", tol=tol), Witness(every=1, tolerance=1e-4)
    run = Simulation(model, Everything(model, mu), Theta(h, 0.5, Gap()), steps, settings, State(0.0, start.x, v), witness=witness)
    for step in run:
        assert step.ledger.created <= 1e-4 * step.ledger.supplied + 1e-9, step.number
    return step


def floor() -> RigidBody:
    return rigid_box("floor", (4, 4, 0.2), (0, 0, -0.1), 1.0)


def force_on(step: Step, name: str) -> np.ndarray:
    return step.contact_force_on(step.model.number[name])


def place(step: Step, name: str) -> np.ndarray:
    return step.model.rigid_part(step.state.x)[step.model.number[name]]


L_SHAPE = [(0, 0), (0.3, 0), (0.3, 0.1), (0.1, 0.1), (0.1, 0.4), (0, 0.4)]
T_SHAPE = [(-0.05, 0), (0.05, 0), (0.05, 0.3), (0.2, 0.3), (0.2, 0.4), (-0.2, 0.4), (-0.2, 0.3), (-0.05, 0.3)]


@pytest.mark.slow
def test_an_l_dropped_with_a_spin_comes_to_rest() -> None:
    turned, angle = prism("L", L_SHAPE, 0.05), Rotation.from_euler("xyz", [0.3, 0.5, 0.7])
    R = angle.as_matrix()
    body = RigidBody(
        "L", turned.mass, R @ turned.inertia @ R.T, R @ turned.centre + [0, 0, 0.35], turned.points @ R.T + [0, 0, 0.35], turned.surfaces
    )
    last = simulate(model_of([floor(), body], ["floor"]), 600, h=2e-3, velocities={"L": [0.3, 0, -1, 6, -4, 3]})
    assert_allclose(force_on(last, "L"), [0, 0, body.mass * G], atol=1e-5 * body.mass * G)
    assert np.abs(last.state.v).max() < 1e-6


def test_a_t_hangs_by_its_arms() -> None:
    """Its stem between two blocks, an inner corner over each: no side of a block is touched."""
    body = prism("T", T_SHAPE, 0.05)
    blocks = [rigid_box(f"block {side}", (0.1, 0.3, 0.25), (0.13 * side, 0, 0.175), 1.0) for side in (-1, 1)]
    last = simulate(model_of([body, *blocks], ["block -1", "block 1"]), 10)
    assert_allclose(force_on(last, "T"), [0, 0, body.mass * G], atol=1e-6 * body.mass * G)
    assert_allclose(np.abs(last.contacts.frame[:, 0, 2]), 1.0, atol=1e-9)


@pytest.mark.parametrize("unit", [1.0, pytest.param(1e-3, marks=pytest.mark.slow), pytest.param(1e3, marks=pytest.mark.slow)])
def test_a_wedge_jams_in_a_slot_of_its_own_slope(unit: float) -> None:
    """Driven in at 2 m/s; sinks by the play over the slope, (0.04 + 0.1 t - 0.05) / t, and friction of 0.5 > t = tan(10 degrees) locks it.
    With gaps a hair below zero no force answers Coulomb's law there."""
    t = np.tan(np.radians(10))
    shapes = {
        "wedge": [(-0.05, 0), (0.05, 0), (0.05 + 0.3 * t, 0.3), (-0.05 - 0.3 * t, 0.3)],
        "left": [(-0.3, -0.1), (-0.04, -0.1), (-0.04 - 0.4 * t, 0.3), (-0.3, 0.3)],
        "right": [(0.3, -0.1), (0.3, 0.3), (0.04 + 0.4 * t, 0.3), (0.04, -0.1)],
    }
    bodies = [prism(name, np.array(shape) * unit, 0.1 * unit) for name, shape in shapes.items()]
    model = model_of(bodies, ["left", "right"], (0, 0, -G * unit))
    last = simulate(model, 26, velocities={"wedge": [0, 0, -2 * unit, 0, 0, 0]})
    assert place(last, "wedge")[2] == pytest.approx(-(0.1 - 0.01 / t) * unit, rel=1e-5)
    assert np.abs(last.state.v[:3]).max() < 1e-6 * unit
    assert_allclose(force_on(last, "wedge")[2], bodies[0].mass * G * unit, rtol=1e-4)


def test_a_key_comes_up_against_the_side_of_its_keyway() -> None:
    """Play of 0.5 mm to the sides, 1 mm to the bottom: pressed in it rests on the bottom and one side, with the forces that press it."""
    hub = [(-0.2, 0), (-0.0505, 0), (-0.0505, 0.1), (0.0505, 0.1), (0.0505, 0), (0.2, 0), (0.2, 0.2), (-0.2, 0.2)]
    key = prism("key", [(-0.05, -0.05), (0.05, -0.05), (0.05, 0.099), (-0.05, 0.099)], 0.1)
    last = simulate(model_of([prism("hub", hub, 0.1), key], ["hub"], (8.0, 0, G)), 60, mu=0.1)
    assert_allclose(place(last, "key")[:3], [5e-4, 0, 1e-3], atol=1e-7)
    assert_allclose(force_on(last, "key"), key.mass * np.array([-8.0, 0, -G]), atol=1e-4 * key.mass * G)


def test_a_dovetail_does_not_leave_upwards() -> None:
    """Pulled up by 20 m/s^2 and jolted, it comes up against both flanks and stays."""
    tail = prism("tail", [(-0.08, 0), (0.08, 0), (0.05, 0.06), (-0.05, 0.06)], 0.1)
    bed = [(-0.2, -0.1), (0.2, -0.1), (0.2, 0.06), (0.0505, 0.06), (0.0805, -0.0005), (-0.0805, -0.0005), (-0.0505, 0.06), (-0.2, 0.06)]
    last = simulate(model_of([prism("bed", bed, 0.1), tail], ["bed"], (0, 0, 20.0)), 60, velocities={"tail": [0.1, 0, 1.0, 1.0, 0, 1.0]})
    assert np.abs(place(last, "tail")[:3]).max() < 1.1e-3
    assert_allclose(force_on(last, "tail"), [0, 0, -20.0 * tail.mass], atol=1e-3 * tail.mass)


def test_a_tetrahedron_balances_on_its_corner() -> None:
    """One contact under the centre of mass, in exact arithmetic."""
    points = 0.1 * Rotation.align_vectors([[0, 0, -1]], [[1, 1, 1]])[0].apply([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)])
    body = rigid_polyhedron("tetrahedron", points - [0, 0, points[:, 2].min()], 1000.0)
    last = simulate(model_of([floor(), body], ["floor"]), 20)
    assert len(last.contacts) == 1
    assert_allclose(force_on(last, "tetrahedron"), [0, 0, body.mass * G], atol=1e-9 * body.mass * G)
    assert np.abs(last.state.v).max() < 1e-9


@pytest.mark.slow
def test_a_chain_of_rings_hangs() -> None:
    """Five rings, each across the next; let go 0.1 mm too high. In the end each bears the weight of those below it."""
    flat = np.cos(np.pi / 12)
    rings = [ring(f"ring {k}", 0.03, 0.04, 0.005, 12, (0, 0, -(2 * 0.03 * flat - 1e-4) * k), k % 2) for k in range(5)]
    last = simulate(model_of(rings, ["ring 0"]), 400)
    for k in range(1, 5):
        pair = np.sort(last.contacts.bodies, axis=1) == [k - 1, k]
        between = pair.all(axis=1)
        up = np.where(last.contacts.bodies[between, 0] == k, 1.0, -1.0) @ last.force_in_space[between, 2]
        assert up == pytest.approx(sum(body.mass for body in rings[k:]) * G, rel=1e-2)


@pytest.mark.slow
def test_a_top_precesses() -> None:
    """A heavy symmetric top on its tip, tilted by 5 degrees: steady precession p, I1 p^2 cos(tilt) - I3 w p + m g l = 0 about the tip with
    w = spin + p cos(tilt) along its axis, and it does not fall."""
    n, spin = 16, 150.0
    angle = 2 * np.pi * np.arange(n) / n
    points = np.vstack([[0, 0, 0], np.column_stack([0.03 * np.cos(angle), 0.03 * np.sin(angle), np.full(n, 0.03)]), [[0, 0, 0.05]]])
    upright = rigid_polyhedron("top", points, 2000.0)
    tilt = Rotation.from_euler("x", 5, degrees=True)
    top = rigid_polyhedron("top", tilt.apply(points), 2000.0)
    l, (I1, _, I3) = upright.centre[2], np.diag(upright.inertia)
    moment, cosine, precession = upright.mass * G * l, np.cos(np.radians(5)), 0.0
    for _ in range(50):
        precession = (moment + (I1 + upright.mass * l**2) * cosine * precession**2) / (I3 * (spin + cosine * precession))
    axis = tilt.apply([0, 0, 1.0])
    begin = spin * axis + precession * np.array([0, 0, 1.0])
    velocity = np.concatenate([np.cross(begin, top.centre), begin])
    steps, h = 400, 5e-4
    last = simulate(model_of([floor(), top], ["floor"]), steps, mu=0.8, h=h, velocities={"top": velocity.tolist()})
    own = last.model.node_offset[last.model.number["top"]] + np.arange(len(top.points))
    tip, head = (int(np.argmin(top.points[:, 2])), int(np.argmax(top.points[:, 2])))
    before, after = (x[head] - x[tip] for x in (top.points, last.model.positions(last.state.x)[own]))
    turned = np.arctan2(after[1], after[0]) - np.arctan2(before[1], before[0])
    assert after[2] == pytest.approx(before[2], rel=2e-3)
    assert turned % (2 * np.pi) == pytest.approx(precession * steps * h, rel=0.03)
