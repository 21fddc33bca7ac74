"""Exact contactors against closed forms: sliding to rolling, rolling down an incline, Newton's cradle, resting capsules and cylinders."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from fcsim import (
    Everything,
    Gap,
    InputError,
    RigidBody,
    Simulation,
    SolverSettings,
    State,
    Step,
    Support,
    Theta,
    Velocity,
    at_rest,
    build_model,
)
from fcsim.assembly.layout import DIRECTIONS
from fcsim.contact_detection.exact import ExactContacts
from fcsim.mesh import Body, Material, brick, rigid_box, rigid_capsule, rigid_cylinder, rigid_plane, rigid_sphere

G = 9.81


def simulation(
    bodies: Sequence[RigidBody | Body],
    steps: int,
    h: float,
    law: Gap | Velocity,
    *,
    held: Sequence[str] = ("floor",),
    start: Mapping[str, ArrayLike] | None = None,
    mu: float = 0.3,
    gravity: ArrayLike | None = None,
    exclude: Sequence[tuple[str, str]] = (),
) -> Simulation:
    d = bodies[0].dimension
    pull = -G * np.eye(d)[-1] if gravity is None else np.asarray(gravity, dtype=float)
    kind = {body.name: DIRECTIONS[d][: d if isinstance(body, Body) else None] for body in bodies}
    model = build_model(bodies, supports=[Support(name, kind[name]) for name in held], gravity=lambda t: pull)
    state = at_rest(model)
    v = state.v.copy()
    for name, velocity in (start or {}).items():
        first = model.dof_offset[model.number[name]]
        v[first : first + len(DIRECTIONS[d])] = velocity
    detection = ExactContacts(model, mu, exclude=exclude)
    initial = State(0.0, state.x, v)
    return Simulation(model, detection, Theta(h, 0.5, law), steps, SolverSettings(name="auto", tol=1e-10), initial=initial)


def last(run: Simulation) -> Step:
    *_, step = run
    return step


def of(step: Step, name: str, what: str = "v") -> Any:
    model = step.model
    first = model.dof_offset[model.number[name]]
    return getattr(step.state, what)[first : first + len(DIRECTIONS[model.dimension])]


@pytest.mark.each_value
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("unit", [1e-3, 1.0])
def test_a_ball_slides_then_rolls(d: int, unit: float) -> None:
    """A ball (disk) thrown without spin slides until t = 2 v0 / (7 mu g) (disk: v0 / (3 mu g)), then rolls at 5/7 v0 (2/3) for ever."""
    up = np.eye(d)[-1]
    v0, mu = np.sqrt(unit), 0.2
    ball = rigid_sphere("ball", 0.1 * unit, 0.1 * unit * up, 2.0)
    floor = rigid_plane("floor", np.zeros(d), up.tolist(), size=unit)
    start = np.zeros(len(DIRECTIONS[d]))
    start[0] = v0
    share, sliding = (5 / 7, 2 * v0 / (7 * mu * G)) if d == 3 else (2 / 3, v0 / (3 * mu * G))
    h = sliding / 50.5
    velocity = [of(step, "ball")[0] for step in simulation([ball, floor], 80, h, Gap(), start={"ball": start}, mu=mu)]
    assert velocity[24] == pytest.approx(v0 - mu * G * 25 * h, rel=1e-8)
    assert velocity[48] > share * v0 * (1 + 1e-3)
    assert velocity[51:] == pytest.approx([share * v0] * 29, rel=1e-7)


def test_a_cylinder_rolls_down_an_incline() -> None:
    """a = 2/3 g sin(angle); a ball 5/7, where tan(angle) <= 3 mu (7/2 mu)."""
    angle = np.deg2rad(20)
    pull = G * np.array([np.sin(angle), 0.0, -np.cos(angle)])
    floor = rigid_plane("floor", (0, 0, 0), (0, 0, 1))
    roller = rigid_cylinder("roller", 0.1, 0.3, (0, 1, 0.1), 2.0, axis=(0, 1, 0))
    ball = rigid_sphere("ball", 0.1, (0, 0, 0.1), 2.0)
    step = last(simulation([roller, ball, floor], 200, 2e-3, Gap(), gravity=pull, exclude=[("roller", "ball")]))
    t = step.state.t
    assert of(step, "roller")[:3] == pytest.approx([2 / 3 * G * np.sin(angle) * t, 0, 0], abs=1e-7)
    assert of(step, "ball")[:3] == pytest.approx([5 / 7 * G * np.sin(angle) * t, 0, 0], abs=1e-7)


@pytest.mark.parametrize("d", [2, 3])
def test_newtons_cradle(d: int) -> None:
    """Five balls with a little air between them, e = 1: the last leaves with the first one's velocity, the others stand still, no spin."""
    e = np.eye(d)
    balls = [rigid_sphere(f"ball {k}", 0.1, 0.2005 * k * e[0] - (0.3 * e[0] if k == 0 else 0), 1.0) for k in range(5)]
    start = np.zeros(len(DIRECTIONS[d]))
    start[0] = 1.0
    step = last(simulation(balls, 250, 2e-3, Velocity(1.0), held=(), start={"ball 0": start}, mu=0.0, gravity=np.zeros(d)))
    assert of(step, "ball 4") == pytest.approx(start, abs=1e-9)
    for k in range(4):
        assert of(step, f"ball {k}") == pytest.approx(np.zeros_like(start), abs=1e-9)


