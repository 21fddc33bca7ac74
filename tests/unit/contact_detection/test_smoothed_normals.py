"""Projection along interpolated normals: what it solves, where it is continuous, how exact its normals are."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fcsim.contact_detection import Contacts, ContactSurface, Detector, SurfacePair
from fcsim.contact_detection.smoothed_normals import project_along_normals
from fcsim.errors import InputError

SHAPES = {2: np.array([[-1.0, 0], [1, 0]]), 3: np.array([[-1.0, -1, 0], [1, -1, 0], [0, 1, 0]])}
SHAPES[4] = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])


def shape_functions(k: int, inside: np.ndarray) -> np.ndarray:
    """Shape functions of a facet of k nodes from random numbers (n, 2) in [0, 1]."""
    s, t = inside.T
    if k == 2:
        return np.column_stack([1 - s, s])
    if k == 3:
        s, t = np.where(s + t > 1, [1 - s, 1 - t], [s, t])
        return np.column_stack([1 - s - t, s, t])
    return np.column_stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t])


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([2, 3, 4]))
def test_feet_are_found_again(seed: int, k: int) -> None:
    """Points made from a foot, a distance and the interpolated normal, on bent facets with tilted normals."""
    generator = np.random.default_rng(seed)
    n, d = 20, 2 if k == 2 else 3
    corners = SHAPES[k] + 0.2 * generator.uniform(-1, 1, (n, k, d))
    normals = np.eye(d)[-1] + 0.3 * generator.uniform(-1, 1, (n, k, d))
    normals /= np.linalg.norm(normals, axis=2)[:, :, None]
    psi = shape_functions(k, generator.uniform(0.01, 0.99, (n, 2)))
    distance = generator.uniform(-0.3, 0.3, n)
    way = np.einsum("nk,nkd->nd", psi, normals)
    foot = np.einsum("nk,nkd->nd", psi, corners)
    found = project_along_normals(foot + distance[:, None] * way, corners, normals)
    np.testing.assert_allclose(found.weights, psi, atol=1e-9)
    np.testing.assert_allclose(found.normal, way / np.linalg.norm(way, axis=1)[:, None], atol=1e-9)
    np.testing.assert_allclose(found.outside, 0, atol=1e-9)


def test_points_outside_are_moved_to_the_facet() -> None:
    up = np.broadcast_to([0.0, 0, 1], (2, 4, 3))
    found = project_along_normals(np.array([[1.5, 0.3, 0.2], [-1.2, -1.1, 0.0]]), np.broadcast_to(SHAPES[4], (2, 4, 3)), up)
    np.testing.assert_allclose(found.weights @ SHAPES[4], [[1, 0.3, 0], [-1, -1, 0]], atol=1e-12)
    np.testing.assert_allclose(found.outside, [0.5, np.hypot(0.2, 0.1)])
    found = project_along_normals(np.array([[2.0, 0.5]]), SHAPES[2][None], np.broadcast_to([0.0, 1], (1, 2, 2)))
    np.testing.assert_allclose(found.weights, [[0, 1]])
    np.testing.assert_allclose(found.outside, [1.0])


def arc(n: int, first: float = 0.3, last: float = 2.0) -> tuple[np.ndarray, np.ndarray]:
    """n chords of the unit circle, the body inside."""
    angle = np.linspace(first, last, n + 1)
    return np.column_stack([np.cos(angle), np.sin(angle)]), np.column_stack([np.arange(n), np.arange(1, n + 1)])


def cap(n: int, triangles: bool) -> tuple[np.ndarray, np.ndarray]:
    """A piece of the unit sphere around the z axis, cut into n x n quadrilaterals or twice as many triangles."""
    s = np.linspace(-0.6, 0.6, n + 1)
    x, y = np.meshgrid(np.tan(s), np.tan(s), indexing="ij")
    points = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)
    points /= np.linalg.norm(points, axis=1)[:, None]
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    facets = (i * (n + 1) + j).ravel()[:, None] + np.array([0, n + 1, n + 2, 1])
    return points, np.concatenate([facets[:, [0, 1, 2]], facets[:, [0, 2, 3]]]) if triangles else facets


def contacts_with(points: np.ndarray, outward: np.ndarray, master: tuple[np.ndarray, np.ndarray], normals: Any, **options: Any) -> Contacts:
    """Contacts of points, each the centre of a small facet that looks along `outward` (n, d)."""
    nodes, facets = master
    d, n = nodes.shape[1], len(points)
    if d == 2:
        small = 0.01 * np.stack([-outward @ np.array([[0.0, 1], [-1, 0]]), outward @ np.array([[0.0, 1], [-1, 0]])], axis=1)
    else:
        side = np.cross(outward, [0.3, 0.5, 0.8])
        side /= np.linalg.norm(side, axis=1)[:, None]
        small = 0.01 * np.stack([side, np.cross(outward, side) - side, -np.cross(outward, side)], axis=1)
    x = np.concatenate([nodes, (points[:, None] + small).reshape(-1, d)])
    slave = ContactSurface(len(nodes) + np.arange(n * d).reshape(n, d), np.full(n, 1))
    pair = SurfacePair(slave, ContactSurface(facets, np.zeros(len(facets), int)), 0.5, 0.1, "faces", normals=normals)
    return Detector([pair], len(x), penetration=5.0, **options)(x)


def sphere_points(generator: np.random.Generator, d: int, n: int = 200) -> np.ndarray:
    """Unit vectors well inside the arc or cap."""
    if d == 2:
        angle = generator.uniform(0.6, 1.7, n)
        return np.column_stack([np.cos(angle), np.sin(angle)])
    way = np.column_stack([generator.uniform(-0.3, 0.3, (n, 2)), np.ones(n)])
    return way / np.linalg.norm(way, axis=1)[:, None]


@pytest.mark.parametrize("kind", ["segments", "triangles", "quadrilaterals"])
def test_order_of_the_normals_of_a_sphere(kind: str) -> None:
    """Off the radius by O(h) with facet normals, by O(h^2) smoothed; every point has exactly one contact, at its distance to O(h^2)."""
    way = sphere_points(np.random.default_rng(0), 2 if kind == "segments" else 3)
    height = 0.01 + 0 * way[:, 0]
    wrong: dict[str, list[float]] = {"facet": [], "smooth": []}
    sizes = [8, 16, 32]
    for n in sizes:
        master = arc(2 * n) if kind == "segments" else cap(n, kind == "triangles")
        for normals, errors in wrong.items():
            contacts = contacts_with((1 + height)[:, None] * way, -way, master, normals)
            assert contacts.identity.tolist() == list(range(len(way)))
            errors.append(np.linalg.norm(contacts.frame[:, 0] - way, axis=1).max())
            sagitta = 0.5 * (1.3 / n) ** 2  # of a facet's diagonal
            assert np.all((contacts.gap - height > -1e-12) & (contacts.gap - height < sagitta))
    slopes = {normals: -np.diff(np.log(errors)) / np.log(2) for normals, errors in wrong.items()}
    assert np.all(np.abs(slopes["facet"] - 1) < 0.35)
    if kind == "segments":  # chords of a circle: the interpolated normal is along the interpolated radius, exactly
        assert max(wrong["smooth"]) < 1e-9
    else:
        assert np.all(slopes["smooth"] > 1.8)


@pytest.mark.parametrize("height", [0.05, 0.0, -0.02])
@pytest.mark.parametrize("d", [2, 3])
def test_normal_and_gap_are_continuous_across_facets(d: int, height: float) -> None:
    """A point that slides along the surface: the change of the normal is the step times the curvature, wherever edges are."""
    t = np.linspace(0.6, 1.6, 2001)
    if d == 2:
        master, way = arc(12), np.column_stack([np.cos(t), np.sin(t)])
    else:
        master = cap(8, triangles=True)
        way = np.column_stack([0.5 * (t - 1.1), 0.3 * (t - 1.1) ** 2, np.ones_like(t)])
        way /= np.linalg.norm(way, axis=1)[:, None]
    contacts = contacts_with((1 + height)[:, None] * way if np.ndim(height) else (1 + height) * way, -way, master, "smooth")
    assert len(contacts) == len(t)
    assert np.linalg.norm(np.diff(contacts.frame[:, 0], axis=0), axis=1).max() < 2.5e-3
    assert np.abs(np.diff(contacts.gap)).max() < 2e-4
    if height <= 0:  # with facet normals the normal jumps by the angle between two facets
        jump = np.linalg.norm(np.diff(contacts_with((1 + height) * way, -way, master, "facet").frame[:, 0], axis=0), axis=1).max()
        assert jump > 0.02


def test_on_flat_surfaces_it_is_the_projection() -> None:
    generator = np.random.default_rng(5)
    n = 5
    points, facets = cap(n, triangles=False)
    points = points / points[:, 2:] - [0, 0, 1]  # the plane z = 0
    inner = np.abs(points[:, :2]).max(axis=1) < 0.68
    points[inner, :2] += 0.03 * generator.uniform(-1, 1, (inner.sum(), 2))
    x = np.column_stack([generator.uniform(-0.6, 0.6, (50, 2)), generator.uniform(-0.05, 0.09, 50)])
    down = np.tile([0.0, 0, -1], (50, 1))
    smooth, plain = (contacts_with(x, down, (points, facets), normals) for normals in ("smooth", "facet"))
    for name in ("identity", "bodies", "nodes", "mu"):
        np.testing.assert_array_equal(getattr(smooth, name), getattr(plain, name))
    for name in ("point", "frame", "gap", "weights"):
        np.testing.assert_allclose(getattr(smooth, name), getattr(plain, name), atol=1e-12)


def test_outer_boundary() -> None:
    """Within the edge tolerance a foot is moved onto the boundary; farther out there is none; inside edges count once."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0]])
    master = points, np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
    down = np.array([[0.0, 0, -1]])
    for x, count in ((2.00005, 1), (2.01, 0), (1.0, 1), (-0.00005, 1), (-0.01, 0)):
        contacts = contacts_with(np.array([[x, 0.5, 0.05]]), down, master, "smooth")
        assert len(contacts) == count
        if count:
            np.testing.assert_allclose(contacts.point, [[np.clip(x, 0, 2), 0.5, 0]], atol=1e-12)
            np.testing.assert_allclose(contacts.gap, [0.05])


def test_refusals() -> None:
    line = ContactSurface(np.array([[0, 1]]), np.array([0])), ContactSurface(np.array([[2, 3]]), np.array([1]))
    with pytest.raises(InputError, match="normals among facet, smooth, got 'nodal'"):
        SurfacePair(*line, 0.5, 0.1, normals="nodal")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="'facet' with candidates 'mortar'"):
        SurfacePair(*line, 0.5, 0.1, "mortar", normals="smooth")
