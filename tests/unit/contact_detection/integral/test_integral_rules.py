"""The mortar and the segment Gauss point rule: weights, gaps and balance against integrals computed otherwise."""

from itertools import pairwise
from typing import Literal

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection

from fcsim.contact_detection import Contacts, ContactSurface, Detector, SurfacePair, contact_matrix
from fcsim.contact_detection.integral._overlap_kernels import overlap_polygons
from fcsim.contact_detection.integral.segment_to_segment import CENTRE, SIX_POINTS, THREE_POINTS
from fcsim.contact_detection.surfaces.surface import OPPOSING

Rule = Literal["mortar", "mortar-faces", "segments"]
RULES: list[Rule] = ["mortar", "mortar-faces", "segments"]


def line(x: np.ndarray, y: np.ndarray | float = 0.0, up: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Nodes of a polygonal line over x, and its segments looking up or down."""
    points = np.column_stack([x, np.broadcast_to(y, len(x))])
    segments = np.column_stack([np.arange(len(x) - 1), np.arange(1, len(x))])
    return points, segments[:, ::-1] if up else segments


def plate(x: np.ndarray, y: np.ndarray, up: bool = True, triangles: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and facets of the plane z = 0, cut at x and y."""
    points = np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros((len(x), len(y)))], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(len(x) - 1), np.arange(len(y) - 1), indexing="ij")
    facets = (i * len(y) + j).ravel()[:, None] + np.array([0, len(y), len(y) + 1, 1])
    if triangles:
        facets = np.concatenate([facets[:, [0, 1, 2]], facets[:, [0, 2, 3]]])
    return points, facets if up else facets[:, ::-1]


def detect(
    slave: tuple[np.ndarray, np.ndarray], masters: list[tuple[np.ndarray, np.ndarray]], rule: Rule, alert: float = 0.3
) -> tuple[Contacts, np.ndarray]:
    """Contacts of a slave surface with masters that are a body each, and all positions, the slave's nodes first."""
    points, facets, first = [slave[0]], [], len(slave[0])
    for nodes, cells in masters:
        points.append(nodes)
        facets.append(np.where(cells < 0, -1, cells + first))
        first += len(nodes)
    master = ContactSurface(np.concatenate(facets), np.repeat(np.arange(1, len(masters) + 1), [len(f) for f in facets]))
    pair = SurfacePair(ContactSurface(slave[1], np.zeros(len(slave[1]), int)), master, 0.5, alert, rule)
    x = np.concatenate(points)
    return Detector([pair], len(x))(x), x


def dense(contacts: Contacts, n_nodes: int) -> np.ndarray:
    """Weights as a full matrix (nc, n_nodes)."""
    full = np.zeros((len(contacts), n_nodes))
    row, place = np.nonzero(contacts.nodes >= 0)
    np.add.at(full, (row, contacts.nodes[row, place]), contacts.weights[row, place])
    return full


def hat(x: np.ndarray, k: int, at: float) -> float:
    """Piecewise linear shape function of node k."""
    return float(np.interp(at, x, np.eye(len(x))[k]))


def test_mortar_weights_in_two_dimensions() -> None:
    """int phi_j phi_k / int phi_j and - int phi_j psi_l / int phi_j by adaptive quadrature, on unequal meshes that end alike."""
    ours, theirs = np.array([0.0, 0.3, 1.0, 1.6, 2.0]), np.array([0.0, 0.7, 1.1, 2.0])
    contacts, _ = detect(line(ours, up=False), [line(theirs)], "mortar")
    found = dense(contacts, 9)
    breaks = np.union1d(ours, theirs)
    for j in range(5):
        size = quad(lambda x, j=j: hat(ours, j, x), 0, 2, points=breaks)[0]
        own = [quad(lambda x, j=j, k=k: hat(ours, j, x) * hat(ours, k, x), 0, 2, points=breaks)[0] for k in range(5)]
        other = [quad(lambda x, j=j, k=k: hat(ours, j, x) * hat(theirs, k, x), 0, 2, points=breaks)[0] for k in range(4)]
        np.testing.assert_allclose(found[j] * size, [*own, *(-np.array(other))], atol=1e-12)
    np.testing.assert_allclose(contacts.frame, np.broadcast_to([[0, 1], [-1, 0]], (5, 2, 2)), atol=1e-15)