def test_bodies_at_rest_carry_their_weight() -> None:
    """A ball, a lying capsule, a lying and a standing cylinder on a plane, and a capsule across the first: floor force = weight."""
    floor = rigid_plane("floor", (0, 0, 0), (0, 0, 1))
    bodies = [
        rigid_sphere("ball", 0.1, (0, 0, 0.1), 1.0),
        rigid_capsule("capsule", 0.1, 0.4, (1, 0, 0.1), 2.0, axis=(1, 0, 0)),
        rigid_cylinder("roller", 0.1, 0.4, (2, 0, 0.1), 3.0, axis=(1, 1, 0)),
        rigid_cylinder("post", 0.1, 0.4, (3, 0, 0.2), 4.0),
        floor,
    ]
    apart = [("roller", "capsule"), ("post", "capsule"), ("roller", "post")]
    step = last(simulation(bodies, 20, 5e-3, Gap(), exclude=apart))
    floor_number = step.model.number["floor"]
    assert step.contact_force_on(floor_number) == pytest.approx([0, 0, -10 * G], abs=1e-6)
    assert np.abs(step.state.v).max() < 1e-8
    for name, mass in (("ball", 1.0), ("capsule", 2.0), ("roller", 3.0), ("post", 4.0)):
        assert step.contact_force_on(step.model.number[name])[2] == pytest.approx(mass * G, rel=1e-6)


@pytest.mark.slow
def test_a_capsule_that_falls_on_its_end_comes_to_lie() -> None:
    """Dropped at 40 degrees, it tumbles and lies: energy never grows, the kinetic one dies, its axis at one radius above the floor."""
    axis = (np.cos(0.7), 0.0, np.sin(0.7))
    capsule = rigid_capsule("capsule", 0.05, 0.3, (0, 0, 0.25), 1.0, axis=axis)
    floor = rigid_plane("floor", (0, 0, 0), (0, 0, 1))
    energy, steps = [], list(simulation([capsule, floor], 1500, 1e-3, Velocity(0.0), mu=0.5))
    for step in steps:
        energy.append(step.energy.kinetic + 1.0 * G * (0.25 + of(step, "capsule", "x")[2]))
    assert np.diff(energy).max() < 1e-6 * energy[0]
    assert 0.25 + of(steps[-1], "capsule", "x")[2] == pytest.approx(0.05, abs=2e-3)
    assert abs(of(steps[-1], "capsule")[4]) < 0.5


