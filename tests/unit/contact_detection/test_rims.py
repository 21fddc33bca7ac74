"""Rims of two cylinders that cross in space, placed so that a plane parts them at a known distance: convexity makes that the gap."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from fcsim import Gap, Simulation, State, Theta, at_rest, build_model
from fcsim.contact_detection.exact import ExactContacts
from fcsim.mesh import RigidBody, rigid_box, rigid_cylinder
from fcsim.mesh.exact.rigid_polyhedron import rigid_polyhedron


def pair(rng: np.random.Generator, gap: float, unit: float) -> tuple[list[RigidBody], np.ndarray]:
    """Two cylinders, their sizes 1 to 10, whose rims' points p and q have p - q = gap N with N well inside both normal cones."""
    while True:
        turns = Rotation.random(2, random_state=int(rng.integers(2**31))).as_matrix()
        (out_a, t_a, end_a), (out_b, t_b, end_b) = (R.T for R in turns)
        N = np.cross(t_a, t_b)
        sine = np.linalg.norm(N)
        N = N / sine * np.sign(N @ (out_b + end_b))
        if sine > 0.2 and min(N @ out_b, N @ end_b, -N @ out_a, -N @ end_a) > 0.1:
            break
    (ra, rb), (la, lb) = unit * 10 ** rng.uniform(-1, 0, (2, 2))
    q = unit * rng.normal(size=3)
    p = q + gap * N
    centres = p - ra * out_a - 0.5 * la * end_a, q - rb * out_b - 0.5 * lb * end_b
    one = rigid_cylinder("a", ra, la, centres[0], 1.0, axis=end_a * rng.choice([-1, 1]))
    return [one, rigid_cylinder("b", rb, lb, centres[1], 1.0, axis=end_b * rng.choice([-1, 1]))], N


@pytest.mark.each_value
@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("gap", [4e-3, 1e-6, 0.0, -1e-6, -1e-3])
def test_rims_that_cross(gap: float, unit: float) -> None:
    """The gap and the normal are exact; where the cylinders are apart there is no nearer contact."""
    rng = np.random.default_rng(7)
    for _ in range(40):
        bodies, N = pair(rng, gap * unit, unit)
        model = build_model(bodies)
        found = ExactContacts(model, 0.5, alert=5e-3 * unit)(model.reference)
        normal = np.where(found.bodies[:, :1] == 0, 1.0, -1.0) * found.frame[:, 0]
        at = np.argmin(np.abs(found.gap - gap * unit) + unit * np.linalg.norm(normal - N, axis=1))
        assert_allclose(found.gap[at], gap * unit, atol=1e-10 * unit)
        assert_allclose(normal[at], N, atol=1e-7)
        if gap > 0:
            assert_allclose(found.gap.min(), gap * unit, atol=1e-10 * unit)


def wedge_and_cylinder(rng: np.random.Generator, gap: float, unit: float) -> tuple[list[RigidBody], np.ndarray]:
    """A cylinder whose rim is `gap` off the upper edge of a box, N well inside both normal cones."""
    size = unit * 10 ** rng.uniform(-1, 0, 3)
    while True:
        out, tangent, axis = Rotation.random(random_state=int(rng.integers(2**31))).as_matrix().T
        N = np.cross(tangent, [0, 1, 0])
        sine = np.linalg.norm(N)
        N = N / sine * np.sign(N[0] + N[2])
        if sine > 0.2 and min(N[0], N[2], -N @ out, -N @ axis) > 0.1:
            break
    radius, length = unit * 10 ** rng.uniform(-1, 0, 2)
    q = np.array([0.5 * size[0], rng.uniform(-0.3, 0.3) * size[1], 0.5 * size[2]])
    centre = q + gap * N - radius * out - 0.5 * length * axis
    R, shift = Rotation.random(random_state=int(rng.integers(2**31))).as_matrix(), unit * rng.normal(size=3)
    box = rigid_box("b", tuple(size), (0, 0, 0), 1.0, divisions=tuple(rng.integers(1, 3, 3)))
    box = RigidBody("b", 1.0, np.eye(3), shift, box.points @ R.T + shift, box.surfaces)
    return [rigid_cylinder("a", radius, length, R @ centre + shift, 1.0, axis=R @ axis), box], R @ N


