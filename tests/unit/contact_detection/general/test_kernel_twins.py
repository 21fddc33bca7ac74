"""The compiled loops of contact of everything against twins written with arrays: another way to the same numbers."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import minimize
from scipy.spatial import ConvexHull

from fcsim.assembly.model import build_model
from fcsim.contact_detection import Everything
from fcsim.contact_detection.general._edge_kernels import EdgesOfAll, crossings
from fcsim.contact_detection.general._folding_kernels import across_void, edges_across_void, sees_itself
from fcsim.contact_detection.general._foot_kernels import feet
from fcsim.contact_detection.general._near_kernels import body_pairs, item_pairs
from fcsim.contact_detection.general._pierce_kernels import inside, piercing
from fcsim.contact_detection.general._smoothing_kernels import interpolated_normals
from fcsim.contact_detection.general.near import near_bodies
from fcsim.contact_detection.general.vertices import vertex_contacts
from fcsim.contact_detection.skin._rim_kernels import FACING
from fcsim.contact_detection.skin.shape import shape_of
from tests.unit.contact_detection.general.rocks import body, pair_of_rocks, rock


def surface(rng: np.random.Generator, corners: int = 20) -> Everything:
    return Everything(build_model([body("rock", *rock(rng, corners, 3.0))]), 0.5)


def meet(low_a, high_a, low_b, high_b, by) -> np.ndarray:
    """Which boxes (na, nb) come within `by` of each other."""
    apart = (low_a[:, None] > high_b[None] + by) | (low_b[None] > high_a[:, None] + by)
    return ~apart.any(axis=2)


@pytest.mark.parametrize("seed", range(5))
def test_pairs_of_bodies(seed: int) -> None:
    rng = np.random.default_rng(seed)
    low = rng.uniform(0, 5, (80, 3))
    high, reach = low + rng.uniform(0, 1, (80, 3)), rng.uniform(0, 0.1, 80)
    axis = int(rng.integers(3))
    found = body_pairs(low, high, reach, np.argsort(low[:, axis] - reach, kind="stable"), axis)
    # the reach of one differs from that of another: the condition is symmetric in a and b
    expected = np.argwhere(np.triu(meet(low, high, low, high, (reach[:, None] + reach[None])[:, :, None]), 1))
    assert {tuple(pair) for pair in found.tolist()} == {tuple(pair) for pair in expected.tolist()}


@pytest.mark.parametrize("items", [5, 60])
def test_pairs_of_items(items: int) -> None:
    """Few items are looked at all together, many by sweeping: the same pairs."""
    rng = np.random.default_rng(items)
    first = np.array([0, items, 2 * items, 3 * items])
    low = rng.uniform(0, 1, (3 * items, 3))
    high = low + rng.uniform(0, 0.1, low.shape)
    body_low, body_high = (f.reduceat(x, first[:-1], axis=0) for f, x in ((np.minimum, low), (np.maximum, high)))
    pairs, reach = np.array([[0, 1], [2, 0], [1, 1]]), np.array([0.05, 0.01, 0.02])
    found = item_pairs(pairs, body_low, body_high, first, low, high, first, low, high, reach, reach)
    expected = []
    for p, (a, b) in enumerate(pairs):
        ours, theirs = (np.arange(first[k], first[k + 1]) for k in (a, b))
        close = np.argwhere(meet(low[ours], high[ours], low[theirs], high[theirs], reach[p]))
        expected += [(int(ours[i]), int(theirs[j]), p) for i, j in close]
    assert sorted(map(tuple, found.tolist())) == sorted(expected)


def test_feet_are_nearest_points() -> None:
    """Against SciPy's bounded minimisation of the distance over the facet: segments, triangles, quadrilaterals, flat and warped."""
    rng = np.random.default_rng(3)
    point = rng.normal(size=(200, 3))
    for sides in (2, 3, 4):
        for _ in range(12):
            corners = rng.normal(size=(sides, 3)) if sides < 4 else np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0.0)])
            if sides == 4:
                corners = corners + 0.15 * rng.normal(size=(4, 3))
            if sides == 2:
                corners[:, 2] = 0
            vertex = 0.7 * rng.normal(size=3) * ([1, 1, 0] if sides == 2 else 1)
            points = np.concatenate([point, corners, [vertex]])
            row = np.array([[200, 201, 201, 200], [200, 201, 202, 200], [200, 201, 202, 203]][sides - 2])[None]
            area = (
                np.cross(corners[2] - corners[0], corners[-1] - corners[1])
                if sides == 4
                else np.cross(corners[1] - corners[0], corners[-1] - corners[0])
            )
            if sides == 2:
                along = corners[1] - corners[0]
                area = np.array([along[1], -along[0], 0.0])
            normal = (area / np.linalg.norm(area))[None]
            weights, _, height, distance, _ = feet(np.array([len(points) - 1]), np.array([0]), points, row, np.array([sides]), normal)

            def off(z: np.ndarray, corners: np.ndarray = corners, sides: int = sides, vertex: np.ndarray = vertex) -> float:
                if sides == 4:
                    w = np.array([(1 - z[0]) * (1 - z[1]), z[0] * (1 - z[1]), z[0] * z[1], (1 - z[0]) * z[1]])
                elif sides == 3:
                    w = np.array([1 - z[0], z[0] * (1 - z[1]), z[0] * z[1]])
                else:
                    w = np.array([1 - z[0], z[0]])
                return float(np.sum((w @ corners - vertex) ** 2))

            best = min(
                np.sqrt(minimize(off, start, bounds=[(0, 1)] * 2, tol=1e-15).fun)
                for start in ((0.5, 0.5), (0.1, 0.1), (0.9, 0.1), (0.9, 0.9), (0.1, 0.9))
            )
            assert_allclose(distance[0], best, atol=2e-6)
            assert_allclose(weights[0].sum(), 1, atol=1e-12)
            assert_allclose(np.linalg.norm(weights[0, : max(sides, 2)] @ points[row[0, :sides]] - vertex), distance[0], atol=1e-12)
            assert abs(height[0]) <= distance[0] * (1 + 1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_inside(seed: int) -> None:
    """Below all planes of a convex body; twice where it is counted with its double."""
    rng = np.random.default_rng(seed)
    everything = surface(rng)
    shape, skin = shape_of(everything.skin, everything.model.reference), everything.skin
    at = shape.point.mean(axis=0) + 0.6 * rng.normal(size=(300, 3))
    planes = ConvexHull(shape.point).equations
    expected = (at @ planes[:, :3].T + planes[:, 3]).max(axis=1) < 0
    zero, one, exactly = np.zeros(len(at), dtype=np.int64), np.ones(len(at), dtype=np.int64), np.zeros(len(at))
    assert np.array_equal(inside(at, zero, one, exactly, skin.first_facet, shape.point, skin.facets, skin.sides), expected)
    margin = rng.uniform(0, 0.3, len(at))
    deeper = (at @ planes[:, :3].T + planes[:, 3]).max(axis=1) < -margin
    assert np.array_equal(inside(at, zero, one, margin, skin.first_facet, shape.point, skin.facets, skin.sides), deeper)
    middle = shape.centre[:, None] + np.linspace(-1e-16, 1e-16, 3)[:, None] * shape.normal[:, None]
    on, none = middle.reshape(-1, 3), np.zeros(3 * len(middle), dtype=np.int64)
    assert not inside(on, none, none + 1, np.full(len(none), 1e-9), skin.first_facet, shape.point, skin.facets, skin.sides).any()
    assert not inside(at, zero, 2 * one, exactly, skin.first_facet, shape.point, skin.facets, skin.sides).any()
    double = np.concatenate([skin.facets, skin.facets])
    count = np.array([0, len(double)])
    assert np.array_equal(inside(at, zero, 2 * one, exactly, count, shape.point, double, np.tile(skin.sides, 2)), expected)


def test_edges_through_facets() -> None:
    """By the signs of volumes of tetrahedra."""
    rng = np.random.default_rng(8)
    n = 400
    ends, corners = rng.normal(size=(n, 2, 3)), rng.normal(size=(n, 3, 3))
    point = np.concatenate([ends.reshape(-1, 3), corners.reshape(-1, 3)])
    edges, facets = np.arange(2 * n).reshape(n, 2), 2 * n + np.arange(3 * n).reshape(n, 3)
    facets = np.column_stack([facets, facets[:, 0]])
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = area / np.linalg.norm(area, axis=1)[:, None]
    rows = np.arange(n)
    through, end = piercing(rows, rows, np.full(n, 1e-12), point, normals, edges, facets, np.full(n, 3))

    def volume(a, b, c, d) -> np.ndarray:
        return np.einsum("nd,nd->n", np.cross(b - a, c - a), d - a)

    p, q = ends[:, 0], ends[:, 1]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    opposite = volume(a, b, c, p) * volume(a, b, c, q) < 0
    turns = np.stack([volume(p, q, a, b), volume(p, q, b, c), volume(p, q, c, a)])
    expected = opposite & (np.all(turns > 0, axis=0) | np.all(turns < 0, axis=0))
    assert np.array_equal(through, expected) and expected.sum() > 20
    height = np.einsum("nkd,nd->nk", ends - a[:, None], normals)
    assert np.array_equal(end, np.argmin(height, axis=1))


@pytest.mark.parametrize("distance", [3e-3, -1e-3])
@pytest.mark.parametrize("seed", range(4))
def test_crossings(seed: int, distance: float) -> None:
    """All pairs of sharp edges of two rocks at once: the common normal lies in both arcs of normals and the feet within both edges."""
    rng = np.random.default_rng(seed)
    model, _ = pair_of_rocks(rng, distance, aspect=2.0)
    everything = Everything(model, 0.5)
    skin, shape = everything.skin, shape_of(everything.skin, model.reference)
    sharp = [np.flatnonzero(skin.sharp & (skin.facet_body[skin.edge_facets[:, 0]] == k)) for k in range(2)]
    first, second = (grid.ravel() for grid in np.meshgrid(*sharp, indexing="ij"))
    n = len(first)
    limit = np.full(n, 0.05)
    row, _, gap, place, _ = crossings(
        first, second, limit, limit, np.full(n, 1e-9),
        EdgesOfAll(
            shape.point, shape.normal, shape.size, shape.mean, skin.edges, skin.edge_facets, skin.facets, skin.sides,
            np.ones(len(skin.edges), dtype=bool), np.zeros((len(skin.edges), 2), dtype=bool), 0,
        ),
    )  # fmt: skip
    pa, qa = (shape.point[skin.edges[first, k]] for k in range(2))
    pb, qb = (shape.point[skin.edges[second, k]] for k in range(2))
    u, v = qa - pa, qb - pb
    na, nb = shape.normal[skin.edge_facets[first]], shape.normal[skin.edge_facets[second]]
    opposed = np.einsum("nid,njd->nij", na, nb).min(axis=(1, 2)) < -np.cos(np.deg2rad(1.0))
    across = np.cross(u, v)
    sine = np.linalg.norm(across, axis=1) / np.linalg.norm(u, axis=1) / np.linalg.norm(v, axis=1)
    N = across / np.linalg.norm(across, axis=1)[:, None]
    N = N * np.sign(np.einsum("nd,nd->n", N, nb.sum(axis=1)))[:, None]
    system = np.stack([u, -v, N], axis=2)
    usable = (sine > 1e-3) & ~opposed & (np.einsum("nd,nd->n", N, na.sum(axis=1)) < 0)
    s, t, minus_gap = np.linalg.solve(system[usable], (pb - pa)[usable][:, :, None])[:, :, 0].T
    within = (s > 0) & (s < 1) & (t > 0) & (t < 1) & (np.abs(minus_gap) < 0.05)
    rows = np.flatnonzero(usable)[within]

    def away(edge: np.ndarray, side: int, N: np.ndarray, direction: np.ndarray) -> np.ndarray:
        n = shape.normal[skin.edge_facets[edge, side]]
        inwards = np.cross(n, direction) if side == 0 else np.cross(direction, n)
        return np.einsum("nd,nd->n", inwards, N) / np.linalg.norm(inwards, axis=1)

    falls = np.ones(len(rows), dtype=bool)
    for side in range(2):
        falls &= away(second[rows], side, N[rows], v[rows]) <= 0.05
        falls &= away(first[rows], side, N[rows], u[rows]) >= -0.05
    found = dict(zip(row.tolist(), zip(gap, place[:, 0], place[:, 1], strict=True), strict=True))
    expected = {
        int(k): (-g, x, y) for k, g, x, y in zip(rows[falls], minus_gap[within][falls], s[within][falls], t[within][falls], strict=True)
    }
    flat = {int(k) for k in np.flatnonzero(opposed)}
    assert set(found) - flat == set(expected) - flat
    for k in set(expected) - flat:
        assert_allclose(found[k], expected[k], atol=1e-9)


@pytest.mark.parametrize("distance", [1e-3, -1e-3])
@pytest.mark.parametrize("seed", range(6))
def test_vertices_of_convex_bodies(seed: int, distance: float) -> None:
    """Of convex bodies all planes tell: a vertex in contact has the height of its facet's plane, is inside exactly if it is below all of
    them, and its surroundings face the facet."""
    rng = np.random.default_rng(seed)
    model, _ = pair_of_rocks(rng, distance, aspect=2.0)
    everything = Everything(model, 0.5, alert=5e-3)
    skin, shape = everything.skin, shape_of(everything.skin, model.reference)
    near = near_bodies(shape.body_low, shape.body_high, everything.lengths)
    found, *_ = vertex_contacts(skin, shape, near, shape, 0, everything.face)
    height = np.einsum("vfd,fd->vf", shape.point[:, None] - shape.centre[None], shape.normal)
    other = skin.vertex_body[:, None] != skin.facet_body[None]
    below = np.where(other, height, -np.inf).max(axis=1) < 0
    rolled = np.abs(np.einsum("cd,cd->c", found.normal, shape.normal[found.facet]) - 1) > 1e-9
    assert_allclose(found.gap[~rolled], height[found.vertex, found.facet][~rolled], atol=1e-12)
    assert np.array_equal(found.gap < 0, below[found.vertex])
    star = [skin.star[skin.first_star[v] : skin.first_star[v + 1]] for v in range(len(skin.node))]
    for v, f in zip(found.vertex[~rolled], found.facet[~rolled], strict=True):
        assert max(-shape.normal[star[v]] @ shape.normal[f]) > FACING or -shape.mean[v] @ shape.normal[f] > FACING


def test_what_a_body_sees_of_itself() -> None:
    """A convex body nothing; a vertex and a facet before each other, or behind, by the signs of heights over both."""
    rng = np.random.default_rng(4)
    everything = surface(rng, 40)
    skin, shape = everything.skin, shape_of(everything.skin, everything.model.reference)
    data = (shape.point, shape.normal, shape.centre, shape.size, skin.facets, skin.sides)
    assert not sees_itself(0, len(skin.facets), *data)
    turned = (shape.point, -shape.normal, *data[2:])  # a cavity
    assert sees_itself(0, len(skin.facets), *turned)
    vertex, facet = (grid.ravel() for grid in np.meshgrid(np.arange(len(skin.node)), np.arange(len(skin.facets)), indexing="ij"))
    weights = np.zeros((len(vertex), 4))
    weights[:, :3] = 1 / 3
    reach, near = np.full(len(vertex), 0.5), np.full(len(vertex), 1e-9)
    for sign in (1.0, -1.0):
        n = sign * shape.normal
        found = across_void(
            vertex, facet, weights, reach, near, n, sign * shape.mean, shape.point, n, skin.facets, skin.star, skin.first_star
        )
        way = shape.point[skin.facets[facet, :3]].mean(axis=1) - shape.point[vertex]
        around = np.zeros((len(skin.node), len(skin.facets)), dtype=bool)
        for v in range(len(skin.node)):
            around[v, skin.star[skin.first_star[v] : skin.first_star[v + 1]]] = True
        opposed = -n @ n.T > FACING
        leaves = np.einsum("rd,gd->rg", way, n) > -1e-9
        good = around[vertex] & opposed[facet]
        facing = good.any(axis=1) | (-np.einsum("rd,rd->r", sign * shape.mean[vertex], n[facet]) > FACING)
        far = np.linalg.norm(way, axis=1) > 0.5
        before = -np.einsum("rd,rd->r", way, n[facet]) > -1e-9
        assert np.array_equal(found, facing & (far | (before & (good & leaves).any(axis=1))))
    pair = np.array([(a, b) for a in range(0, 30) for b in range(a + 1, 30)])
    place = np.full((len(pair), 2), 0.5)
    middle = shape.point[skin.edges].mean(axis=1)
    mean = shape.normal[skin.edge_facets].sum(axis=1)
    way = middle[pair[:, 1]] - middle[pair[:, 0]]
    out, back = np.einsum("nd,nd->n", way, mean[pair[:, 0]]), np.einsum("nd,nd->n", way, mean[pair[:, 1]])
    expected = ((out > 1e-9) & (back < -1e-9)) | (np.linalg.norm(way, axis=1) > 0.5)
    limits = (np.full(len(pair), 0.5), np.full(len(pair), 1e-9))
    assert np.array_equal(edges_across_void(pair, place, *limits, shape.point, shape.normal, skin.edges, skin.edge_facets), expected)


def test_interpolated_normals() -> None:
    """Angles by the law of cosines, means by sums over incidences."""
    everything = surface(np.random.default_rng(6), 60)
    skin, shape = everything.skin, shape_of(everything.skin, everything.model.reference)
    nf = len(skin.facets)
    rng = np.random.default_rng(1)
    weights = np.pad(rng.dirichlet(np.ones(3), nf), ((0, 0), (0, 1)))
    changed, found = interpolated_normals(
        np.arange(nf), weights, np.ones(nf, dtype=bool), shape.point, shape.normal, skin.facets, skin.sides, np.zeros(nf, dtype=np.int64),
        skin.star, skin.first_star,
    )  # fmt: skip
    x = shape.point[skin.facets[:, :3]]
    mean = np.zeros((len(skin.node), 3))
    for k in range(3):
        b, c, a = (np.linalg.norm(x[:, i] - x[:, j], axis=1) for i, j in ((k, k - 2), (k, k - 1), (k - 1, k - 2)))
        angle = np.arccos((b**2 + c**2 - a**2) / (2 * b * c))
        np.add.at(mean, skin.facets[:, k], angle[:, None] * shape.normal)
    mean /= np.linalg.norm(mean, axis=1)[:, None]
    expected = np.einsum("fk,fkd->fd", weights[:, :3], mean[skin.facets[:, :3]])
    assert changed.all()
    assert_allclose(found, expected / np.linalg.norm(expected, axis=1)[:, None], atol=1e-9)
