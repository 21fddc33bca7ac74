"""Which contacts there are: edges, ridges, boundaries, several bodies; and what their weights and frames mean."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from fcsim.contact_detection import Contacts, ContactSurface, Detector, SurfacePair, contact_matrix
from fcsim.contact_detection.surfaces.broad_phase import near_pairs
from fcsim.contact_detection.surfaces.surface import CandidateRule

DOWN = np.array([[0.0, 0, 0], [0, 1, 0], [1, 0, 0]])  # a triangle that looks down


def plate(nx: int, ny: int, x0: float = 0.0, z: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and upward quadrilaterals of nx x ny unit squares."""
    x, y = np.meshgrid(np.arange(nx + 1) + x0, np.arange(ny + 1), indexing="ij")
    i, j = np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij")
    first = (i * (ny + 1) + j).ravel()
    facets = first[:, None] + np.array([0, ny + 1, ny + 2, 1])
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, z)]), facets


def touch(
    point: np.ndarray, masters: list[tuple[np.ndarray, np.ndarray]], alert: float = 0.3, size: float = 2.0, **options: float
) -> Contacts:
    """Contacts of the single candidate `point`, centre of a small triangle looking down, with one body for each master."""
    points, facets, bodies, first = [], [], [], 0
    for number, (nodes, cells) in enumerate(masters):
        points.append(nodes)
        facets.append(cells + first)
        bodies.append(np.full(len(cells), number))
        first += len(nodes)
    points.append(point + size * (DOWN - DOWN.mean(axis=0)))
    master = ContactSurface(np.concatenate(facets), np.concatenate(bodies))
    slave = ContactSurface(np.array([[first, first + 1, first + 2]]), np.array([len(masters)]))
    x = np.concatenate(points)
    return Detector([SurfacePair(slave, master, 0.5, alert, "faces")], len(x), **options)(x)


def roof(rise: float) -> tuple[np.ndarray, np.ndarray]:
    """Two unit-wide slopes that meet along y at x = 0: a ridge (rise > 0) or a valley (rise < 0)."""
    points = np.array([[-1, 0, -rise], [0, 0, 0], [1, 0, -rise], [-1, 2, -rise], [0, 2, 0], [1, 2, -rise]], dtype=float)
    return points, np.array([[0, 1, 4, 3], [1, 2, 5, 4]])


@pytest.mark.parametrize("xy", [(1.0, 0.5), (1.0, 1.0), (0.4, 1.0), (2.0, 2.0)])
def test_foot_on_a_shared_edge_or_vertex_is_taken_once(xy: tuple[float, float]) -> None:
    contacts = touch(np.array([*xy, 0.1]), [plate(3, 3)])
    assert len(contacts) == 1
    np.testing.assert_allclose(contacts.point[0], [*xy, 0], atol=1e-14)
    np.testing.assert_allclose(contacts.gap, 0.1)


def test_beyond_the_outer_boundary_there_is_none() -> None:
    assert len(touch(np.array([1.5, -0.005, 0.1]), [plate(3, 3)])) == 1  # within the edge tolerance
    for outside in ([1.5, -0.02, 0.0], [1.5, -0.02, 0.1], [1.0, -0.02, 0.1], [-0.02, -0.02, 0.05], [3.1, 1.5, 0.0]):
        assert len(touch(np.array(outside), [plate(3, 3)])) == 0


@pytest.mark.parametrize("height", [0.2, 0.05, 1e-7, 0.0])
def test_ridge(height: float) -> None:
    contacts = touch(np.array([0.0, 0.7, height]), [roof(0.5)])
    assert len(contacts) == 1
    np.testing.assert_allclose(contacts.point[0], [0, 0.7, 0], atol=1e-14)
    np.testing.assert_allclose(contacts.frame[0, 0], [0, 0, 1], atol=1e-7)
    np.testing.assert_allclose(contacts.gap, height, atol=1e-14)


