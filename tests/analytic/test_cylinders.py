"""Cylinders on boxes, on each other and with capsules, meshed bodies on planes, and exact shapes that are fast: statics and kinematics."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim import Body, Gap, Material, RigidBody, Step, build_model
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.exact import ExactContacts
from fcsim.mesh import brick, rigid_box, rigid_capsule, rigid_cylinder, rigid_plane, rigid_sphere
from fcsim.mesh.exact.rigid_polyhedron import rigid_polyhedron
from tests.analytic.test_exact_shapes import G, of, simulation

W = 3.0 * G
X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
UP = 0.1 + 0.1 * np.sqrt(3)


def resting(bodies: list[RigidBody | Body], held: tuple[str, ...] = ("floor",), mu: float = 0.5) -> Step:
    """The step after 20, in which nothing moves any more and everything carries its weight of 3 g (or what lies on it)."""
    step = list(simulation(bodies, 20, 2e-3, Gap(), held=held, mu=mu))[-1]
    assert np.abs(step.state.v).max() < 1e-8
    return step


def force(step: Step, name: str) -> np.ndarray:
    return step.contact_force_on(step.model.number[name])


FLOORS = {
    "plane": rigid_plane("floor", (0, 0, 0), Z),
    "box": rigid_box("floor", (3, 3, 1), (0.1, 0.05, -0.5), 1.0),
    "cells": rigid_box("floor", (3, 3, 1), (0.1, 0.05, -0.5), 1.0, divisions=(7, 6, 1)),
    "post": rigid_box("floor", (0.15, 0.15, 1), (0, 0, -0.5), 1.0),
}


@pytest.mark.each_value
@pytest.mark.parametrize("floor", FLOORS)
@pytest.mark.parametrize("axis", [X, (1, 0.3, 0), Z])
def test_a_cylinder_lies_or_stands(floor: str, axis: tuple[float, float, float]) -> None:
    """On its rims, its side or its end, on a plane, on faces of any mesh and on a post smaller than itself."""
    height = 0.2 if axis == Z else 0.1
    step = resting([rigid_cylinder("c", 0.1, 0.4, (0, 0, height), 3.0, axis=axis), FLOORS[floor]])
    assert_allclose(force(step, "c"), [0, 0, W], atol=1e-6)
    pressed = step.contact_force[:, 0]
    assert_allclose(pressed @ step.contacts.point[:, :2] / pressed.sum(), 0, atol=1e-6)


@pytest.mark.parametrize(("centre", "falls"), [(1.55, False), (1.58, False), (1.65, True)])
def test_a_cylinder_over_the_edge_of_a_table(centre: float, falls: bool) -> None:
    """The table ends at 1.6: it rests while its centre is over it, else it tips about the edge."""
    bodies = [rigid_cylinder("c", 0.1, 0.6, (centre, 0, 0.1), 3.0, axis=X), FLOORS["box"]]
    if not falls:
        assert_allclose(force(resting(bodies), "c"), [0, 0, W], atol=1e-6)
        return
    last = list(simulation(bodies, 20, 2e-3, Gap()))[-1]
    first = last.model.dof_offset[last.model.number["c"]]
    arm, inertia = centre - 1.6, 3.0 * (3 * 0.1**2 + 0.6**2) / 12
    assert_allclose(last.state.v[first + 4], W * arm / (inertia + 3.0 * (arm**2 + 0.1**2)) * 0.04, rtol=0.05)


@pytest.mark.parametrize(("kind", "top"), [("cylinder", 0.5), ("cylinder", 0.3), ("capsule", 0.3)])
def test_a_log_on_two_logs(kind: str, top: float) -> None:
    """Without friction each presses with W / 2 cos 30 along the line of centres: sideways W tan 30 / 2."""
    make = rigid_cylinder if kind == "cylinder" else rigid_capsule
    logs = [rigid_cylinder(name, 0.1, 0.5, (0, y, 0.1), 3.0, axis=X) for name, y in (("left", -0.1), ("right", 0.1))]
    step = resting([*logs, make("top", 0.1, top, (0.02, 0, UP), 3.0, axis=X)], ("left", "right"), 0.0)
    assert_allclose(force(step, "left"), [0, -W * np.tan(np.pi / 6) / 2, -W / 2], atol=1e-6)
    assert_allclose(force(step, "top"), [0, 0, W], atol=1e-6)


def test_a_log_on_two_capsules_and_across_two_logs() -> None:
    capsules = [rigid_capsule(name, 0.1, 0.5, (0, y, 0.1), 3.0, axis=X) for name, y in (("left", -0.1), ("right", 0.1))]
    step = resting([*capsules, rigid_cylinder("top", 0.1, 0.3, (0, 0, UP), 3.0, axis=X)], ("left", "right"), 0.0)
    assert_allclose(force(step, "right"), [0, W * np.tan(np.pi / 6) / 2, -W / 2], atol=1e-6)
    logs = [rigid_cylinder(name, 0.1, 0.5, (0, y, 0.1), 3.0, axis=X) for name, y in (("left", -0.1), ("right", 0.2))]
    step = resting([*logs, rigid_cylinder("top", 0.1, 0.7, (0, 0, 0.3), 3.0, axis=Y)], ("left", "right"), 0.0)
    assert_allclose([force(step, name)[2] for name in ("left", "right")], [-W * 2 / 3, -W / 3], atol=1e-6)  # levers 0.1 and 0.2


@pytest.mark.parametrize(("radii", "shift"), [((0.2, 0.2), 0.0), ((0.2, 0.2), 0.1), ((0.2, 0.1), 0.05), ((0.1, 0.2), 0.05)])
def test_a_stack_of_drums(radii: tuple[float, float], shift: float) -> None:
    drums = [
        rigid_cylinder(name, r, 0.4, (x, 0, z), 3.0, axis=Z) for name, r, x, z in zip("ab", radii, (0, shift), (0.2, 0.6), strict=True)
    ]
    step = resting([*drums, FLOORS["plane"]])
    assert_allclose(force(step, "b"), [0, 0, W], atol=1e-6)
    assert_allclose(force(step, "floor"), [0, 0, -2 * W], atol=1e-6)


@pytest.mark.parametrize("kind", ["box", "deformable", "tetrahedron"])
def test_meshed_bodies_rest_on_a_plane(kind: str) -> None:
    body: RigidBody | Body = rigid_box("body", (1, 1, 1), (0, 0, 0.5), 3.0)
    if kind == "deformable":
        body = Body("body", brick("body", (1, 1, 1), (2, 2, 2), Material(1e6, 0.2, 3.0)), translation=(-0.5, -0.5, 0))
    if kind == "tetrahedron":
        body = rigid_polyhedron("body", [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0.2, 0.2, 1)], 18.0)
    steps = list(simulation([body, FLOORS["plane"]], 40, 5e-3, Gap(), mu=0.5))
    mean = np.mean([force(step, "body") for step in steps[-20:]], axis=0)
    assert_allclose(mean, [0, 0, W], atol=0.2 * W if kind == "deformable" else 1e-6)  # it still swings
    assert min(step.contacts.gap.min() for step in steps) > -1e-5


@pytest.mark.parametrize("speed", [10.0, 1000.0])
def test_a_fast_ball_does_not_pass_a_plate_or_another_ball(speed: float) -> None:
    """5 cm of radius, up to 1 m a step, a plate of 1 cm."""
    ball = rigid_sphere("ball", 0.05, (0, 0, 0.33), 1.0)
    fall = {"ball": (0, 0, -speed, 0, 0, 0)}
    for floor in (rigid_box("floor", (1, 1, 0.01), (0, 0, 0), 1.0), rigid_sphere("floor", 0.02, (0, 0, 0), 1.0)):
        steps = list(simulation([ball, floor], 3, 1e-3, Gap(), start=fall))
        place = [step.model.positions(step.state.x)[step.model.node_offset[step.model.number["ball"]], 2] for step in steps]
        assert min(place) > 0.054


def test_balls_that_pass_each_other_do_not_touch() -> None:
    """A radius between them, ten radii a step: the direction in which they see each other at the beginning would have stopped them."""
    balls = [rigid_sphere("a", 0.1, (-0.5, 0, 0), 1.0), rigid_sphere("b", 0.1, (0.5, 0.3, 0), 1.0)]
    start = {"a": (500.0, 0, 0, 0, 0, 0), "b": (-500.0, 0, 0, 0, 0, 0)}
    last = list(simulation(balls, 3, 1e-3, Gap(), held=(), start=start, gravity=(0, 0, 0)))[-1]
    assert_allclose(last.state.v[[0, 6]], [500, -500], rtol=1e-12)


@pytest.mark.parametrize("unit", [1e-3, 1e3])
def test_units_do_not_matter(unit: float) -> None:
    bodies = [
        rigid_cylinder("c", 0.1 * unit, 0.4 * unit, (0, 0, 0.1 * unit), 3.0, axis=X),
        rigid_box("floor", (unit,) * 3, (0, 0, -0.5 * unit), 1.0),
    ]
    model = build_model(bodies)
    found = ExactContacts(model, 0.5)(model.reference)
    assert len(found) == 2
    assert_allclose(found.gap / unit, 0, atol=1e-12)


def test_contacts_found_on_the_way_stand_on_their_master() -> None:
    """Their points, brought back to the beginning, are the master's: the ball's own lies at its gap above."""
    bodies = [rigid_sphere("ball", 0.05, (0.1, 0.2, 0.33), 1.0), rigid_box("box", (0.1, 0.1, 0.1), (1, 0, 0.4), 1.0), FLOORS["plane"]]
    model = build_model(bodies)
    way = np.zeros_like(model.reference)
    way[:, 2] = np.where(model.reference[:, 2] > 0, -1.0, 0.0)
    way[model.node_offset[model.number["floor"]] :][:4] = 0
    found = ExactContacts(model, 0.5)(model.reference, way)
    floor = found.bodies[:, 1] == model.number["floor"]
    assert floor.sum() == 9
    assert_allclose(found.point[floor][:, 2], 0, atol=1e-12)
    assert_allclose(np.sort(found.gap[floor]), [0.28, *[0.35] * 4, *[0.45] * 4], atol=1e-12)


@pytest.mark.each_value
@pytest.mark.parametrize(("centre", "width"), [(0.35, 0.1), (0.46, 0.04), (0.48, 0.02)])
@pytest.mark.parametrize("drop", [0.0, 1e-3])
@pytest.mark.parametrize("kind", ["box", "keel"])
def test_what_lies_on_a_lying_cylinder_is_not_held_by_its_end(centre: float, width: float, drop: float, kind: str) -> None:
    """A box, or the level keel of a prism, across the side of a held cylinder, its faces across the axis: it stays, and bears its weight.
    A hair within the side, these faces look at the end of the cylinder from within, 0.01 to 0.2 m deep."""
    log = rigid_cylinder("log", 0.1, 1.0, (0, 0, 0), 1.0, axis=X)
    ends = centre + 0.5 * width * np.array([-1.0, 1.0])
    keel = [(x, y, 0.1 + drop + abs(y)) for x in ends for y in (-0.2, 0.0, 0.2)]
    box = rigid_box("top", (width, 0.3, 0.1), (centre, 0, 0.15 + drop), 1.0)
    top = box if kind == "box" else rigid_polyhedron("top", keel, 500.0)
    steps = list(simulation([log, top], 40, 2e-3, Gap(), held=("log",)))
    moved, force = of(steps[-1], "top", "x"), np.array([step.contact_force_on("top") for step in steps])
    assert_allclose(moved[:3], (0, 0, -drop), atol=1e-8)
    assert_allclose(force[:, 0], 0, atol=1e-5)
    assert_allclose(force[-1, 2], top.mass * G, rtol=1e-6)


@pytest.mark.parametrize("unit", [1e-4, 1.0, 1e3])
@pytest.mark.parametrize("wide", [np.sqrt(2) * (1 - 1e-8), 2.0])
def test_borders_that_lie_on_each_other_bear_what_is_a_hair_within(wide: float, unit: float) -> None:
    """A drum on a square post whose corners, or the middles of its sides, lie on its rim, 1e-6 of the radius deep: places that are nearer
    to the border of an end or a face than they are deep are held still, as the others are. They were lost, and the drum's stand."""
    low = rigid_box("post", (wide * unit, wide * unit, 4 * unit), (0, 0, -2 * unit), 1.0)
    drum = rigid_cylinder("drum", unit, unit, (0, 0, (0.5 - 1e-6) * unit), 1.0)
    model = build_model([low, drum])
    found = ExactContacts(model, 0.3)(model.reference)
    held = found.take(np.abs(found.frame[:, 0, 2]) > 1 - 1e-6)
    assert_allclose(held.gap, -1e-6 * unit, rtol=1e-6)
    corners = wide / 2 * np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)])
    rim = [(np.sin(a), np.cos(a)) for a in 2 * np.pi / 3 * np.arange(3)]
    for place in corners if wide < 2 else rim:
        assert np.linalg.norm(held.point[:, :2] / unit - place, axis=1).min() < 1e-5


