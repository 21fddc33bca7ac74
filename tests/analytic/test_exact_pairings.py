"""Exact contactors in pairings of their own: ridges, ends on sides, drums, inclines; friction of rolling bodies, periods, tipping."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim import Gap, RigidBody, Velocity
from fcsim.mesh import rigid_capsule, rigid_cylinder, rigid_plane, rigid_sphere
from tests.analytic.test_exact_shapes import G, last, of, simulation

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def ridge(width: float, unit: float) -> RigidBody:
    """A held prism "floor" with a sharp ridge along y at height 0, its sides falling by 45 degrees."""
    a, b = width, 2.0 * unit
    points = np.array([[-a, -b, -a], [a, -b, -a], [0, -b, 0], [-a, b, -a], [a, b, -a], [0, b, 0]])
    triangles = np.array([[0, 1, 2], [3, 5, 4]])
    quads = np.array([[1, 4, 5, 2], [0, 2, 5, 3], [0, 3, 4, 1]])
    return RigidBody("floor", 1.0, np.eye(3), points.mean(axis=0), points, {"ends": triangles, "sides": quads})


@pytest.mark.parametrize("kind", ["capsule", "cylinder"])
@pytest.mark.parametrize(("unit", "mass"), [(100.0, 1e-9), pytest.param(1.0, 2.0, marks=pytest.mark.slow)])
def test_a_rod_across_a_ridge_balances_or_tips(kind: str, unit: float, mass: float) -> None:
    """Across a sharp edge of a facetted body: at its middle it rests on one point; moved along by a it tips about the edge, with m g a /
    (I + m (a^2 + R^2)), as long as friction holds it (it does: the reaction is nearly vertical)."""
    make = rigid_capsule if kind == "capsule" else rigid_cylinder
    R, length, h, n = 0.05 * unit, 0.6 * unit, 1e-3, 10
    for a in (0.0, 0.1 * unit):
        rod = make("rod", R, length, (a, 0.0, R), mass, axis=X)
        run = simulation([rod, ridge(0.3 * unit, unit)], n, h, Gap(), mu=0.6)
        step = last(run)
        I = float(rod.inertia[1, 1])
        turned = mass * G * a / (I + mass * (a**2 + R**2)) * n * h
        assert_allclose(of(step, "rod")[4], turned, rtol=2e-3, atol=1e-7)
        up = step.contact_force_on(step.model.number["rod"])
        assert_allclose(up[2], mass * G * (1 - a**2 * mass / (I + mass * (a**2 + R**2))), rtol=5e-3)


@pytest.mark.parametrize(("height", "stands"), [(0.3, True), (0.55, False)])
def test_a_drum_on_its_end_on_a_log(height: float, stands: bool) -> None:
    """A flat end on the side of a lying cylinder of radius R = 0.2: it rocks on it stably iff the middle of the drum lies less than R above
    the contact, height / 2 < R; let go a little turned it comes back, or goes on."""
    R, r, m, tilt = 0.2, 0.15, 2.0, 0.01
    log = rigid_cylinder("floor", R, 1.0, (0, 0, -R), 1.0, axis=Y)
    # rolled by tilt about y without sliding: the contact moves to R tilt, the end's middle lies R tilt up along the end
    normal, along = np.array([np.sin(tilt), 0, np.cos(tilt)]), np.array([np.cos(tilt), 0, -np.sin(tilt)])
    centre = np.array([0, 0, -R]) + R * normal - R * tilt * along + 0.5 * height * normal
    drum = rigid_cylinder("drum", r, height, centre, m, axis=tuple(normal))
    steps = list(simulation([drum, log], 30, 2e-3, Gap(), mu=0.8))
    spin = of(steps[-1], "drum")[4]
    # about the contact: (I + m (h/2)^2) tilt'' = m g (h/2 - R) tilt
    I = m * (3 * r**2 + height**2) / 12 + m * (0.5 * height) ** 2
    rate = m * G * (0.5 * height - R) / I
    t = steps[-1].state.t
    exact = tilt * np.sqrt(rate) * np.sinh(np.sqrt(rate) * t) if rate > 0 else -tilt * np.sqrt(-rate) * np.sin(np.sqrt(-rate) * t)
    assert (spin > 0) != stands
    assert_allclose(spin, exact, rtol=0.05)


def facetted_drum(radius: float, width: float, n: int) -> RigidBody:
    """A held hollow drum "floor" along y, its inside of n facets that touch a circle."""
    at = 2 * np.pi * (np.arange(n) + 0.5) / n - np.pi / 2
    ring = radius / np.cos(np.pi / n) * np.stack([np.cos(at), np.sin(at)], axis=1)
    ends = [np.column_stack([ring[:, 0], np.full(n, y), ring[:, 1]]) for y in (-0.5 * width, 0.5 * width)]
    k, after = np.arange(n), (np.arange(n) + 1) % n
    return RigidBody("floor", 1.0, np.eye(3), np.zeros(3), np.vstack(ends), {"inside": np.column_stack([k, after, after + n, k + n])})


@pytest.mark.slow
def test_a_ball_swings_in_a_drum() -> None:
    """A ball that rolls in a drum: T = 2 pi sqrt(7 (R - r) / (5 g)); in facets, within what their corners take from it."""
    R, r, n = 1.0, 0.1, 120
    begin = 0.15
    centre = (R - r) * np.array([np.sin(begin), 0, -np.cos(begin)])
    ball = rigid_sphere("ball", r, centre, 2.0)
    h, T = 1e-2, 2 * np.pi * np.sqrt(7 * (R - r) / (5 * G))
    steps = list(simulation([ball, facetted_drum(R, 1.0, n)], int(0.3 * T / h), h, Gap(), mu=0.9))
    x = np.array([of(step, "ball", "x")[0] for step in steps]) + centre[0]
    t = np.array([step.state.t for step in steps])
    crossing = np.flatnonzero((x[:-1] > 0) & (x[1:] <= 0))[0]
    assert_allclose(t[crossing], T / 4, rtol=0.03)


@pytest.mark.parametrize("unit", [1.0, pytest.param(1e3, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("kind", "share"), [("ball", 2 / 7), ("roller", 1 / 3), ("disk", 1 / 3)])
def test_what_rolls_down_an_incline_is_held_back_by_its_share_of_friction(kind: str, share: float, unit: float) -> None:
    """F = 2/7 (ball), 1/3 (cylinder, disk) of m g sin(alpha), iff that is no more than mu m g cos(alpha); else mu m g cos(alpha) and it
    slides: a = g (sin - mu cos)."""
    alpha, R, m = np.radians(25), 0.1 * unit, 3.0
    d = 2 if kind == "disk" else 3
    up = np.eye(d)[-1]
    pull = G * unit * (np.sin(alpha) * np.eye(d)[0] - np.cos(alpha) * up)
    body = rigid_cylinder("body", R, 3 * R, R * up, m, axis=Y) if kind == "roller" else rigid_sphere("body", R, R * up, m)
    floor = rigid_plane("floor", np.zeros(d), up.tolist(), size=unit)
    limit = share * np.tan(alpha)
    for mu in (1.02 * limit, 0.9 * limit):
        step = last(simulation([body, floor], 20, 2e-3, Gap(), mu=mu, gravity=pull))
        held = min(share * np.sin(alpha), mu * np.cos(alpha))
        assert_allclose(-step.contact_force_on(step.model.number["body"])[0], held * m * G * unit, rtol=1e-6)
        assert_allclose(of(step, "body")[0], (np.sin(alpha) - held) * G * unit * step.state.t, rtol=1e-6)


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_a_ball_bounces_on_a_box_edge_and_on_a_capsule(e: float) -> None:
    """It falls centrally: v+ = -e v- on a sharp ridge, on the side of a capsule, on another ball; nothing turns."""
    R, v0 = 0.1, 1.0
    below = {
        "ridge": ridge(0.3, 1.0),
        "capsule": rigid_capsule("floor", 0.2, 1.0, (0, 0, -0.2), 1.0, axis=X),
        "ball": rigid_sphere("floor", 0.2, (0, 0, -0.2), 1.0),
    }
    for name, floor in below.items():
        ball = rigid_sphere("ball", R, (0, 0, R), 2.0)
        run = simulation([ball, floor], 2, 1e-3, Velocity(e), start={"ball": (0, 0, -v0, 0, 0, 0)}, gravity=np.zeros(3), mu=0.5)
        v = of(last(run), "ball")
        assert_allclose(v, [0, 0, e * v0, 0, 0, 0], atol=1e-8, err_msg=name)