def test_weights_of_constant_multipliers() -> None:
    """int phi_k / a and - int psi_l / a over each slave segment."""
    ours, theirs = np.array([0.0, 0.3, 1.0, 1.6, 2.0]), np.array([0.0, 0.7, 1.1, 2.0])
    contacts, _ = detect(line(ours, up=False), [line(theirs)], "mortar-faces")
    breaks = np.union1d(ours, theirs)
    for j, (a, b) in enumerate(pairwise(ours)):
        inside = breaks[(breaks > a) & (breaks < b)]
        own = [quad(lambda x, k=k: hat(ours, k, x), a, b, points=inside)[0] for k in range(5)]
        other = [quad(lambda x, k=k: hat(theirs, k, x), a, b, points=inside)[0] for k in range(4)]
        np.testing.assert_allclose(dense(contacts, 9)[j] * (b - a), [*own, *(-np.array(other))], atol=1e-12)


def test_mortar_weights_of_quadrilaterals_are_products() -> None:
    """On grids along the axes int over the plane is the product of those along x and y."""
    ours, theirs = (np.array([0, 0.3, 1.0]), np.array([0, 0.5, 0.9])), (np.array([0, 0.6, 1.0]), np.array([0, 0.2, 0.9]))
    contacts, x = detect(plate(*ours, up=False), [plate(*theirs)], "mortar")
    along = [dense(detect(line(a, up=False), [line(b)], "mortar")[0], 6) for a, b in zip(ours, theirs, strict=True)]
    found = dense(contacts, len(x))
    np.testing.assert_allclose(found[:, :9], np.kron(along[0][:, :3], along[1][:, :3]), atol=1e-13)
    np.testing.assert_allclose(found[:, 9:], -np.kron(along[0][:, 3:], along[1][:, 3:]), atol=1e-13)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([(3, 3), (3, 4), (4, 3), (4, 4)]))
def test_overlap_against_half_spaces(seed: int, sides: tuple[int, int]) -> None:
    """Two plane convex polygons anywhere in space: the overlap is that of the intersected half planes."""
    generator = np.random.default_rng(seed)
    plane, corners = [], np.empty((2, 4, 3))
    rotation = np.linalg.qr(generator.normal(size=(3, 3)))[0]
    rotation[0] *= np.linalg.det(rotation)  # rows N, T1, T2
    for k, n in enumerate(sides):
        while True:  # a convex polygon of n corners
            points = generator.uniform(-1, 1, (n, 2))
            hull = ConvexHull(points)
            if len(hull.vertices) == n and hull.volume > 0.05:
                break
        plane.append(hull)
        ring = points[hull.vertices] if k == 0 else points[hull.vertices[::-1]]
        corners[k, :n] = ring @ rotation[1:] + (0.1 * k + 0.05 * generator.uniform(-1, 1, n)[:, None] * k) * rotation[0]
        corners[k, n:] = corners[k, 0]
    inside = np.concatenate([hull.equations for hull in plane])
    centre, radius = inner_circle(inside)
    assume(abs(radius) > 1e-4)  # Qhull needs a point well inside
    area = ConvexHull(HalfspaceIntersection(inside, centre).intersections).volume if radius > 0 else 0.0
    one, centre0 = np.zeros(1, int), np.zeros((1, 3))
    n_s, n_m = (np.array([n]) for n in sides)
    polygon, count, found = overlap_polygons(
        one, one, corners[:1], n_s, rotation[None], centre0, np.ones(1), corners[1:], n_m, -rotation[:1], OPPOSING, np.ones(1)
    )
    np.testing.assert_allclose(found[0], area, atol=1e-9)
    if area > 1e-9:
        assert 3 <= count[0] <= sum(sides)
        corner = polygon[0, : count[0]]
        assert (inside[:, :2] @ corner.T + inside[:, 2:] <= 1e-9).all()
        np.testing.assert_allclose(ConvexHull(corner).volume, area, atol=1e-9)