@pytest.mark.parametrize("unit", [1e-4, 0.37, 1.0, 1e3])
@pytest.mark.parametrize("corners", [4, 5, 6, 8])
def test_what_is_inscribed_in_an_end_bears_at_its_corners(corners: int, unit: float) -> None:
    """A prism whose corners lie on the rim to the last bit, above a drum and below it. There was no contact at all, and it fell through.
    One that stands beside the drum, its corner on the rim, has none that looks along the axis."""
    around = 2 * np.pi * np.arange(corners) / corners
    base = unit * np.stack([np.cos(around), np.sin(around), 0 * around], axis=1)
    prism = np.concatenate([base, np.add(base, (0, 0, unit))])

    def along_the_axis(points: np.ndarray) -> Contacts:
        bodies = [rigid_cylinder("drum", unit, unit, (0, 0, 0), 1.0), rigid_polyhedron("prism", points, 1.0)]
        model = build_model(bodies)
        found = ExactContacts(model, 0.3)(model.reference)
        return found.take(np.abs(found.frame[:, 0, 2]) > 1 - 1e-9)

    for height in (0.5 * unit, -1.5 * unit):
        held = along_the_axis(np.add(prism, (0, 0, height)))
        assert_allclose(held.gap, 0, atol=1e-12 * unit)
        for place in base[:, :2]:
            assert np.linalg.norm(held.point[:, :2] - place, axis=1).min() < 1e-9 * unit
    assert not len(along_the_axis(prism * (-1, -1, 1) + (2 * unit, 0, 0.5 * unit)))