def test_fan_above_a_ridge() -> None:
    """Between the normals (-+0.5, 0, 1) of the slopes the nearest point is on the ridge, and the normal is the way to it."""
    for angle in np.deg2rad([-20.0, -10, 5, 25]):  # the fan is 26.6 degrees to each side
        way = np.array([np.sin(angle), 0, np.cos(angle)])
        contacts = touch(np.array([0, 1.2, 0]) + 0.2 * way, [roof(0.5)])
        assert len(contacts) == 1
        np.testing.assert_allclose(contacts.point[0], [0, 1.2, 0], atol=1e-14)
        np.testing.assert_allclose(contacts.frame[0, 0], way, atol=1e-14)
        np.testing.assert_allclose(contacts.gap, 0.2)
        np.testing.assert_allclose(contacts.weights.sum(axis=1), 0.0, atol=1e-15)
    for height in (0.1, 0.001, 0.0):  # the end of the ridge, within the edge tolerance
        contacts = touch(np.array([0.0, -0.005, height]), [roof(0.5)])
        np.testing.assert_allclose(contacts.frame[:, 0], [[0, 0, 1]], atol=1e-12)
        np.testing.assert_allclose(contacts.gap, [height], atol=1e-15)
    assert len(touch(np.array([0.0, -0.05, 0.1]), [roof(0.5)])) == 0  # beyond the gable


def test_apex_of_a_pyramid() -> None:
    """A vertex inside the surface: the normal is the way to the candidate, at the apex itself the axis."""
    points = np.array([[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [0, 0, 0]], dtype=float)
    pyramid = points, np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    for way in np.array([[0, 0, 1], [0.1, 0.2, 1], [-0.3, 0.2, 1]]):
        way = way / np.linalg.norm(way)
        contacts = touch(0.1 * way, [pyramid])
        assert len(contacts) == 1
        np.testing.assert_allclose(contacts.point[0], 0, atol=1e-15)
        np.testing.assert_allclose(contacts.frame[0, 0], way, atol=1e-14)
        np.testing.assert_allclose(contacts.gap, 0.1)
    np.testing.assert_allclose(touch(np.zeros(3), [pyramid]).frame[:, 0], [[0, 0, 1]], atol=1e-15)


def test_bottom_of_a_pit() -> None:
    """Below a concave vertex, deeper than the alert distance: the nearest point is the vertex, the gap negative."""
    points = np.array([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1], [0, 0, 0]], dtype=float)
    contacts = touch(np.array([0.0, 0.0, -0.3]), [(points, np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]))], alert=0.01)
    np.testing.assert_allclose(contacts.gap, [-0.3])
    np.testing.assert_allclose(contacts.frame[:, 0], [[0, 0, 1]], atol=1e-15)


def test_raised_corner_of_a_warped_facet() -> None:
    """The surface z = 0.4 (2x - 1)(2y - 1) of a unit square, near its corner (1, 1, 0.4): far above the mean plane."""
    corners = np.array([[0, 0, 0.4], [1, 0, -0.4], [1, 1, 0.4], [0, 1, -0.4]])
    x, y = 0.95, 0.97
    normal = np.array([-0.8 * (2 * y - 1), -0.8 * (2 * x - 1), 1.0])
    normal /= np.linalg.norm(normal)
    foot = np.array([x, y, 0.4 * (2 * x - 1) * (2 * y - 1)])
    contacts = touch(foot + 0.01 * normal, [(corners, np.array([[0, 1, 2, 3]]))], alert=0.02)
    np.testing.assert_allclose(contacts.point, [foot], atol=1e-14)
    np.testing.assert_allclose(contacts.frame[:, 0], [normal], atol=1e-12)
    np.testing.assert_allclose(contacts.gap, [0.01])


def test_slope_and_valley_take_the_nearest_facet() -> None:
    normal = np.array([0.5, 0, 1]) / np.sqrt(1.25)
    contacts = touch(np.array([0.5, 1, -0.25]) + 0.1 * normal, [roof(0.5)])
    np.testing.assert_allclose(contacts.frame[0, 0], normal, atol=1e-14)
    np.testing.assert_allclose(contacts.gap, 0.1)
    contacts = touch(np.array([0.3, 1, 0.2]), [roof(-0.5)])
    assert len(contacts) == 1
    np.testing.assert_allclose(contacts.frame[0, 0], np.array([-0.5, 0, 1]) / np.sqrt(1.25), atol=1e-14)
    np.testing.assert_allclose(contacts.gap, (0.2 - 0.15) / np.sqrt(1.25))


def test_under_a_valley_the_gap_is_negative() -> None:
    contacts = touch(np.array([0.0, 0.7, -0.1]), [roof(-0.5)])
    assert len(contacts) == 1
    np.testing.assert_allclose(contacts.gap, -0.1)
    np.testing.assert_allclose(contacts.frame[0, 0], [0, 0, 1], atol=1e-14)