def inner_circle(half_planes: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre and radius of the largest circle in an intersection of half planes; a negative radius where it is empty."""
    A = np.column_stack([half_planes[:, :2], np.ones(len(half_planes))])
    best = linprog([0, 0, -1], A_ub=A, b_ub=-half_planes[:, 2], bounds=[(None, None)] * 3)
    return best.x[:2], float(best.x[2])


@pytest.mark.parametrize(("rule", "degree"), [(CENTRE, 1), (THREE_POINTS, 2), (SIX_POINTS, 4)])
def test_rules_of_a_triangle(rule: tuple[np.ndarray, np.ndarray], degree: int) -> None:
    """int a^i b^j = 2 i! j! / (i + j + 2)! of the area (Zienkiewicz and Taylor), exactly to the degree and not beyond."""
    from math import factorial

    points, weights = rule
    for n in range(degree + 2):
        wrong = [
            abs(weights @ (points[:, 1] ** i * points[:, 2] ** (n - i)) - 2 * factorial(i) * factorial(n - i) / factorial(n + 2))
            for i in range(n + 1)
        ]
        assert (max(wrong) < 1e-14) == (n <= degree)


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("triangles", [False, True])
def test_balance_on_flat_surfaces(rule: Rule, triangles: bool) -> None:
    """Closed: neither resultant nor moment for any reactions. A rigid translation gives no velocity."""
    slave = plate(np.linspace(0, 1, 4), np.linspace(0, 1, 5), up=False, triangles=triangles)
    contacts, x = detect(slave, [plate(np.linspace(-0.2, 1.1, 4), np.linspace(-0.1, 1.3, 3), triangles=triangles)], rule)
    np.testing.assert_allclose(contacts.gap, 0, atol=1e-15)
    np.testing.assert_allclose(contacts.weights.sum(axis=1), 0, atol=1e-14)
    H = contact_matrix(contacts, len(x))
    force = (H @ np.random.default_rng(1).normal(size=H.shape[1])).reshape(-1, 3)
    np.testing.assert_allclose(force.sum(axis=0), 0, atol=1e-13 * len(contacts))
    np.testing.assert_allclose(np.cross(x, force).sum(axis=0), 0, atol=1e-13 * len(contacts))
    np.testing.assert_allclose(H.T @ np.tile([0.3, -1.0, 0.4], len(x)), 0, atol=1e-14)


def test_moment_of_the_mortar_rule_between_curved_surfaces() -> None:
    """Two cuts of the unit circle: normal reactions have a moment that falls as h^3."""
    sizes, levers = [], []
    for n in (8, 16, 32):
        outer, inner = (np.linspace(0.2, 1.4, k * n + 1) for k in (2, 3))
        ring = [np.column_stack([np.cos(a), np.sin(a)]) for a in (outer, inner + 0.02 * np.sin(7 * (inner - 0.2)))]
        step = np.column_stack([np.arange(2 * n), np.arange(1, 2 * n + 1)])
        master = np.column_stack([np.arange(3 * n), np.arange(1, 3 * n + 1)])
        contacts, x = detect((ring[0], step[:, ::-1]), [(ring[1], master)], "mortar")
        assert len(contacts) == 2 * n + 1
        H = contact_matrix(contacts, len(x))
        normal = np.tile([1.0, 0.0], (len(contacts), 1)).ravel()
        columns = (H @ np.diag(normal))[:, ::2].reshape(len(x), 2, -1)
        moment = np.abs((x[:, 0, None] * columns[:, 1] - x[:, 1, None] * columns[:, 0]).sum(axis=0))
        sizes.append(1.2 / (2 * n))
        levers.append(moment[2:-2].max())
    assert levers[-1] > 1e-12
    slopes = np.diff(np.log(levers)) / np.diff(np.log(sizes))
    assert (slopes > 2.7).all()


def cap(n: int, turned: float, out: bool, triangles: bool) -> tuple[np.ndarray, np.ndarray]:
    """A piece of the unit sphere around the z axis in n x n facets (or twice as many triangles), turned about it."""
    s = np.tan(np.linspace(-0.5, 0.5, n + 1))
    x, y = np.meshgrid(s, s, indexing="ij")
    points = np.stack([np.cos(turned) * x - np.sin(turned) * y, np.sin(turned) * x + np.cos(turned) * y, np.ones_like(x)], axis=-1).reshape(
        -1, 3
    )
    facets = plate(s, s, up=out, triangles=triangles)[1]
    return points / np.linalg.norm(points, axis=1)[:, None], facets


@pytest.mark.parametrize("rule", ["mortar", "mortar-faces"])
@pytest.mark.parametrize("triangles", [False, True])
def test_mortar_rules_between_spheres(rule: Rule, triangles: bool) -> None:
    """Two cuts of the unit sphere, the inner one turned by 0.3 rad: the gaps are of order 2 or better, normals of order 1 or
    better, and there is no resultant; moments are of order 3, and none where a contact has the normal of one facet."""
    sizes, gaps, levers, tilts = [], [], [], []
    for n in (6, 12, 24):
        slave, master = cap(n, 0.0, out=False, triangles=triangles), cap(n + 1, 0.3, out=True, triangles=triangles)
        contacts, x = detect(slave, [master], rule)
        way = contacts.point / np.linalg.norm(contacts.point, axis=1)[:, None]
        inner = np.hypot(*way[:, :2].T) < 0.3
        H = contact_matrix(contacts, len(x))
        force = H[:, ::3].toarray().reshape(len(x), 3, -1)
        np.testing.assert_allclose(force.sum(axis=0), 0, atol=1e-13)
        moment = np.linalg.norm(np.cross(x[:, None], np.moveaxis(force, 2, 1)).sum(axis=0), axis=1)
        sizes.append(1.0 / n)
        gaps.append(np.abs(contacts.gap[inner]).max())
        levers.append(moment[inner].max())
        tilts.append(np.linalg.norm(contacts.frame[inner, 0] - way[inner], axis=1).max())
    order = {name: np.diff(np.log(v)) / np.diff(np.log(sizes)) for name, v in (("gap", gaps), ("lever", levers), ("tilt", tilts))}
    assert (order["gap"] > 1.6).all(), order
    assert max(levers) < 1e-15 if rule == "mortar-faces" else order["lever"][-1] > 2.3, order
    assert (order["tilt"] > 0.7).all(), order


@pytest.mark.parametrize("rule", RULES)
def test_tilted_gap(rule: Rule) -> None:
    """A gap that varies linearly along the slave: weighted with phi_j it is its value at the centroid of phi_j."""
    ours = np.array([0.0, 0.5, 1.2, 2.0])
    slave, (nodes, segments) = line(ours, 0.1, up=False), line(np.array([-1.0, 0.8, 3.0]))
    nodes = nodes + np.column_stack([np.zeros(3), -0.05 * nodes[:, 0]])
    contacts, x = detect(slave, [(nodes, segments)], rule)
    where = np.where(contacts.weights > 0, contacts.weights, 0)
    place = np.einsum("nk,nkd->nd", where, x[contacts.nodes])[:, 0]
    np.testing.assert_allclose(contacts.gap, 0.1 + 0.05 * place, atol=1e-14)
    if rule == "mortar":
        sizes = np.diff(ours)
        centroid = [sizes[0] / 3, *(ours[1:3] + np.diff(sizes) / 3), 2 - sizes[-1] / 3]
        np.testing.assert_allclose(place, centroid, atol=1e-14)


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("d", [2, 3])
def test_only_the_covered_part_carries(rule: Rule, d: int) -> None:
    """A slave of 3 facets along x over a master that ends in the middle of the second."""
    cuts = np.arange(4.0)
    if d == 2:
        contacts, x = detect(line(cuts, up=False), [line(np.array([-1.0, 1.5]))], rule)
        share = 1.0
    else:
        contacts, x = detect(plate(cuts, np.array([0.0, 1.0]), up=False), [plate(np.array([-1.0, 1.5]), np.array([-1.0, 2.0]))], rule)
        share = 2.0
    on_slave = np.einsum("nk,nkd->nd", np.maximum(contacts.weights, 0), x[contacts.nodes])
    assert (on_slave[:, 0] < 1.5).all() and (contacts.point[:, 0] < 1.5).all()
    if rule == "mortar":  # nodes at x = 0, 1, 2: the last has a covered part, int_1^1.5 (x - 1) dx = 1/8; x = 3 has none
        assert len(contacts) == 3 * share
        last = on_slave[:, 0].max()
        np.testing.assert_allclose(last, 1 + (1 / 24) / (1 / 8))  # int (x - 1)^2 dx / int (x - 1) dx


def test_slivers_carry_nothing() -> None:
    """Edges that stand over each other but for round-off or a hundredth of a facet do not make contacts with the next body."""
    for off in (0.0, 1e-13, -1e-13, 5e-3, -5e-3):
        masters = [line(np.array([-1.0, 1.0 + off])), line(np.array([1.0 + off, 3.0]))]
        contacts, _ = detect(line(np.array([0.0, 1.0]), up=False), masters, "mortar")
        assert (contacts.bodies[:, 1] == 1).sum() == 2
        assert (contacts.bodies[:, 1] == 2).sum() <= (off < -1e-6)  # the node above the sliver itself


@pytest.mark.parametrize("rule", RULES)
def test_several_masters_share_a_slave(rule: Rule) -> None:
    """Forces of a uniform pressure: each of two master bodies gets what lies above it, node by node as the integral says."""
    slave = plate(np.linspace(0, 1, 4), np.linspace(0, 1, 3), up=False)
    left, right = (plate(np.array(c), np.linspace(0, 1, 4)) for c in ([0, 0.2, 0.45], [0.45, 0.7, 1.0]))
    contacts, x = detect(slave, [left, right], rule)
    assert set(contacts.bodies[:, 1]) == {1, 2}
    H = contact_matrix(contacts, len(x))[2::3, ::3].toarray()  # vertical forces of normal reactions
    wanted = np.zeros(len(x))
    first = len(slave[0])
    for (points, facets), start, sign in ((slave, 0, 1), (left, first, -1), (right, first + len(left[0]), -1)):
        for facet in facets:
            wanted[start + facet] += sign * np.prod(np.ptp(points[facet, :2], axis=0)) / 4
    r = np.linalg.lstsq(H, wanted, rcond=None)[0]
    np.testing.assert_allclose(H @ r, wanted, atol=1e-14)
    if rule != "segments":  # isostatic: the reactions are the covered shares of nodes or facets, all positive
        assert np.linalg.matrix_rank(H) == len(contacts)
        assert (r > 0).all()
        for body, area in ((1, 0.45), (2, 0.55)):
            np.testing.assert_allclose(r[contacts.bodies[:, 1] == body].sum(), area)


@pytest.mark.parametrize("rule", RULES)
def test_far_apart_wrong_side_and_deep_give_none(rule: Rule) -> None:
    slave, master = plate(np.linspace(0, 1, 3), np.linspace(0, 1, 3), up=False), plate(np.linspace(0, 1, 4), np.linspace(0, 1, 4))
    for height, count in ((0.29, True), (0.31, False), (-0.1, True), (-0.32, False)):
        contacts, _ = detect((slave[0] + [0, 0, height], slave[1]), [master], rule)
        assert bool(len(contacts)) == count
        np.testing.assert_allclose(contacts.gap, height)
    assert len(detect((slave[0] + [0, 0, 0.1], slave[1][:, ::-1]), [master], rule)[0]) == 0
    assert len(detect((slave[0] + [1.5, 0, 0.1], slave[1]), [master], rule)[0]) == 0
    empty = detect((slave[0] + [9, 0, 0.1], slave[1]), [master], rule)[0]
    assert empty.frame.shape == (0, 3, 3) and empty.nodes.shape == empty.weights.shape and len(empty.gap) == 0


def test_two_dimensions_are_a_slice_of_three() -> None:
    """A sheet one element thick: summed over the thickness the 3D rule is the 2D one."""
    ours, theirs = np.array([0.0, 0.4, 1.0]), np.array([-0.1, 0.25, 0.7, 1.2])
    flat, _ = detect(line(ours, 0.02, up=False), [line(theirs)], "mortar")
    deep = np.array([0.0, 1.0])
    nodes, facets = plate(ours, deep, up=False)
    solid, _ = detect((nodes + np.array([0, 0, 0.02]), facets), [plate(theirs, deep)], "mortar")
    sheet = dense(solid, 6 + 8).reshape(3, 2, -1).sum(axis=1)
    np.testing.assert_allclose(sheet[:, :6].reshape(3, 3, 2).sum(axis=2) / 2, dense(flat, 7)[:, :3], atol=1e-14)
    np.testing.assert_allclose(sheet[:, 6:].reshape(3, 4, 2).sum(axis=2) / 2, dense(flat, 7)[:, 3:], atol=1e-14)


@pytest.mark.parametrize("rule", RULES)
def test_triangles_among_quadrilaterals(rule: Rule) -> None:
    """Some squares cut in two on both sides: gaps of a flat joint stay, and the forces of a uniform pressure too."""
    slave, master = plate(np.linspace(0, 1, 4), np.linspace(0, 1, 4), up=False), plate(np.linspace(0, 1, 3), np.linspace(0, 1, 3))
    mixed = []
    for _, facets in (slave, master):
        cut = np.concatenate([facets[::2][:, [0, 1, 2]], facets[::2][:, [0, 2, 3]]])
        mixed.append(np.concatenate([facets[1::2], np.column_stack([cut, np.full(len(cut), -1)])]))
    contacts, x = detect((slave[0] + [0, 0, 0.01], mixed[0]), [(master[0], mixed[1])], rule)
    np.testing.assert_allclose(contacts.gap, 0.01, atol=1e-15)
    np.testing.assert_allclose(contacts.weights.sum(axis=1), 0, atol=1e-14)
    wanted = np.zeros(len(x))
    for points, facets, start, sign in ((slave[0], mixed[0], 0, 1), (master[0], mixed[1], 16, -1)):
        for facet in facets:
            real = facet[facet >= 0]
            wanted[start + real] += sign * np.prod(np.ptp(points[real, :2], axis=0)) / (4 if len(real) == 4 else 6)
    H = contact_matrix(contacts, len(x))[2::3, ::3].toarray()
    np.testing.assert_allclose(H @ np.linalg.lstsq(H, wanted, rcond=None)[0], wanted, atol=1e-14)


def test_rules_side_by_side() -> None:
    """Pairs of all rules in one detector: the contacts of each alone, in the order of the pairs, with numbers of their own."""
    x, facets = plate(np.linspace(0, 1, 4), np.linspace(0, 1, 4))
    upper, lower = np.linspace(0, 1, 3), np.linspace(0, 1, 4)
    nodes, looking_down = plate(upper, upper, up=False)
    x = np.concatenate([x, nodes + np.array([0, 0, 0.01])])
    slave, master = ContactSurface(16 + looking_down, np.ones(4, int)), ContactSurface(facets, np.zeros(9, int))
    rules = ["segments", "nodes", "mortar", "faces", "mortar-faces"]
    pairs = [SurfacePair(slave, master, 0.1 * k, 0.1, rule) for k, rule in enumerate(rules)]  # type: ignore[arg-type]
    pairs.append(SurfacePair(master, slave, 0.5, 0.1, "mortar"))
    contacts = Detector(pairs, len(x))(x)
    assert (np.diff(contacts.identity) > 0).all()
    assert len(lower) == 4
    first = 0
    for pair in pairs:
        alone = Detector([pair], len(x))(x)
        part = contacts.take(np.arange(first, first + len(alone)))
        first += len(alone)
        for name in ("point", "frame", "gap", "mu", "bodies"):
            np.testing.assert_array_equal(getattr(part, name), getattr(alone, name))
        np.testing.assert_array_equal(dense(part, len(x)), dense(alone, len(x)))
    assert first == len(contacts)


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("seed", range(3))
def test_normal_velocity_is_the_rate_of_the_gap(rule: Rule, seed: int) -> None:
    """A flat master at rest, a slave in rigid translation: u_N = d gap / dt by central differences."""
    generator = np.random.default_rng(seed)
    R = np.linalg.qr(generator.normal(size=(3, 3)))[0]
    R *= np.linalg.det(R)
    slave = plate(np.linspace(0, 1, 4), np.linspace(0, 1, 3), up=False)
    master = plate(np.array([-1, 0.4, 2]), np.array([-1, 0.7, 2]))
    shift = generator.normal(size=3)
    found = [
        detect(((slave[0] + [0, 0, 0.05]) @ R.T + dt * shift, slave[1]), [(master[0] @ R.T, master[1])], rule) for dt in (-1e-6, 0, 1e-6)
    ]
    (before, _), (now, x), (after, _) = found
    velocity = np.zeros_like(x)
    velocity[: len(slave[0])] = shift
    u = contact_matrix(now, len(x)).T @ velocity.ravel()
    assert len(now) == len(before) == len(after)
    np.testing.assert_allclose(u[::3], (after.gap - before.gap) / 2e-6, atol=1e-8)
    np.testing.assert_allclose(u[::3], shift @ R[:, 2], atol=1e-12)


@pytest.mark.parametrize("rule", ["mortar-faces", "segments"])
def test_warped_quadrilaterals(rule: Rule) -> None:
    """Bilinear facets out of plane: points of both facets, and their means, on one line along the slave's mean normal, apart by the gap;
    the contacts of points have the normal of the slave there."""
    generator = np.random.default_rng(4)
    slave, master = plate(np.linspace(0, 1, 4), np.linspace(0, 1, 4), up=False), plate(np.linspace(-0.1, 1.1, 4), np.linspace(-0.2, 1.1, 4))
    for points in (slave[0], master[0]):
        points += 0.03 * generator.uniform(-1, 1, points.shape)
    contacts, x = detect((slave[0] + [0, 0, 0.05], slave[1]), [master], rule)
    assert len(contacts) > 27 if rule == "segments" else len(contacts) == 9
    on_slave = np.einsum("nk,nkd->nd", np.maximum(contacts.weights, 0), x[contacts.nodes])
    if rule == "mortar-faces":
        np.testing.assert_allclose(on_slave - contacts.point, contacts.gap[:, None] * contacts.frame[:, 0], atol=1e-12)
        return
    corners, phi = x[contacts.nodes[:, :4]], contacts.weights[:, :4]
    along = unit(np.cross(corners[:, 2] - corners[:, 0], corners[:, 1] - corners[:, 3]))
    apart = np.einsum("nd,nd->n", on_slave - contacts.point, along)
    np.testing.assert_allclose(on_slave - contacts.point, apart[:, None] * along, atol=1e-12)
    s, t = phi[:, 1:3].sum(axis=1)[:, None], phi[:, 2:].sum(axis=1)[:, None]
    tangents = [(1 - b) * (corners[:, i] - corners[:, 0]) + b * (corners[:, 2] - corners[:, j]) for i, j, b in ((1, 3, t), (3, 1, s))]
    np.testing.assert_allclose(contacts.frame[:, 0], -unit(np.cross(*tangents)), atol=1e-9)
    np.testing.assert_allclose(contacts.gap, apart * np.einsum("nd,nd->n", along, contacts.frame[:, 0]), atol=1e-12)


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]
