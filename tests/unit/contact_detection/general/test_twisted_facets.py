"""Normals of twisted quadrilaterals at their rims. The corners (+-1, +-1, c x y) span the hyperbolic paraboloid z = c x y, whose normal is
(-c y, -c x, 1) / sqrt(1 + c^2 (x^2 + y^2)) everywhere: a facet's mean normal, (0, 0, 1), is that of its middle only."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from fcsim.contact_detection.general._edge_kernels import EdgesOfAll, crossings
from fcsim.contact_detection.general._foot_kernels import INSIDE, feet
from fcsim.contact_detection.general._smoothing_kernels import interpolated_normals

C = 0.1
XY = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
CORNERS = np.column_stack([XY, C * XY[:, 0] * XY[:, 1]])
FACET, MEAN, SIDES = np.array([[0, 1, 2, 3]]), np.array([(0.0, 0.0, 1.0)]), np.array([4])


def surface_normal(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    n = np.column_stack([-C * y, -C * x, np.ones_like(x)])
    return n / np.linalg.norm(n, axis=1)[:, None]


def test_feet_on_the_rim_have_the_normal_there() -> None:
    """Just inside and just outside of every side and corner: the same normal, that of the surface."""
    along, rim = np.linspace(-0.9, 0.9, 5), np.ones(5)
    at = np.vstack([np.column_stack(side) for side in ((along, -rim), (rim, along), (-along, rim), (-rim, -along))] + [XY])
    for reach, inside in ((1.0 - 1e-9, True), (1.0 + 1e-9, False)):
        x, y = (reach * at).T
        above = np.column_stack([x, y, C * x * y]) + 1e-10 * surface_normal(x, y)
        rows = np.arange(len(at))
        _, normal, _, _, feature = feet(
            rows + 4, np.zeros(len(at), dtype=np.int64), np.vstack([CORNERS, above]), np.repeat(FACET, 1, axis=0), SIDES, MEAN
        )
        assert ((feature == INSIDE) == inside).all()
        assert_allclose(normal, surface_normal(*at.T), atol=1e-8)


def test_smoothed_normals_at_the_corners_of_a_patch() -> None:
    none = np.zeros(1, dtype=np.int64)
    stars, first_star = np.zeros(4, dtype=np.int64), np.arange(5)
    changed, normal = interpolated_normals(
        np.zeros(4, dtype=np.int64), np.eye(4), np.ones(1, dtype=bool), CORNERS, MEAN, FACET, SIDES, none, stars, first_star
    )
    assert changed.all()
    assert_allclose(normal, surface_normal(*XY.T), atol=1e-12)


def test_edges_that_cross_over_a_twisted_face() -> None:
    """Another edge, turned in the surface by 1e-3 about a point of the side y = -1 and lifted: the normal there, the gap along it."""
    here = np.array([0.6])
    n, place = surface_normal(here, -np.ones(1))[0], np.array([0.6, -1.0, -0.6 * C])
    side = np.array([1.0, 0.0, -C]) / np.hypot(1.0, C)
    way = side + 1e-3 * np.cross(n, side)
    other = np.array([place - 0.3 * way + 1e-8 * n, place + 0.3 * way + 1e-8 * n])
    point = np.vstack([CORNERS, other])
    normals = np.vstack([MEAN, -MEAN, [(0.0, -1.0, 0.0)], [(0.0, 1.0, 0.0)]])  # of the facet, the one on it, and those beside them
    one = np.zeros(1, dtype=np.int64)
    facets = np.array([[0, 1, 2, 3], [5, 4, 4, 4], [0, 1, 1, 1], [4, 5, 5, 5]])
    for first, second in ((1, 0), (0, 1)):
        rows, normal, gap, _, _ = crossings(
            one + first, one + second, np.full(1, 1e-3), np.full(1, 1e-3), np.full(1, 1e-9),
            EdgesOfAll(
                point, normals, np.array([2.0, 1.0, 1.0, 1.0]), normals[[0, 0, 0, 0, 1, 1]], np.array([[0, 1], [4, 5]]),
                np.array([[0, 2], [1, 3]]), facets, np.array([4, 3, 3, 3]), np.ones(2, dtype=bool), np.zeros((2, 2), dtype=bool), 0,
            ),
        )  # fmt: skip
        assert len(rows) == 1
        assert_allclose(normal[0], n if first else -n, atol=1e-6)
        assert_allclose(gap[0], 1e-8, rtol=1e-3)