def test_two_bodies_flush_side_by_side_give_one_contact() -> None:
    left, right = plate(2, 2), plate(2, 2, x0=2.0)
    for masters in ([left, right], [right, left]):
        contacts = touch(np.array([2.0, 1.3, 0.1]), masters)
        assert len(contacts) == 1
        assert contacts.bodies[0, 1] == 0  # equal gaps: the lowest number
    for opening, count in ((0.004, 1), (0.015, 1), (0.03, 0)):  # the edge tolerance is 1 % to each side
        contacts = touch(np.array([2.0 + opening / 2, 1.3, 0.1]), [left, plate(2, 2, x0=2.0 + opening)])
        assert len(contacts) == count


def test_of_two_bodies_the_higher_is_taken() -> None:
    contacts = touch(np.array([2.0, 1.3, 0.1]), [plate(2, 2), plate(2, 2, x0=2.0, z=1e-3)])
    assert contacts.bodies[:, 1].tolist() == [1]
    np.testing.assert_allclose(contacts.gap, 0.099)


def test_two_bodies_at_an_angle_give_two_contacts() -> None:
    floor = plate(2, 2)
    wall = np.array([[0.0, 0, 0], [0, 2, 0], [0, 2, 2], [0, 0, 2]]), np.array([[0, 1, 2, 3]])  # looks along +x
    corner = np.array([[0.004, 1, 0.003], [0.004, 2, 0.003], [1.004, 1, 0.003], [0.004, 1, 1.003]])
    x = np.concatenate([floor[0], wall[0], corner])
    master = ContactSurface(np.concatenate([floor[1], wall[1] + 9]), np.array([0, 0, 0, 0, 1]))
    slave = ContactSurface(13 + np.array([[0, 1, 2], [0, 3, 1]]), np.array([2, 2]))  # bottom and x- face: nodes 0, 1 look along -x -z
    contacts = Detector([SurfacePair(slave, master, 0.5, 0.05)], len(x))(x)
    assert contacts.bodies.tolist() == [[2, 0], [2, 1], [2, 0], [2, 1], [2, 0], [2, 1]]
    np.testing.assert_allclose(contacts.gap, [0.003, 0.004] * 3, atol=1e-14)
    np.testing.assert_array_equal(contacts.nodes[:, 0], [13, 13, 14, 14, 15, 16])


def test_far_apart_wrong_side_and_same_body_give_none() -> None:
    assert len(touch(np.array([1.5, 1.5, 0.5]), [plate(3, 3)])) == 0  # above the alert distance
    assert len(touch(np.array([9.5, 1.5, 0.1]), [plate(3, 3)])) == 0
    assert len(touch(np.array([1.5, 1.5, -0.9]), [plate(3, 3)])) == 0  # deeper than the penetration limit
    assert len(touch(np.array([1.5, 1.5, -0.2]), [plate(3, 3)])) == 1
    nodes, facets = plate(3, 3)
    assert len(touch(np.array([1.5, 1.5, 0.1]), [(nodes, facets[:, ::-1])])) == 0  # both look down
    x = np.concatenate([nodes, DOWN + np.array([1.5, 1.5, 0.1])])
    surface, small = ContactSurface(facets, np.zeros(9, int)), ContactSurface(np.array([[16, 17, 18]]), np.array([0]))
    assert len(Detector([SurfacePair(small, surface, 0.5, 0.3)], len(x))(x)) == 0


def test_empty_results_have_shapes() -> None:
    contacts = touch(np.array([9.5, 1.5, 0.1]), [plate(3, 3)])
    assert contacts.frame.shape == (0, 3, 3)
    assert contacts.point.shape == (0, 3)
    assert contacts.nodes.shape == contacts.weights.shape == (0, 7)
    assert contacts.bodies.shape == (0, 2)
    assert contacts.gap.shape == contacts.mu.shape == contacts.identity.shape == (0,)
    assert contact_matrix(contacts, 19).shape == (57, 0)
    nothing = ContactSurface(np.empty((0, 4), int), np.empty(0, int))
    x = plate(2, 2)
    detector = Detector([SurfacePair(nothing, ContactSurface(x[1], np.zeros(4, int)), 0.0, 0.1, rule) for rule in ("nodes", "gauss")], 9)
    assert len(detector(x[0])) == 0