@pytest.mark.each_value
@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("gap", [4e-3, 1e-6, 0.0, -1e-6, -1e-3])
def test_rims_that_cross_the_edge_of_a_box(gap: float, unit: float) -> None:
    rng = np.random.default_rng(11)
    for _ in range(40):
        bodies, N = wedge_and_cylinder(rng, gap * unit, unit)
        model = build_model(bodies)
        found = ExactContacts(model, 0.5, alert=5e-3 * unit)(model.reference)
        at = np.argmin(np.abs(found.gap - gap * unit) + unit * np.linalg.norm(found.frame[:, 0] - N, axis=1))
        assert_allclose(found.gap[at], gap * unit, atol=1e-10 * unit)
        assert_allclose(found.frame[at, 0], N, atol=1e-7)
        if gap > 0:
            assert_allclose(found.gap.min(), gap * unit, atol=1e-10 * unit)


@pytest.mark.parametrize("seed", range(2))
def test_nothing_beyond_the_alert_distance(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(40):
        model = build_model(pair(rng, 1.01e-2, 1.0)[0])
        assert len(ExactContacts(model, 0.5, alert=1e-2)(model.reference)) == 0
        model = build_model(wedge_and_cylinder(rng, 1.01e-2, 1.0)[0])
        assert len(ExactContacts(model, 0.5, alert=1e-2)(model.reference)) == 0


def test_cylinders_that_meet_with_their_rims_bounce_off_each_other() -> None:
    """Frictionless, one flies along -N: they fall into the common normal's rest, N . (v_p - v_q) = 0, and keep both momenta."""
    bodies, N = pair(np.random.default_rng(3), 0.02, 1.0)
    model = build_model(bodies)
    start = at_rest(model)
    v = start.v.copy()
    v[:3] = -N
    steps = list(Simulation(model, ExactContacts(model, 0.0), Theta(1e-3, 0.5, Gap()), 30, initial=State(0.0, start.x, v)))
    met = next(step for step in steps if step.result.r.any())
    assert met.number == pytest.approx(20, abs=2)
    touching = steps[met.number]  # the next one: the first still closes what is left of the gap
    assert np.all((touching.H.T @ touching.state.v).reshape(-1, 3)[:, 0] > -1e-2)  # 1 m/s before
    masses = np.array([body.mass for body in model.rigid])
    assert_allclose(masses @ model.rigid_part(met.state.v)[:, :3], -masses[0] * N, atol=1e-9)
    assert all(step.overlap.share < 1e-4 for step in steps if step.overlap is not None)


@pytest.mark.parametrize("over", [-1e-5, -1e-8, 1e-8, 1e-6, 5e-5])
def test_a_sharp_edge_that_lies_a_hair_within_a_rim_is_held(over: float) -> None:
    """A blade of 30 degrees leans over the rim of a lying cylinder, whose plane across N parts the two; `over` [m] less they overlap. From
    its edge the way against N leaves the blade by its other face."""
    cylinder = rigid_cylinder("cylinder", 0.1, 0.3, (0, 0, 0), 1.0, axis=(1, 0, 0))
    rim, out = np.array([0.15, 0.0, 0.1]), np.array([0.25, 0.0, 1.0]) / np.hypot(0.25, 1.0)
    along = np.cos(1.0) * np.array([0.0, 1.0, 0.0]) + np.sin(1.0) * np.cross(out, (0.0, 1.0, 0.0))
    beside = np.cross(along, out)
    sides = [np.cos(angle) * out + np.sin(angle) * beside for angle in np.radians([55.0, 85.0])]
    ends = [rim - over * out + end * along for end in (-0.3, 0.3)]
    points = np.array([end + 0.3 * side for end in ends for side in (*sides, np.zeros(3))])
    model = build_model([cylinder, rigid_polyhedron("blade", points, 1000.0)])
    found = ExactContacts(model, 0.3)(model.reference)
    held = found.take(np.abs(found.frame[:, 0] @ out) > 1 - 1e-4)
    assert len(held) == 1
    assert held.gap[0] == pytest.approx(-over, abs=1e-3 * abs(over) + 1e-12)
