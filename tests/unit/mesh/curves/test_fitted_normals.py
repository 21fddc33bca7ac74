"""Normals at vertices of unstructured triangles: those of quadrics exactly, at rims too, of other curves nearly; rough faces have none."""

import numpy as np
import pytest
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation

from fcsim.mesh.curves.bulges import bulges
from fcsim.mesh.curves.fitted_normals import fitted_normals


def cylinder(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    out = np.stack([np.cos(a), np.sin(a), 0 * a], axis=1)
    return out + b[:, None] * [0, 0, 1], out


def cone(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    points, out = cylinder(a, b)
    return points * np.stack([1 - 0.3 * b, 1 - 0.3 * b, 0 * b + 1], axis=1), out + np.array([0, 0, 0.3])


def sphere(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    out = np.stack([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)], axis=1)
    return out, out


def ellipsoid(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    half = np.array([1.0, 0.8, 1.3])
    return half * sphere(a, b)[0], sphere(a, b)[0] / half


def torus(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The outside of one of the radii 1.5 and 0.75."""
    ring = np.stack([np.cos(a), np.sin(a), 0 * a], axis=1)
    out = ring * np.cos(b)[:, None] + np.sin(b)[:, None] * [0, 0, 1]
    return 1.5 * ring + 0.75 * out, out


def barrel(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A cubic turned about an axis."""
    points, out = cylinder(a, b)
    r = 1 + 0.2 * b - 0.1 * b**3
    return points * np.stack([r, r, 0 * b + 1], axis=1), out - (0.2 - 0.3 * b**2)[:, None] * [0, 0, 1]


def triangulated(surface, around: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Scattered vertices over an angle and a length of 1.5, so many facets a turn: points, triangles, normals by the equation."""
    random, n = np.random.default_rng(around), round(1.5 * around / (2 * np.pi))
    line = np.linspace(-0.75, 0.75, n + 1)
    inner = line[1:-1]
    a, b = np.meshgrid(inner, inner)
    scattered = np.column_stack([a.ravel(), b.ravel()]) + random.uniform(-0.35, 0.35, ((n - 1) ** 2, 2)) * 1.5 / n
    rim = np.concatenate([np.column_stack(pair) for c in (-0.75, 0.75) for pair in ((0 * line + c, line), (inner, 0 * inner + c))])
    at = np.concatenate([scattered, rim])
    points, normal = surface(*at.T)
    triangles = Delaunay(at).simplices
    sides = at[triangles[:, 1:]] - at[triangles[:, :1]]
    triangles = triangles[np.abs(np.linalg.det(sides)) > 1e-9]
    return points, triangles, normal / np.linalg.norm(normal, axis=1)[:, None]


def found(points: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The fit, with what it begins with: the means of the facets' normals."""
    x = points[triangles]
    facet = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    facet /= np.linalg.norm(facet, axis=1)[:, None]
    mean = np.zeros_like(points)
    np.add.at(mean, triangles, facet[:, None].repeat(3, axis=1))
    mean /= np.maximum(np.linalg.norm(mean, axis=1), 1e-300)[:, None]
    fits, normal = fitted_normals(triangles, np.ones(triangles.shape, dtype=bool), x, facet, mean)
    return fits, normal, mean


@pytest.mark.parametrize("surface", [cylinder, cone, sphere, ellipsoid])
def test_quadrics_have_their_normals(surface) -> None:
    """16 to 40 facets a turn, in mm, m and km, turned: to round-off, at rims and corners too, where means are off by a third of the angle
    between facets."""
    for around, unit in ((20, 1e-3), (24, 1.0), (40, 1e3)):
        points, triangles, exact = triangulated(surface, around)
        turn = Rotation.from_euler("xyz", [0.3, 1.1, -0.7]).as_matrix()
        fits, normal, mean = found(unit * points @ turn.T, triangles)
        assert fits.all()
        assert np.abs(np.cross(normal, exact @ turn.T)).max() < 1e-8
        assert np.abs(np.cross(mean, exact @ turn.T)).max() > 0.02


@pytest.mark.parametrize("surface", [torus, barrel])
def test_other_curves_have_theirs_nearly(surface) -> None:
    """Of the angle between facets a hundredth in the mean, and less with finer facets."""
    share = []
    for around in (20, 40):
        points, triangles, exact = triangulated(surface, around)
        fits, normal, mean = found(points, triangles)
        off = [np.linalg.norm(np.cross(n, exact), axis=1)[fits] / (2 * np.pi / around) for n in (normal, mean)]
        assert fits.mean() > 0.9
        share.append(np.sqrt((off[0] ** 2).mean()))
        assert share[-1] < 0.2 * np.sqrt((off[1] ** 2).mean())
    assert share[0] < 0.05 and share[1] < 0.4 * share[0]


@pytest.mark.parametrize(
    ("surface", "zero"),
    [
        (cone, lambda p: np.hypot(p[..., 0], p[..., 1]) + 0.3 * p[..., 2] - 1.0),
        (ellipsoid, lambda p: ((p / [1.0, 0.8, 1.3]) ** 2).sum(axis=-1) - 1.0),
    ],
)
def test_curvature_that_changes_along_facets_is_no_error_of_their_bulge(surface, zero) -> None:
    """At the sides' middles, by where the facet's normal meets the surface (Newton's method on its equation): to 1 % in the mean."""
    points, triangles, _ = triangulated(surface, 24)
    x = points[triangles]
    normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    size = np.sqrt(0.5 * np.linalg.norm(normal, axis=1))
    normal /= 2.0 * size[:, None] ** 2
    if np.einsum("fd,fd->f", normal, x.mean(axis=1) * [1, 1, 0]).sum() < 0:
        normal, triangles, x = -normal, triangles[:, ::-1], x[:, ::-1]
    B = bulges(triangles, np.full(len(triangles), 3), points, normal, size, np.zeros(len(triangles), dtype=np.int64))
    assert B is not None
    own, exact = [], []
    for k, other in ((0, 1), (1, 2), (2, 0)):
        middle, b = 0.5 * (x[:, k] + x[:, other]), np.zeros(len(x))
        for _ in range(4):
            along = (b + np.array([-1e-6, 0.0, 1e-6])[:, None])[..., None]
            less, now, more = zero(middle + along * normal)
            b = b - 2e-6 * now / (more - less)
        own.append(0.5 * B[:, k, other])
        exact.append(b)
    assert np.abs(np.subtract(own, exact)).mean() < 0.01 * np.abs(exact).mean()


def test_rough_faces_and_ridges_have_no_fit() -> None:
    """Heights by chance as those of broken stone, and two slopes that meet in a ridge, mirrored: what facets there are is the surface."""
    for around in (24, 60):
        points, triangles, _ = triangulated(cylinder, around)
        flat = np.column_stack([np.arctan2(points[:, 1], points[:, 0]), points[:, 2]])
        rough = np.column_stack([flat, np.random.default_rng(1).uniform(-0.02, 0.02, len(flat))])
        assert found(rough, triangles)[0].mean() < 0.05
        slope = np.column_stack([flat[:, 0] + 0.75, flat[:, 1], -0.2 * flat[:, 0]])
        both = np.concatenate([slope, slope * [-1, 1, 1]])
        own = np.arange(len(slope))
        other = np.where(slope[:, 0] < 1e-9, own, own + len(slope))
        fits, normal, mean = found(both, np.concatenate([triangles, other[triangles][:, ::-1]]))
        assert not fits.any() and np.array_equal(normal, mean, equal_nan=True)