def closest_on_triangle(point: np.ndarray, corners: np.ndarray) -> float:
    """Distance to the nearest of: the foot on the plane, if it is inside, and the nearest points of the three sides."""
    sides = np.column_stack([corners[1] - corners[0], corners[2] - corners[0]])
    s = np.linalg.lstsq(sides, point - corners[0], rcond=None)[0]
    inside = [np.linalg.norm(corners[0] + sides @ s - point)] if s.min() >= 0 and s.sum() <= 1 else []
    ends = np.roll(corners, -1, axis=0) - corners
    t = np.clip(np.einsum("kd,kd->k", point - corners, ends) / np.einsum("kd,kd->k", ends, ends), 0, 1)
    distances = np.linalg.norm(corners + t[:, None] * ends - point, axis=1)
    return min([*distances, *inside])


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6))
def test_closed_polyhedron_against_brute_force(seed: int) -> None:
    """Points around and in an icosahedron, a closed surface: always one contact, at the distance of the nearest triangle."""
    golden = (1 + np.sqrt(5)) / 2
    corners = np.array([np.roll([0, s, t * golden], k) for k in range(3) for s in (-1, 1) for t in (-1, 1)], dtype=float)
    hull = ConvexHull(corners)
    facets = hull.simplices.astype(int)
    a, b, c = (corners[facets[:, k]] for k in range(3))
    wrong = np.einsum("nd,nd->n", np.cross(b - a, c - a), a) < 0
    facets[wrong] = facets[wrong][:, ::-1]
    generator = np.random.default_rng(seed)
    way = generator.normal(size=(12, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    points = way * generator.uniform(1.3, 2.2, (12, 1))  # spheres inside and around have radii 1.51 and 1.90
    # small triangles that look at the centre, with the points as centres
    side = np.cross(way, generator.normal(size=(12, 3)))
    side /= np.linalg.norm(side, axis=1)[:, None]
    up = np.cross(way, side)
    small = 2.0 * np.stack([-side - up, 2 * up, side - up], axis=1)
    nodes = points[:, None] + small - small.mean(axis=1, keepdims=True)
    x = np.concatenate([corners, nodes.reshape(-1, 3)])
    slave = ContactSurface(12 + np.arange(36).reshape(-1, 3), np.full(12, 1))
    master = ContactSurface(facets[generator.permutation(20)], np.zeros(20, int))
    contacts = Detector([SurfacePair(slave, master, 0.5, 1.0, "faces")], len(x))(x)
    assert contacts.identity.tolist() == list(range(12))
    distance = [min(closest_on_triangle(p, corners[f]) for f in facets) for p in points]
    inside = (hull.equations[:, :3] @ points.T + hull.equations[:, 3:] < 0).all(axis=0)
    np.testing.assert_allclose(contacts.gap, np.where(inside, -1, 1) * distance, atol=1e-12)
    np.testing.assert_allclose(contacts.point + contacts.gap[:, None] * contacts.frame[:, 0], points, atol=1e-12)


def test_order_of_facets_does_not_matter() -> None:
    lower, upper = plate(4, 3), plate(3, 3, x0=0.5, z=0.0)
    generator = np.random.default_rng(2)
    x = np.concatenate([lower[0], upper[0]])
    x[:, 2] += 0.02 * generator.uniform(-1, 1, len(x))
    found = []
    for seed in range(4):
        order = [np.random.default_rng(seed).permutation(n) for n in (12, 9)]
        master = ContactSurface(lower[1][order[0]], np.zeros(12, int))
        slave = ContactSurface(len(lower[0]) + upper[1][order[1]][:, ::-1], np.ones(9, int))
        found.append(Detector([SurfacePair(slave, master, 0.3, 0.1)], len(x))(x))
    assert len(found[0]) == 16
    for other in found[1:]:
        for name in ("point", "frame", "gap", "nodes", "weights", "bodies", "identity"):
            np.testing.assert_array_equal(getattr(other, name), getattr(found[0], name))


def test_triangles_among_quadrilaterals() -> None:
    """Half of the squares of a plate cut in two: the contacts stand where they stood."""
    nodes, facets = plate(4, 4)
    cut = facets[::2]
    mixed = np.concatenate(
        [facets[1::2], np.column_stack([cut[:, :3], np.full(8, -1)]), np.column_stack([cut[:, [0, 2, 3]], np.full(8, -1)])]
    )
    upper = nodes * [0.8, 0.8, 1] + [0.37, 0.41, 0.05]
    x = np.concatenate([nodes, upper])
    counts: dict[CandidateRule, int] = {"nodes": 25, "faces": 24, "gauss": 32 + 48}
    for rule, count in counts.items():
        slave = ContactSurface(
            np.concatenate([facets[1::2, ::-1] + 25, np.column_stack([mixed[8:, 2::-1] + 25, np.full(16, -1)])]), np.ones(24, int)
        )
        contacts = Detector([SurfacePair(slave, ContactSurface(mixed, np.zeros(24, int)), 0.3, 0.1, rule)], len(x))(x)
        assert len(contacts) == count
        np.testing.assert_allclose(contacts.gap, 0.05)
        slave_side = np.einsum("nk,nkd->nd", contacts.weights[:, :-4], x[contacts.nodes[:, :-4]])
        np.testing.assert_allclose(slave_side - [0, 0, 0.05], contacts.point, atol=1e-14)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from(["nodes", "faces", "gauss"]))
def test_weights_reproduce_candidate_and_foot(seed: int, rule: CandidateRule) -> None:
    generator = np.random.default_rng(seed)
    lower, upper = plate(4, 4), plate(3, 3, x0=0.5)
    x = np.concatenate([lower[0], upper[0] + [0, 0.4, 0.03]]) + 0.02 * generator.uniform(-1, 1, (41, 3))
    pair = SurfacePair(ContactSurface(25 + upper[1][:, ::-1], np.ones(9, int)), ContactSurface(lower[1], np.zeros(16, int)), 0.3, 0.2, rule)
    contacts = Detector([pair], len(x))(x)
    assert len(contacts) == {"nodes": 16, "faces": 9, "gauss": 36}[rule]
    np.testing.assert_allclose(contacts.weights.sum(axis=1), 0.0, atol=1e-14)
    slave, master = contacts.weights[:, :-4], contacts.weights[:, -4:]
    assert (slave >= 0).all()
    assert (master <= 0).all()
    point = np.einsum("nk,nkd->nd", slave, x[contacts.nodes[:, :-4]])
    np.testing.assert_allclose(-np.einsum("nk,nkd->nd", master, x[contacts.nodes[:, -4:]]), contacts.point, atol=1e-14)
    np.testing.assert_allclose(np.einsum("nd,nd->n", point - contacts.point, contacts.frame[:, 0]), contacts.gap, atol=1e-14)


@pytest.mark.parametrize("seed", range(3))
def test_normal_velocity_is_the_rate_of_the_gap(seed: int) -> None:
    """A flat master at rest, a slave in rigid motion: u_N = d gap / dt by central differences, for tilted surfaces too."""
    generator = np.random.default_rng(seed)
    R = np.linalg.qr(generator.normal(size=(3, 3)))[0]
    R *= np.linalg.det(R)
    lower, upper = plate(6, 6), plate(3, 3, x0=1.3)
    x = np.concatenate([lower[0], upper[0] + [0, 1.7, 0.04]]) @ R.T
    spin, shift = generator.normal(size=3), generator.normal(size=3)
    velocity = np.zeros_like(x)
    velocity[49:] = shift + np.cross(spin, x[49:])
    pair = SurfacePair(ContactSurface(49 + upper[1][:, ::-1], np.ones(9, int)), ContactSurface(lower[1], np.zeros(36, int)), 0.3, 0.2)
    detector = Detector([pair], len(x))
    now, step = detector(x), 1e-5
    before, after = detector(x - step * velocity), detector(x + step * velocity)
    assert len(now) == 16
    np.testing.assert_array_equal(before.identity, after.identity)
    u = contact_matrix(now, len(x)).T @ velocity.ravel()
    np.testing.assert_allclose(u[::3], (after.gap - before.gap) / (2 * step), atol=1e-9)
    np.testing.assert_allclose(np.einsum("nji,nj->ni", now.frame, u.reshape(-1, 3)), velocity[now.nodes[:, 0]], atol=1e-14)


def test_closed_contacts_have_no_moment() -> None:
    """With zero gaps action and reaction act at one point: H r has neither resultant force nor moment."""
    lower, upper = plate(5, 5), plate(3, 3, x0=0.7)
    x = np.concatenate([lower[0], upper[0] + [0, 1.3, 0.0]])
    pair = SurfacePair(
        ContactSurface(36 + upper[1][:, ::-1], np.ones(9, int)), ContactSurface(lower[1], np.zeros(25, int)), 0.3, 0.2, "gauss"
    )
    contacts = Detector([pair], len(x))(x)
    assert len(contacts) == 36
    r = np.random.default_rng(0).normal(size=3 * 36)
    force = (contact_matrix(contacts, len(x)) @ r).reshape(-1, 3)
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-13)
    np.testing.assert_allclose(np.cross(x, force).sum(axis=0), 0.0, atol=1e-12)


