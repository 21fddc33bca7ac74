"""What detection's kernels say of facets and points in space, against the same in NumPy."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.contact_detection.frames import frames
from fcsim.contact_detection.surfaces._facet_kernels import facets_in_space, facing_above, feet_of_points, mean_points, near_of_list


@pytest.mark.parametrize("k", [3, 4])
def test_facets(k: int) -> None:
    rng = np.random.default_rng(k)
    x = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])[:k] + 0.2 * rng.standard_normal((40, k, 3))
    order = rng.permutation(40 * k)
    positions = np.empty((40 * k, 3))
    positions[order] = x.reshape(-1, 3)
    corners, centre, radius, normal, area = facets_in_space(order.reshape(40, k), positions)
    assert_array_equal(corners, x)
    assert_allclose(centre, x.mean(axis=1), atol=1e-15)
    assert_allclose(radius, np.linalg.norm(x - x.mean(axis=1)[:, None], axis=2).max(axis=1))
    triangles = [(0, 1, 2), (0, 2, 3)][: k - 2]  # the mean normal times the area is the sum over any triangulation
    total = sum(0.5 * np.cross(x[:, b] - x[:, a], x[:, c] - x[:, a]) for a, b, c in triangles)
    assert_allclose(area, np.linalg.norm(total, axis=1))
    assert_allclose(normal * area[:, None], total, atol=1e-14)
    flat = facets_in_space(np.array([[0, 0, 0, 0][:k]]), positions)
    assert not flat[4][0] > 0


def test_points_and_their_feet() -> None:
    rng = np.random.default_rng(5)
    nodes, weights, x = rng.integers(0, 30, (50, 4)), rng.uniform(size=(50, 4)), rng.standard_normal((30, 3))
    assert_allclose(mean_points(nodes, weights, x), np.einsum("nk,nkd->nd", weights, x[nodes]))
    point, candidate, facet = rng.standard_normal((20, 3)), rng.integers(0, 20, 50), rng.integers(0, 9, 50)
    corners, normal = rng.standard_normal((9, 4, 3)), rng.standard_normal((50, 3))
    foot, gap, distance = feet_of_points(point, candidate, corners, facet, weights, normal)
    assert_allclose(foot, np.einsum("nk,nkd->nd", weights, corners[facet]))
    arm = point[candidate] - foot
    assert_allclose(gap, np.sum(arm * normal, axis=1))
    assert_allclose(distance, np.linalg.norm(arm, axis=1))


def test_pairs_that_are_near_and_face_each_other() -> None:
    rng = np.random.default_rng(6)
    points, centres, reach = rng.standard_normal((30, 3)), rng.standard_normal((40, 3)), rng.uniform(0.5, 1.5, 40)
    i, j = (pairs.ravel() for pairs in np.indices((30, 40)))
    near = np.linalg.norm(points[i] - centres[j], axis=1) <= reach[j]
    assert_array_equal(near_of_list(points, centres, reach, i, j), (i[near], j[near]))
    outward, size, alert = rng.standard_normal((30, 3)), rng.uniform(0.5, 1, 30), rng.uniform(0, 0.3, 30)
    corners, normal = centres[:, None] + 0.3 * rng.standard_normal((40, 4, 3)), frames_of(rng, 40)
    radius, widths = rng.uniform(0.3, 1, 40), rng.uniform(0.5, 1, 40)
    found = facing_above(i, j, points, outward, size, alert, (corners, centres, radius, normal, widths), -0.2, 0.05, 0.4)
    arm, least = points[i] - centres[j], np.minimum(size[i], widths[j])
    height = np.sum(arm * normal[j], axis=1)
    aside = np.linalg.norm(arm - height[:, None] * normal[j], axis=1)
    warp = np.abs(np.sum((corners[j, 0] - centres[j]) * normal[j], axis=1))
    keep = (np.sum(outward[i] * normal[j], axis=1) < -0.2) & (height <= alert[i] + warp + 0.05 * least)
    keep &= height >= -0.4 * least - warp - 0.05 * least
    keep &= aside <= radius[j] + alert[i] + np.maximum(-height, 0) + 2 * 0.05 * least
    assert 20 < np.count_nonzero(keep) < 600
    assert_array_equal(found, (i[keep], j[keep]))


def frames_of(rng: np.random.Generator, n: int) -> np.ndarray:
    """Unit normals."""
    x = rng.standard_normal((n, 3))
    return x / np.linalg.norm(x, axis=1)[:, None]


def test_frames_are_right_handed_and_begin_along_an_axis() -> None:
    normals = np.concatenate([frames_of(np.random.default_rng(7), 50), np.eye(3), -np.eye(3)])
    found = frames(normals)
    assert_allclose(found @ found.transpose(0, 2, 1), np.broadcast_to(np.eye(3), found.shape), atol=1e-14)
    assert_allclose(np.linalg.det(found), 1)
    assert_array_equal(found[:, 0], normals)
    axis = np.where(np.abs(normals[:, 0]) > 0.9, 1, 0)
    assert (found[np.arange(len(found)), 1, axis] > 0).all()
    other = np.eye(3)[axis] - np.sum(np.eye(3)[axis] * normals, axis=1)[:, None] * normals
    assert_allclose(np.cross(other, found[:, 1]), 0, atol=1e-14)
