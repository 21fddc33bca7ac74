"""Flat faces on each other: the contacts are the corners of the patch that both share, by exact rational clipping of random polygons."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from fcsim.assembly.model import build_model
from fcsim.contact_detection import Everything
from fcsim.mesh.part import RigidBody

Point = tuple[Fraction, Fraction]
NEAR = 3e-5  # of the bodies' size: places nearer are one
seeded = settings(
    max_examples=60, derandomize=True, deadline=None, suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow]
)


@st.composite
def polygons(draw: st.DrawFn) -> np.ndarray:
    """Convex polygons of 3 to 20 corners on a grid of 1/1024, counter-clockwise, their extents 1 to 1/10, near the origin."""
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, draw(st.integers(3, 20))))
    flat = np.column_stack([np.cos(angle), rng.uniform(0.1, 1) * np.sin(angle)])
    turn = rng.uniform(0, np.pi)
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    points = np.round(1024 * (flat @ R.T + rng.uniform(-0.6, 0.6, 2))) / 1024
    points = np.unique(points, axis=0)
    assume(len(points) >= 3 and np.linalg.matrix_rank(points[1:] - points[0]) == 2)
    corners = points[ConvexHull(points).vertices]
    side = np.roll(corners, -1, axis=0) - corners
    bend = side[:, 0] * np.roll(side, -1, axis=0)[:, 1] - side[:, 1] * np.roll(side, -1, axis=0)[:, 0]
    lengths = np.linalg.norm(side, axis=1)
    assume(np.all(bend > 0.02 * lengths * np.roll(lengths, -1)) and lengths.min() > 0.02)
    return corners


def clipped(subject: np.ndarray, window: np.ndarray) -> list[Point]:
    """Sutherland and Hodgman's clipping (Communications of the ACM 17, 1974) in rational numbers: no error at all."""
    result = [(Fraction(x), Fraction(y)) for x, y in subject]
    corners = [(Fraction(x), Fraction(y)) for x, y in window]
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
        inside = [(bx - ax) * (y - ay) - (by - ay) * (x - ax) for x, y in result]
        cut: list[Point] = []
        for k, (p, s) in enumerate(zip(result, inside, strict=True)):
            q, t = result[(k + 1) % len(result)], inside[(k + 1) % len(result)]
            if s >= 0:
                cut.append(p)
            if s * t < 0:
                share = s / (s - t)
                cut.append((p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])))
        result = cut
    return result


def prism(name: str, polygon: np.ndarray, low: float, high: float) -> RigidBody:
    """The polygon between two heights, its faces cut into fans of triangles."""
    n = len(polygon)
    points = np.concatenate([np.pad(polygon, ((0, 0), (0, 1)), constant_values=z) for z in (low, high)])
    k = np.arange(n)
    sides = np.stack([k, (k + 1) % n, (k + 1) % n + n, k + n], axis=1)
    fan = np.stack([np.zeros(n - 2, dtype=int), k[1:-1], k[2:]], axis=1)
    faces = {"sides": sides, "low": fan[:, ::-1], "high": fan + n}
    return RigidBody(name, 1.0, np.eye(3), points.mean(axis=0), points, faces)


def area(points: np.ndarray) -> float:
    return ConvexHull(points).volume if len(points) > 2 and np.linalg.matrix_rank(points[1:] - points[0], tol=1e-9) == 2 else 0.0


@seeded
@given(polygons(), polygons(), st.integers(0, 5))
def test_the_patch_of_two_prisms(lower: np.ndarray, upper: np.ndarray, placing: int) -> None:
    """Its corners are contacts, all contacts are in it and along the faces' normal, whatever way the pair stands in space."""
    patch = clipped(upper, lower)
    exact = np.array([[float(x), float(y)] for x, y in patch]).reshape(-1, 2)
    shared = area(np.unique(exact, axis=0)) if len(exact) else 0.0
    assume(shared == 0 or shared > 1e-3)
    R, shift = (np.eye(3), np.zeros(3)) if placing == 0 else (Rotation.random(random_state=placing).as_matrix(), np.arange(3.0) * placing)
    bodies = [prism("lower", lower, -0.5, 0.0), prism("upper", upper, 0.0, 0.7)]
    model = build_model(bodies)
    found = Everything(model, 0.5, alert=1e-3)(model.reference @ R.T + shift)
    level = found.take(np.abs(found.frame[:, 0] @ R[:, 2]) > 0.99)
    points = (level.point - shift) @ R
    if shared == 0:
        return  # merely meeting along a line or not at all: what is held there is held by other rules
    np.testing.assert_allclose(np.abs(level.frame[:, 0] @ R[:, 2]), 1, atol=1e-12)
    np.testing.assert_allclose(level.gap, 0, atol=1e-12)
    for corner in exact:
        assert np.linalg.norm(points[:, :2] - corner, axis=1).min() < NEAR
    assert abs(area(points[:, :2]) - shared) < 10 * NEAR


