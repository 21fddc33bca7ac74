"""Points in the valleys of concave surfaces: a contact for each facet there, and reactions of both."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.contact_detection import ContactSurface, Detector, SurfacePair
from fcsim.contact_detection.contacts import Contacts

SLOPE = 0.3


def over_two_segments(slope: float, point: tuple[float, float], **rule: Any) -> tuple[Detector, np.ndarray]:
    """A node over the segments from (-1, slope) to the origin to (1, slope), and its slave surface."""
    x = np.array([[-1.0, slope], [0.0, 0.0], [1.0, slope], point, [point[0] - 0.4, point[1] + 0.25], [point[0] + 0.4, point[1] + 0.25]])
    master = ContactSurface(np.array([[1, 0], [2, 1]]), np.zeros(2, dtype=int))
    slave = ContactSurface(np.array([[4, 3], [3, 5]]), np.ones(2, dtype=int))
    return Detector([SurfacePair(slave, master, 0.3, 0.1, **rule)], 6), x


def of_node(contacts: Contacts) -> Contacts:
    return contacts.take(np.flatnonzero(contacts.nodes[:, 0] == 3))


@pytest.mark.parametrize("point", [(0.0, 0.0), (0.05, 0.02), (-0.05, -0.02), (0.0, 0.03)])
def test_a_valley_has_the_distances_from_both_planes(point: tuple[float, float]) -> None:
    detector, x = over_two_segments(SLOPE, point)
    nearest, both = of_node(detector(x)), of_node(detector.in_valleys(x))  # type: ignore[misc]
    assert len(nearest) == 1 and len(both) == 2
    normals = np.array([[SLOPE, 1.0], [-SLOPE, 1.0]]) / np.hypot(1.0, SLOPE)
    assert_allclose(both.frame[:, 0], normals, atol=1e-12)
    assert_allclose(both.gap, normals @ point, atol=1e-12)
    assert_allclose(both.weights.sum(axis=1), 0.0, atol=1e-12)
    assert nearest.identity[0] in both.identity and np.all(np.diff(detector.in_valleys(x).identity) > 0)  # type: ignore[misc]


@pytest.mark.parametrize(("slope", "point"), [(-SLOPE, (0.0, 0.0)), (0.0, (0.0, 0.0)), (SLOPE, (0.6, 0.18))])
def test_ridges_planes_and_points_far_from_the_edge_have_one(slope: float, point: tuple[float, float]) -> None:
    detector, x = over_two_segments(slope, point)
    assert_array_equal(detector.in_valleys(x).identity, detector(x).identity)  # type: ignore[misc]
    assert len(of_node(detector(x))) == 1


def test_smooth_normals_know_no_valleys() -> None:
    assert over_two_segments(SLOPE, (0.0, 0.0), normals="smooth")[0].in_valleys is None


def test_the_corner_of_three_facets_in_space_has_three() -> None:
    """A cube's inner corner, looked at from inside: the planes x = 0, y = 0, z = 0 as squares, and a triangle's tip in it."""
    corner = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]], dtype=float)
    tip = np.array([0.02, 0.03, 0.01])
    x = np.vstack([corner, tip + np.array([[0.0, 0.0, 0.0], [0.4, 0.1, 0.1], [0.1, 0.4, 0.1], [0.1, 0.1, 0.4]])])
    master = ContactSurface(np.array([[0, 1, 2, 3], [0, 4, 5, 1], [0, 3, 6, 4]]), np.zeros(3, dtype=int))
    slave = ContactSurface(np.array([[7, 9, 8], [7, 10, 9], [7, 8, 10]]), np.ones(3, dtype=int))
    contacts = Detector([SurfacePair(slave, master, 0.0, 0.1)], 11).in_valleys(x)  # type: ignore[misc]
    own = contacts.take(contacts.nodes[:, 0] == 7)
    found = sorted((tuple(np.round(normal, 9)), round(float(gap), 9)) for normal, gap in zip(own.frame[:, 0], own.gap, strict=True))
    assert found == [((0.0, 0.0, 1.0), 0.01), ((0.0, 1.0, 0.0), 0.03), ((1.0, 0.0, 0.0), 0.02)]