@pytest.mark.each_value
@pytest.mark.parametrize("kind", ["rigid", "brick", pytest.param("tetrahedra", marks=pytest.mark.slow)])
@pytest.mark.parametrize("place", ["face", "seam"])
def test_a_ball_rolls_over_facets_as_on_a_plane(kind: str, place: str) -> None:
    """5/7 v0 over a meshed floor: edges between facets of one face are not felt."""
    floor: RigidBody | Body = rigid_box("floor", (2.0, 1.0, 0.2), (0.5, 0.0, -0.1), 1.0, divisions=(7, 3, 1))
    if kind != "rigid":
        cell = "hexahedron" if kind == "brick" else "tetrahedron"
        part = brick("floor", (2.0, 1.0, 0.2), (5, 2, 1), Material(1e12, 0.2, 2000.0), cell, (-0.5, -0.5, -0.2))
        floor = Body("floor", part)
    y = 0.07 if place == "face" else 0.0
    ball = rigid_sphere("ball", 0.1, (0, y, 0.1), 2.0)
    step = last(simulation([ball, floor], 125, 4e-3, Gap(), start={"ball": (1.0, 0, 0, 0, 0, 0)}, mu=0.2))
    assert of(step, "ball")[:3] == pytest.approx([5 / 7, 0, 0], abs=1e-6)
    assert of(step, "ball", "x")[2] == pytest.approx(0.0, abs=1e-7)


def test_a_ball_in_the_corner_of_a_box() -> None:
    """Three walls, one contact each; the floor carries the weight, the walls nothing."""
    walls = [
        rigid_box("floor", (1.0, 1.0, 0.2), (0.5, 0.5, -0.1), 1.0),
        rigid_box("left", (0.2, 1.0, 1.0), (-0.1, 0.5, 0.5), 1.0),
        rigid_box("front", (1.0, 0.2, 1.0), (0.5, -0.1, 0.5), 1.0),
    ]
    run = simulation([rigid_sphere("ball", 0.1, (0.1, 0.1, 0.1), 1.0), *walls], 10, 1e-3, Gap(), held=("floor", "left", "front"), mu=0.0)
    step = last(run)
    assert len(step.contacts) == 3
    assert step.contact_force_on(step.model.number["ball"]) == pytest.approx([0, 0, G], abs=1e-6)


def test_a_ball_leaves_a_table_over_its_edge() -> None:
    """Without friction it slides to the edge and then falls freely, never through the edge: the gap to the edge stays >= 0."""
    table = rigid_box("floor", (1.0, 1.0, 0.2), (-0.5, 0.0, -0.1), 1.0)
    ball = rigid_sphere("ball", 0.1, (-0.05, 0.0, 0.1), 1.0)
    for step in simulation([ball, table], 150, 2e-3, Gap(), start={"ball": (0.5, 0, 0, 0, 0, 0)}, mu=0.0):
        centre = np.array([-0.05, 0.0, 0.1]) + of(step, "ball", "x")[:3]
        nearest = np.minimum(centre, [0.0, np.inf, 0.0])  # of the table's quadrant x <= 0, z <= 0
        assert np.linalg.norm(centre - nearest) >= 0.1 - 1e-6
    assert centre[2] < 0


def test_a_capsule_bridges_two_blocks_by_their_edges() -> None:
    """Its ends lie on the blocks, its core crosses their inner edges: contacts at 0.17 and 0.15 m from the middle on each side. How a
    side's share is split between its two is not determined, so that it is half the weight only to within 0.15 / 0.32 and 0.17 / 0.32."""
    blocks = [rigid_box(name, (0.2, 0.4, 0.2), (x, 0.0, -0.1), 1.0) for name, x in (("floor", -0.25), ("right", 0.25))]
    capsule = rigid_capsule("capsule", 0.05, 0.34, (0, 0, 0.05), 1.0, axis=(1, 0, 0))
    step = last(simulation([capsule, *blocks], 20, 2e-3, Gap(), held=("floor", "right")))
    for name in ("floor", "right"):
        assert 0.15 / 0.32 * G * (1 - 1e-6) <= -step.contact_force_on(step.model.number[name])[2] <= 0.17 / 0.32 * G * (1 + 1e-6)
    assert step.contact_force_on(step.model.number["capsule"]) == pytest.approx([0, 0, G], abs=1e-6)
    assert np.abs(step.state.v).max() < 1e-8