@seeded
@given(polygons(), polygons(), st.floats(1e-6, 9e-4))
def test_the_patch_of_prisms_a_little_apart_or_within_each_other(lower: np.ndarray, upper: np.ndarray, height: float) -> None:
    """The same patch at any small height, above or below, with that gap."""
    patch = np.array([[float(x), float(y)] for x, y in clipped(upper, lower)]).reshape(-1, 2)
    assume(len(patch) > 2 and area(np.unique(patch, axis=0)) > 1e-3)
    for gap in (height, -height):
        model = build_model([prism("lower", lower, -0.5, 0.0), prism("upper", upper, gap, gap + 0.7)])
        found = Everything(model, 0.5, alert=1e-3)(model.reference)
        level = found.take(np.abs(found.frame[:, 0, 2]) > 0.99)
        np.testing.assert_allclose(level.gap, gap, atol=1e-12)
        off = np.array([np.linalg.norm(level.point[:, :2] - corner, axis=1).min(initial=np.inf) for corner in patch])
        assert np.all(off < NEAR)


@pytest.mark.parametrize("degrees", [15, 30, 40, 50, 60, 75, 90, 120])
@pytest.mark.parametrize("turn", [0.0, 1e-6, 1e-4, 1e-2])
def test_sharp_corners_with_flush_sides_stand_on_their_face(degrees: float, turn: float) -> None:
    """Triangular blocks on each other, slightly in each other and slightly turned: a corner was paired with the side that it is flush
    with, at a gap of 0, and fell through the face below."""
    a = np.deg2rad(degrees)
    triangle = np.array([[0, 0], [1, 0], [np.cos(a), np.sin(a)]])
    turned = triangle @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    for gap in (1e-4, 0.0, -1e-7, -1e-5, -1e-3):
        model = build_model([prism("lower", triangle, -0.5, 0.0), prism("upper", turned, gap, gap + 0.7)])
        found = Everything(model, 0.5, alert=1e-3)(model.reference)
        level = found.take(np.abs(found.frame[:, 0, 2]) > 0.99)
        np.testing.assert_allclose(level.gap, gap, atol=1e-9)
        for corner in triangle:
            assert np.linalg.norm(level.point[:, :2] - corner, axis=1).min(initial=np.inf) < max(NEAR, 3 * turn)


@settings(seeded, max_examples=10)
@given(polygons(), polygons(), st.integers(0, 2**31 - 1), st.sampled_from([2e-2, 2e-3, 1e-5, -1e-5, -1e-3, -2e-2]))
def test_prisms_in_any_position(one: np.ndarray, other: np.ndarray, seed: int, distance: float) -> None:
    """At a signed distance, exact by the Minkowski difference: none beyond the alert distance, the gap where near, always one where
    they overlap; where they do by little, the same contacts when both are moved and swapped."""
    rng = np.random.default_rng(seed)
    bodies = [prism("one", one, 0.0, 0.3), prism("other", other, 0.0, 0.5)]
    p, q = (body.points @ Rotation.random(random_state=int(rng.integers(2**31))).as_matrix().T for body in bodies)
    p, q = p - p.mean(axis=0), q - q.mean(axis=0)
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    planes = ConvexHull((p[:, None] - q[None]).reshape(-1, 3)).equations
    near, far = 0.0, 9.0
    for _ in range(80):
        middle = 0.5 * (near + far)
        near, far = (middle, far) if (planes[:, :3] @ (middle * way) + planes[:, 3]).max() < distance else (near, middle)
    places = [p, q + near * way]
    if distance > 0:  # the planes' height is the distance where the nearest feature is a face of the difference
        n, start = len(p), np.concatenate([np.full(len(x), 1 / len(x)) for x in places])
        sums = [{"type": "eq", "fun": lambda w: w[:n].sum() - 1}, {"type": "eq", "fun": lambda w: w[n:].sum() - 1}]
        separated = minimize(
            lambda w: np.sum((w[:n] @ places[0] - w[n:] @ places[1]) ** 2), start, method="SLSQP", bounds=[(0, 1)] * len(start),
            constraints=sums, options={"maxiter": 300, "ftol": 1e-14},
        )  # fmt: skip
        assume(abs(np.sqrt(separated.fun) - distance) < 1e-6)
    placed = [RigidBody(b.name, 1.0, np.eye(3), x.mean(axis=0), x, b.surfaces) for b, x in zip(bodies, places, strict=True)]
    model = build_model(placed)
    found = Everything(model, 0.5, alert=5e-3)(model.reference)
    if distance > 5e-3:
        assert len(found) == 0
        return
    assert found.gap.min(initial=np.inf) < max(distance, 0) + 1e-9
    if distance < -1e-3:
        return
    assert np.abs(found.gap - distance).min() < 1e-9
    R = Rotation.random(random_state=seed % 2**31).as_matrix()
    moved = Everything(model, 0.5, alert=5e-3)(model.reference @ R.T + [3.0, -2.0, 1.0])
    np.testing.assert_allclose(np.sort(moved.gap), np.sort(found.gap), atol=1e-9)
    swapped = build_model(placed[::-1])
    np.testing.assert_allclose(np.sort(Everything(swapped, 0.5, alert=5e-3)(swapped.reference).gap), np.sort(found.gap), atol=1e-9)