def block_2d(x0: float, y0: float, width: float, height: float, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points of the bottom and top of a 2D block with n segments, bottom facets (left to right) and top facets (right to left)."""
    x = x0 + width * np.linspace(0, 1, n + 1)
    points = np.concatenate([np.column_stack([x, np.full(n + 1, y0)]), np.column_stack([x, np.full(n + 1, y0 + height)])])
    bottom = np.column_stack([np.arange(n), np.arange(n) + 1])
    return points, bottom, bottom[:, ::-1] + n + 1


@pytest.mark.parametrize(("rule", "count"), [("nodes", 5), ("faces", 4), ("gauss", 8)])
def test_blocks_in_two_dimensions(rule: CandidateRule, count: int) -> None:
    """A block over the joint of two blocks; its middle node stands over the joint and is taken once."""
    blocks = [block_2d(0, 0, 1, 1, 4), block_2d(1, 0, 1, 1, 4), block_2d(0.5, 1.001, 1, 1, 4)]
    x = np.concatenate([points for points, _, _ in blocks])
    master = ContactSurface(np.concatenate([blocks[0][2], blocks[1][2] + 10]), np.repeat([0, 1], 4))
    contacts = Detector([SurfacePair(ContactSurface(blocks[2][1] + 20, np.full(4, 2)), master, 0.4, 0.01, rule)], len(x))(x)
    assert len(contacts) == count
    np.testing.assert_allclose(contacts.gap, 1e-3, rtol=1e-10)
    np.testing.assert_allclose(contacts.frame, np.broadcast_to([[0, 1], [-1, 0]], (count, 2, 2)), atol=1e-15)
    H = contact_matrix(contacts, len(x))
    assert H.shape == (60, 2 * count)
    assert np.abs(H.T @ np.tile([0.3, -1.1], 30)).max() < 1e-15
    velocity = np.zeros((30, 2))
    velocity[20:] = [0.2, 0.5]
    np.testing.assert_allclose((H.T @ velocity.ravel()).reshape(-1, 2), np.broadcast_to([0.5, -0.2], (count, 2)), atol=1e-15)


def test_corner_and_ends_in_two_dimensions() -> None:
    """A broken line with a convex vertex: one contact in its fan, none beyond the ends."""
    line = np.array([[1.0, -1], [0, 0], [-1, -1]])
    below = np.array([[-0.05, 0.0], [0.05, 0.0]])  # looks down
    master, slave = ContactSurface(np.array([[0, 1], [1, 2]]), np.zeros(2, int)), ContactSurface(np.array([[3, 4]]), np.ones(1, int))
    detector = Detector([SurfacePair(slave, master, 0.4, 0.04, "faces")], 5)
    contacts = detector(np.concatenate([line, below + np.array([0.006, 0.03])]))
    assert len(contacts) == 1
    np.testing.assert_allclose(contacts.point, [[0, 0]], atol=1e-15)
    np.testing.assert_allclose(contacts.frame[0, 0], np.array([0.006, 0.03]) / np.hypot(0.006, 0.03))
    np.testing.assert_allclose(contacts.gap, np.hypot(0.006, 0.03))
    assert len(detector(np.concatenate([line, below + np.array([1.01, -1.0])]))) == 0
    assert len(detector(np.concatenate([line, below + np.array([0.5, -0.48])]))) == 1


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([2, 3]))
def test_broad_phase_finds_all_and_only_near_pairs(seed: int, d: int) -> None:
    generator = np.random.default_rng(seed)
    points, centres = generator.uniform(size=(40, d)), generator.uniform(size=(30, d))
    reach = 10.0 ** generator.uniform(-3, 0.5, 30)
    i, j = near_pairs(points, centres, reach)
    near = np.linalg.norm(points[:, None] - centres, axis=2) <= reach
    found = np.zeros_like(near)
    found[i, j] = True
    assert len(i) == near.sum()
    np.testing.assert_array_equal(found, near)
