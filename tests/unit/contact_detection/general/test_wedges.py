"""Corners past each other, of which neither is inside the other body: random polygons and prisms of one depth, against the Minkowski
difference of the polygons."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial import ConvexHull

from fcsim import Gap, Simulation, SolverSettings, State, Theta, Witness
from fcsim.assembly.model import Model, build_model
from fcsim.contact_detection import Everything
from fcsim.mesh.part import RigidBody
from fcsim.mesh.solids.rigid_polygon import rigid_polygon
from tests.unit.contact_detection.general.rocks import body

DEPTH = 0.7


def polygon(rng: np.random.Generator) -> np.ndarray:
    angle = np.sort(rng.uniform(0, 2 * np.pi, int(rng.integers(3, 9))))
    points = np.stack([np.cos(angle), np.sin(angle)], axis=1) * [1, rng.uniform(0.3, 1)]
    points = points[ConvexHull(points).vertices]
    return (points - points.mean(axis=0)) @ turn(rng.uniform(0, 2 * np.pi))


def turn(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


def corner_on_corner(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Two polygons, a corner of one beside a corner of the other, by up to 5 % of their size."""
    p, q = polygon(rng), polygon(rng)
    way = rng.normal(size=2)
    way *= 10 ** rng.uniform(-3.5, -1.3) / np.linalg.norm(way)
    return p, q + p[rng.integers(len(p))] - q[rng.integers(len(q))] + way


def signed_distance(p: np.ndarray, q: np.ndarray) -> float:
    """Of convex polygons that overlap, or whose nearest features are a side and a corner: the largest of the sides' distances."""
    return float(ConvexHull((p[:, None] - q[None]).reshape(-1, 2)).equations[:, 2].max())


def flat(name: str, points: np.ndarray) -> RigidBody:
    return rigid_polygon(name, points, mass=1.0)


def prism(name: str, points: np.ndarray) -> RigidBody:
    """The polygon in the plane of x and z from y = 0 to y = DEPTH."""
    n = len(points)
    k = np.arange(n)
    following = (k + 1) % n
    sides = np.concatenate([np.stack([k, following, n + following], axis=1), np.stack([k, n + following, n + k], axis=1)])
    fan = np.stack([np.zeros(n - 2, dtype=int), k[1:-1], k[2:]], axis=1)
    triangles = np.concatenate([sides, fan[:, ::-1], n + fan])
    x = np.concatenate([np.insert(points, 1, y, axis=1) for y in (0.0, DEPTH)])
    return body(name, x, triangles[:, ::-1])


def model_of(p: np.ndarray, q: np.ndarray, dimension: int) -> Model:
    make = flat if dimension == 2 else prism
    return build_model([make("one", p), make("other", q)])


@pytest.mark.each_value
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("seed", range(3))
def test_what_overlaps_at_its_corners_has_a_contact(dimension: int, seed: int) -> None:
    rng, seen = np.random.default_rng(seed), 0
    while seen < 60:
        p, q = corner_on_corner(rng)
        if -0.2 < signed_distance(p, q) < -2e-4:
            seen += 1
            model = model_of(p, q, dimension)
            assert Everything(model, 0.5)(model.reference).gap.min(initial=0.0) < -1e-4


@pytest.mark.parametrize("dimension", [2, 3])
def test_what_does_not_overlap_has_no_contact_that_says_so(dimension: int) -> None:
    rng, seen = np.random.default_rng(0), 0
    while seen < 60:
        p, q = corner_on_corner(rng)
        if signed_distance(p, q) > 1e-9:
            seen += 1
            model = model_of(p, q, dimension)
            assert Everything(model, 0.5)(model.reference).gap.min(initial=0.0) > -1e-9


LEAN = 0.13


def voussoirs(past: float, higher: float) -> tuple[np.ndarray, np.ndarray]:
    """Blocks whose upper inner corners stick out, the left one's past the right one's and above it; both upper sides fall outwards."""
    left = np.array([[-1.0, -1.1], [-LEAN, -1.0], [0.0, 0.0], [-1.0, -0.1]])
    right = (left * [-1, 1])[::-1]
    return np.add(left, [past / 2, higher]), np.subtract(right, [past / 2, 0.0])


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("higher", [0.0, 1e-5, -1e-5, 1e-4])
def test_both_corners_outside(dimension: int, higher: float) -> None:
    """They overlap by 1 % of their width across the inner sides, the lower corner behind the higher block's side or the other way round;
    both corners are above the other's upper side."""
    p, q = voussoirs(1e-2, higher)
    model = model_of(p, q, dimension)
    contacts = Everything(model, 0.5)(model.reference)
    exact = signed_distance(p, q)
    assert_allclose(exact, -(1e-2 - LEAN * abs(higher)) / np.hypot(1, LEAN), rtol=1e-9)
    assert_allclose(contacts.gap.min(), exact, rtol=1e-9)
    deep = contacts.take(contacts.gap < 0.5 * exact)
    assert len(deep) == (1 if dimension == 2 else 2)
    assert_allclose(np.abs(deep.frame[:, 0, 0]), 1 / np.hypot(1, LEAN), rtol=1e-9)
    if dimension == 3:
        assert_allclose(np.sort(deep.point[:, 1]), [0.0, DEPTH], atol=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("higher", [1e-5, -3e-6])
def test_corners_that_meet_head_on_do_not_pass(dimension: int, higher: float) -> None:
    """At 0.5 m/s each, 4 mm a step: without gravity nothing is created, momentum stays, and neither enters the other."""
    p, q = voussoirs(-5e-3, higher)
    model = model_of(p, q, dimension)
    v = np.zeros(model.n_dofs)
    model.rigid_part(v)[:, 0] = [0.5, -0.5]
    start = State(0.0, np.zeros(model.n_dofs), v)
    watched = Witness(every=1, tolerance=1e-3)
    sim = Simulation(
        model, Everything(model, 0.5), Theta(4e-3, 0.5, Gap()), 15, SolverSettings(name="auto", tol=1e-8), initial=start, witness=watched
    )
    *_, last = sim
    v = model.rigid_part(last.state.v)
    assert_allclose(v[:, 0].sum(), 0.0, atol=1e-9)
    assert v[0, 0] < 0.499  # they have met
    assert last.ledger.created < 1e-6


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("gap", [1e-9, -1e-9, -1e-6])
def test_a_corner_at_rest_does_not_hide_an_overlap_elsewhere(dimension: int, gap: float) -> None:
    """A corner of a block rests on a blade; another one has gone through the blade's tip and is outside again, 2 % of a side beyond it."""
    blade = np.array([[0.0, 0.0], [0.9, -0.1], [1.0, 0.0]])
    block = np.array([[0.05, 0.3], [0.05, -0.02], [0.7, gap], [0.7, 0.3]])
    overlap = block[1, 1] - blade[1, 1] / 0.9 * 0.05  # the corner is below the blade by that
    assert overlap < -0.01
    model = model_of(block, blade, dimension)
    assert Everything(model, 0.5)(model.reference).gap.min() < -1e-3
