"""Contact of random convex polyhedra, against coal's convex distance."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from fcsim.assembly.model import build_model
from fcsim.contact_detection import Contacts, Everything
from tests.unit.contact_detection.general.rocks import body, pair_of_rocks

coal = pytest.importorskip("coal")
ALERT = 5e-3


def convex(points: np.ndarray, triangles: np.ndarray):
    mesh = coal.BVHModelOBBRSS()
    corners, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for point in points:
        corners.append(point)
    for triangle in triangles:
        faces.append(coal.Triangle(*(int(k) for k in triangle)))
    mesh.beginModel(len(triangles), len(points))
    mesh.addSubModel(corners, faces)
    mesh.endModel()
    mesh.buildConvexRepresentation(False)
    return mesh.convex


def signed_distance(shapes) -> float:
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    request.enable_signed_distance = True
    here = coal.Transform3s.Identity()
    return coal.distance(convex(*shapes[0]), here, convex(*shapes[1]), here, request, result)


@pytest.mark.parametrize("seed", range(4))
def test_nothing_beyond_the_alert_distance(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(10):
        model, shapes = pair_of_rocks(rng, rng.uniform(1.001 * ALERT, 0.05))
        assert signed_distance(shapes) > ALERT
        assert len(Everything(model, 0.5, ALERT)(model.reference)) == 0


@pytest.mark.parametrize("distance", [4e-3, 1e-4, 1e-7, -1e-7, -1e-5, -1e-4])
@pytest.mark.parametrize("seed", range(2))
def test_gap_of_what_is_near(distance: float, seed: int) -> None:
    """The nearest features of convex bodies are one of the contacts, with their exact distance; no vertex or edge is closer or deeper."""
    rng = np.random.default_rng([seed, int(1e9 * abs(distance))])
    for _ in range(8):
        model, shapes = pair_of_rocks(rng, distance)
        exact = signed_distance(shapes)
        assert_allclose(exact, distance, atol=2e-6)  # coal's tolerance; `distance` itself is exact by the Minkowski difference
        contacts = Everything(model, 0.5, ALERT)(model.reference)
        assert np.abs(contacts.gap - distance).min(initial=np.inf) < 1e-9


@pytest.mark.parametrize("seed", range(3))
def test_what_overlaps_has_a_contact(seed: int) -> None:
    """Up to 5 % of the larger extent, half of a thin rock: so deep, the least way out is not always among the contacts; a way out is."""
    rng = np.random.default_rng(seed)
    for _ in range(15):
        model, shapes = pair_of_rocks(rng, -rng.choice([1e-3, 1e-2, 5e-2]))
        exact = signed_distance(shapes)
        contacts = Everything(model, 0.5, ALERT)(model.reference)
        assert contacts.gap.min(initial=0.0) < 0
        assert exact < 0


def as_rows(contacts: Contacts, R: np.ndarray) -> np.ndarray:
    """(gap, |normal components|, point) in a fixed order, turned back by R: without slave and master, without numbers."""
    normal = contacts.frame[:, 0] @ R
    normal *= np.sign(normal[:, :1])
    rows = np.column_stack([contacts.gap, normal])
    return rows[np.lexsort(np.round(rows, 7).T)]


@pytest.mark.parametrize("seed", range(6))
def test_invariance(seed: int) -> None:
    """Motions, the order of the bodies, of their points and of their facets change nothing but numbers."""
    rng = np.random.default_rng(seed)
    model, shapes = pair_of_rocks(rng, -1e-4)
    found = as_rows(Everything(model, 0.5, ALERT)(model.reference), np.eye(3))
    R, shift = Rotation.random(random_state=seed).as_matrix(), rng.normal(size=3)
    moved = Everything(model, 0.5, ALERT)(model.reference @ R.T + shift)
    assert_allclose(as_rows(moved, R), found, atol=1e-9)
    renumbered = []
    for points, triangles in shapes:
        order = rng.permutation(len(points))
        place = np.argsort(order)
        renumbered.append((points[order], np.roll(place[triangles], 1, axis=1)[rng.permutation(len(triangles))]))
    swapped = build_model([body(name, *shape) for name, shape in zip("ab", renumbered[::-1], strict=True)])
    assert_allclose(as_rows(Everything(swapped, 0.5, ALERT)(swapped.reference), np.eye(3)), found, atol=1e-9)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_units_do_not_matter(scale: float) -> None:
    """The default alert distance and all tolerances scale with the bodies."""
    model, shapes = pair_of_rocks(np.random.default_rng(5), -1e-4)
    found = Everything(model, 0.5)(model.reference)
    scaled = build_model([body(name, scale * p, t) for name, (p, t) in zip("ab", shapes, strict=True)])
    other = Everything(scaled, 0.5)(scaled.reference)
    assert np.array_equal(other.identity, found.identity)
    assert_allclose(other.gap / scale, found.gap, atol=1e-12)
