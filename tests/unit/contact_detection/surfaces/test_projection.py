"""Closest points on single facets against closed forms and against an independent minimisation of the distance."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize, minimize_scalar

from fcsim.contact_detection.surfaces.projection import (
    closest_on_boundary,
    project_on_quadrilaterals,
    project_on_segments,
    project_on_triangles,
)

SQUARE = np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]])


def rotation(seed: int) -> np.ndarray:
    q = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return q * np.linalg.det(q)


def test_rectangle() -> None:
    feet = project_on_quadrilaterals(np.array([[0.5, 0.25, 0.3]]), SQUARE[None])
    assert feet.inside.all()
    np.testing.assert_allclose(feet.weights[0], [0.75 * 0.75, 0.25 * 0.75, 0.25 * 0.25, 0.75 * 0.25], atol=1e-15)
    np.testing.assert_allclose(feet.normal[0], [0, 0, 1], atol=1e-15)


@pytest.mark.parametrize("seed", range(5))
def test_tilted_plane_trapezium(seed: int) -> None:
    """A plane facet that is no parallelogram, turned in space: the foot is the orthogonal projection on its plane."""
    R = rotation(seed)
    corners = np.array([[0.0, 0, 0], [2, 0.1, 0], [1.5, 1, 0], [0.2, 1.3, 0]]) @ R.T
    generator = np.random.default_rng(seed)
    plane = generator.dirichlet(np.ones(4), 20) @ corners
    points = plane + generator.uniform(-0.5, 0.5, (20, 1)) * R[:, 2]
    feet = project_on_quadrilaterals(points, np.broadcast_to(corners, (20, 4, 3)))
    assert feet.inside.all()
    np.testing.assert_allclose(feet.weights @ corners, plane, atol=1e-13)
    np.testing.assert_allclose(feet.normal, np.broadcast_to(R[:, 2], (20, 3)), atol=1e-13)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6))
def test_warped_quadrilateral_against_minimisation(seed: int) -> None:
    generator = np.random.default_rng(seed)
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) + generator.uniform(-0.2, 0.2, (4, 3))
    point = np.append(generator.uniform(-0.7, 0.7, 2), generator.uniform(-0.5, 0.5))

    def foot(s: np.ndarray) -> np.ndarray:
        low, high = corners[0] + s[0] * (corners[1] - corners[0]), corners[3] + s[0] * (corners[2] - corners[3])
        return low + s[1] * (high - low)

    def half_square(s: np.ndarray) -> float:
        return 0.5 * np.sum((foot(s) - point) ** 2)

    best = minimize(half_square, [0.5, 0.5], bounds=[(0, 1), (0, 1)], method="L-BFGS-B", options={"ftol": 1e-16, "gtol": 1e-12})
    found = project_on_quadrilaterals(point[None], corners[None])
    assert found.inside.all()
    x = found.weights[0] @ corners
    np.testing.assert_allclose(x, foot(best.x), atol=2e-6)
    assert 0.5 * np.sum((x - point) ** 2) <= best.fun + 1e-14
    # the line to the point is along the normal at the foot
    assert np.linalg.norm(np.cross(point - x, found.normal[0])) < 1e-12
    assert found.normal[0, 2] > 0


def test_triangle() -> None:
    R, shift = rotation(1), np.array([0.3, -2.0, 5.0])
    corners = np.array([[0.0, 0, 0], [3, 0, 0], [0, 2, 0]]) @ R.T + shift
    local = np.array([[1.0, 0.5, 0.2], [1, 0.5, -0.4], [2, 1.5, 0.1], [-0.1, 1, 0.0]])
    feet = project_on_triangles(local @ R.T + shift, np.broadcast_to(corners, (4, 3, 3)))
    np.testing.assert_array_equal(feet.inside, [True, True, False, False])
    np.testing.assert_allclose(feet.weights[:2], [[1 - 1 / 3 - 1 / 4, 1 / 3, 1 / 4]] * 2, atol=1e-14)
    np.testing.assert_allclose(feet.normal, np.broadcast_to(R[:, 2], (4, 3)), atol=1e-14)


def test_segment() -> None:
    corners = np.broadcast_to(np.array([[1.0, 1], [4, 5]]), (4, 2, 2))  # along (3, 4)/5, outward (4, -3)/5
    along, outward = np.array([3.0, 4]) / 5, np.array([4.0, -3]) / 5
    where = np.array([[2.0, 0.5], [2, -0.5], [-0.04, 0], [-0.06, 0]])
    points = np.array([1.0, 1]) + where[:, :1] * along + where[:, 1:] * outward
    feet = project_on_segments(points, corners)
    np.testing.assert_array_equal(feet.inside, [True, True, False, False])
    np.testing.assert_allclose(feet.weights, np.array([[0.6, 0.4], [0.6, 0.4], [1, 0], [1, 0]]), atol=1e-14)
    np.testing.assert_allclose(feet.normal, np.broadcast_to(outward, (4, 2)), atol=1e-15)


@pytest.mark.parametrize(("offset", "inside"), [(-1e-6, True), (0.0, False), (0.01, False), (3.0, False)])
def test_an_edge_is_not_inside(offset: float, inside: bool) -> None:
    point = np.array([[2.0 + offset, 0.5, 0.1]])
    feet = project_on_quadrilaterals(point, SQUARE[None])
    assert bool(feet.inside[0]) == inside
    np.testing.assert_allclose(feet.weights[0] @ SQUARE, np.array([min(2.0 + offset, 2.0), 0.5, 0.0]), atol=1e-14)


@pytest.mark.parametrize("k", [3, 4])
@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_nearest_edge_point_against_minimisation(k: int, seed: int) -> None:
    generator = np.random.default_rng(seed)
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])[:k] + generator.uniform(-0.2, 0.2, (k, 3))
    point = generator.uniform(-3, 3, 3)
    no = np.zeros((1, k), dtype=bool)
    found = closest_on_boundary(point[None], corners[None], no, no, np.zeros(1))
    least = min(
        minimize_scalar(
            lambda t, a=a, b=b: np.linalg.norm(a + t * (b - a) - point), bounds=(0, 1), method="bounded", options={"xatol": 1e-9}
        ).fun
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)
    )
    assert abs(np.linalg.norm(found.weights[0] @ corners - point) - least) < 1e-7
    assert not found.interior[0]


def test_edge_inside_the_surface_beyond_its_end() -> None:
    """Above the end of an edge (side 0 of the square) that lies inside the surface and ends at its outer boundary."""
    edge, vertex = np.array([[True, False, False, False]]), np.zeros((1, 4), dtype=bool)
    for x, interior in ((-0.009, True), (-0.011, False), (0.5, True)):
        point = np.array([[x, -0.05, 0.2]])
        found = closest_on_boundary(point, SQUARE[None], edge, vertex, np.array([0.01]))
        assert bool(found.interior[0]) == interior
        np.testing.assert_allclose(found.weights[0] @ SQUARE, np.array([max(x, 0.0), 0.0, 0.0]), atol=1e-15)
        np.testing.assert_allclose(found.away[0], [0, -0.05, 0.2], atol=1e-15)