def test_models_for_the_other_detection_are_refused() -> None:
    box = rigid_box("box", (1.0, 1.0, 1.0), (0, 0, 0.5), 1.0)
    with pytest.raises(InputError, match="ExactContacts instead of Everything"):
        Everything(build_model([rigid_sphere("ball", 0.1, (0, 0, 0), 1.0), box]), 0.3)
    with pytest.raises(InputError, match="use Everything"):
        ExactContacts(build_model([box]), 0.3)


def test_bad_starts_are_refused() -> None:
    """Coincident balls, a ball in a floor, one within a box: named before the first step."""
    floor, ball = rigid_plane("floor", (0, 0, 0), (0, 0, 1)), rigid_sphere("ball", 0.1, (0, 0, 0.5), 1.0)
    box = rigid_box("box", (1.0, 1.0, 1.0), (0, 0, 0.6), 1.0)
    for bodies, words in (
        ([ball, rigid_sphere("twin", 0.1, (0, 0, 0.5), 1.0)], "'ball' and 'twin' by 0.2 m"),
        ([rigid_sphere("sunk", 0.1, (0, 0, 0.05), 1.0), floor], "'sunk' and 'floor' by 0.05 m"),
        ([ball, box], "'ball' and 'box' by 0.5 m"),
    ):
        with pytest.raises(InputError, match=words):
            last(simulation(bodies, 1, 1e-3, Gap(), held=()))
    with pytest.raises(InputError, match="radius: expected a length > 0"):
        rigid_sphere("ball", -0.1, (0, 0, 0), 1.0)
    with pytest.raises(InputError, match="direction"):
        rigid_plane("floor", (0, 0, 0), (0, 0, 0))
    with pytest.raises(InputError, match="in 2D it is a rigid_sphere"):
        rigid_cylinder("roller", 0.1, 1.0, (0, 0), 1.0)


@pytest.mark.parametrize("d", [2, 3])
def test_mass_properties_by_points_strewn_in_the_body(d: int) -> None:
    """Inertia of a capsule and a cylinder against the mean over random points, to their sampling error."""
    rng = np.random.default_rng(1)
    r, length = 0.3, 0.5
    bodies = [rigid_capsule("capsule", r, length, np.zeros(d), 7.0)]
    points = rng.uniform(-1, 1, (2_000_000, d)) * ([r] * (d - 1) + [r + length / 2])
    off = points.copy()
    off[:, -1] -= np.clip(off[:, -1], -length / 2, length / 2)
    within = [points[np.einsum("nd,nd->n", off, off) <= r**2]]
    if d == 3:
        bodies.append(rigid_cylinder("cylinder", r, length, np.zeros(3), 7.0))
        within.append(points[(np.hypot(points[:, 0], points[:, 1]) <= r) & (np.abs(points[:, 2]) <= length / 2)])
    for body, x in zip(bodies, within, strict=True):
        S = 7.0 * np.einsum("ni,nj->ij", x, x) / len(x)
        inertia = np.trace(S) * np.eye(3) - S if d == 3 else np.array([[np.trace(S)]])
        assert body.inertia == pytest.approx(inertia, abs=3e-3 * np.trace(S))


@pytest.mark.parametrize("length", [1.0, 1e3, 1e6], ids=["m", "mm", "um"])
def test_a_ball_rolls_as_far_in_any_unit_of_length(length: float) -> None:
    """A ball that begins sliding at v rolls from 2 v / (7 mu g) on at 5/7 v, however far it has gone on a plane without a size."""
    radius, mu, v, g = 0.1 * length, 0.2, 2.0 * length, G * length
    bodies = [rigid_plane("floor", (0, 0, 0), (0, 0, 1)), rigid_sphere("ball", radius, (0, 0, radius), mass=5.0)]
    run = simulation(bodies, 100, 4e-3, Gap(), start={"ball": (v, 0, 0, 0, 0, 0)}, mu=mu, gravity=(0, 0, -g))
    steps = list(run)
    moved = [step.state.v[run.model.dof_offset[run.model.number["ball"]]] / v for step in steps]
    assert moved[24] == pytest.approx(1 - mu * g * 0.1 / v, rel=1e-9)
    assert moved[-1] == pytest.approx(5 / 7, rel=1e-9)
    assert not any("thick" in remark for step in steps for remark in step.remarks)
