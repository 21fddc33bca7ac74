"""How far curved surfaces stand out over their facets: circles, spheres, saddles, cylinders by their equations; flat faces not at all."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from fcsim.assembly.model import build_model
from fcsim.contact_detection.surfaces.facets import join
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_detection.surfaces.sharp_edges import smooth_patches
from fcsim.contact_detection.surfaces.surface import ContactSurface
from fcsim.mesh.blocks import brick, rectangle
from fcsim.mesh.curves.bulges import bulges, heights
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body

STEEL = Material(2e11, 0.3, 7800.0)


def arc(angles: np.ndarray, radius: float) -> tuple[np.ndarray, ...]:
    """Chords of a circle, anticlockwise: nodes, sides, points, outward normals, lengths, one patch."""
    points = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    nodes = np.column_stack([np.arange(len(angles) - 1), np.arange(1, len(angles))])
    t = points[1:] - points[:-1]
    size = np.linalg.norm(t, axis=1)
    return nodes, np.full(len(nodes), 2), points, np.column_stack([t[:, 1], -t[:, 0]]) / size[:, None], size, np.zeros(len(nodes), np.int64)


@pytest.mark.parametrize("radius", [1.0, 1e-3])
@pytest.mark.parametrize("hollow", [False, True])
def test_chords_of_a_circle_have_its_sagitta(radius: float, hollow: bool) -> None:
    """R (1 - cos x) in the middle of each chord, the first and last too; of chords of different lengths, each its own."""
    angles = np.linspace(0.0, 1.0, 9) + 0.02 * np.sin(17 * np.arange(9))
    nodes, sides, points, normal, size, patch = arc(angles, radius)
    found = bulges(nodes, sides, points, -normal if hollow else normal, size, patch)
    assert found is not None
    middle = heights(found, np.arange(8), np.full((8, 2), 0.5))
    sagitta = radius * (1 - np.cos(np.diff(angles) / 2)) * (-1 if hollow else 1)
    assert middle == pytest.approx(sagitta, rel=0.02)
    even = arc(np.linspace(0.0, 1.0, 9), radius)
    found = bulges(*even[:3], -even[3] if hollow else even[3], *even[4:])
    assert found is not None
    assert heights(found, np.arange(8), np.full((8, 2), 0.5)) == pytest.approx(np.sign(sagitta) * radius * (1 - np.cos(1 / 16)), rel=1e-12)


@pytest.mark.parametrize("angle", [2.0, 10.0, 22.0])
def test_flat_faces_with_blunt_edges_have_none(angle: float) -> None:
    """A ramp after a floor, a face between two chamfers, each of one facet or of several, of the same lengths: taken for chords of a circle
    a block lay 4 cm over a face of a metre."""
    along = np.deg2rad(angle)
    for facets in ((1, 1, 0), (1, 2, 0), (3, 2, 0), (1, 1, 1), (2, 1, 2), (1, 3, 2)):
        turned = np.repeat([along, 0.0, -along], facets)
        points = np.vstack([np.zeros(2), np.cumsum(np.column_stack([np.cos(turned), np.sin(turned)]), axis=0)])
        nodes = np.column_stack([np.arange(len(turned)), np.arange(1, len(turned) + 1)])
        normal = np.column_stack([-np.sin(turned), np.cos(turned)])
        one = np.ones(len(turned))
        assert bulges(nodes, 2 * one.astype(int), points, normal, one, np.zeros(len(turned), np.int64)) is None


def test_straight_ends_and_waves_have_none() -> None:
    """A straight part of as long facets beside an arc, one facet five times as long, and a zigzag: the facets are the surface."""
    angles = np.linspace(0.0, 0.5, 6)
    turned = np.concatenate([np.zeros(4), angles[1:]])
    for lengths in (np.full(9, 0.1), np.r_[np.full(3, 0.1), 0.5, np.full(5, 0.1)]):
        steps = lengths[:, None] * np.column_stack([-np.sin(turned), np.cos(turned)])
        points = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
        normal = np.column_stack([np.cos(turned), np.sin(turned)])
        nodes = np.column_stack([np.arange(9), np.arange(1, 10)])
        found = bulges(nodes, np.full(9, 2), points, normal, lengths, np.zeros(9, np.int64))
        assert found is not None
        assert not found[:4].any() and (found[5:, 0, 1] > 0).all()
    x = np.arange(8.0)
    points = np.column_stack([-x, 0.05 * (-1) ** x])
    t = np.diff(points, axis=0)
    size = np.linalg.norm(t, axis=1)
    nodes = np.column_stack([np.arange(7), np.arange(1, 8)])
    found = bulges(nodes, np.full(7, 2), points, np.column_stack([t[:, 1], -t[:, 0]]) / size[:, None], size, np.zeros(7, np.int64))
    assert found is None or not found[1:-1].any()


HEIGHTS = {
    "sphere": lambda x, y: np.sqrt(4.0 - x**2 - y**2) - 2.0,
    "saddle": lambda x, y: 0.2 * x * y,
    "cylinder": lambda x, y: np.sqrt(4.0 - x**2) - 2.0,
}


@pytest.mark.parametrize("shape", list(HEIGHTS))
@pytest.mark.parametrize("corners", [3, 4])
def test_facets_in_space_have_the_heights_of_their_surface(shape: str, corners: int) -> None:
    """Seven by seven cells of a graph, its rim apart: in the middle of each facet as far over it as the surface is, along its normal."""
    n, z = 7, HEIGHTS[shape]
    x, y = np.meshgrid(*[np.linspace(-0.4, 0.4, n + 1)] * 2, indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), z(x, y).ravel()])
    at = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    quads = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 4)
    nodes = quads if corners == 4 else np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    p = points[nodes]
    area = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]) if corners == 4 else np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    size = np.sqrt(np.linalg.norm(area, axis=1))
    normal = area / size[:, None] ** 2
    found = bulges(nodes, np.full(len(nodes), corners), points, normal, size, np.zeros(len(nodes), np.int64))
    assert found is not None
    weights = np.full((len(nodes), corners), 1 / corners)
    b, centre = heights(found, np.arange(len(nodes)), weights), p.mean(axis=1)
    exact = (z(centre[:, 0], centre[:, 1]) - centre[:, 2]) * normal[:, 2]
    inside = np.abs(centre[:, :2]).max(axis=1) < (0.2 if shape == "saddle" else 0.3)  # diagonals near its corners are few sides long
    assert b[inside] == pytest.approx(exact[inside], abs=0.06 * np.abs(exact).max() + 1e-6)
    at_rim = np.abs(centre[:, :2]).min(axis=1) < 0.3  # but for the corners of the graph
    if shape != "saddle" and corners == 4:
        assert b[at_rim] == pytest.approx(exact[at_rim], abs=0.3 * np.abs(exact).max())


def test_triangles_beside_a_block_have_the_heights_that_they_have_alone() -> None:
    """The side of a cylinder in triangles of uneven shapes, whose nodes stand in rows of four as those of a model with quadrilaterals do:
    the same heights whatever is number 0, a corner of the block or one of its own, and those of what it is over its chords."""
    random = np.random.default_rng(3)
    around, high = 24, 8
    a, z = np.meshgrid(np.arange(around) + 0.0, np.arange(high + 1) + 0.0, indexing="ij")
    a += random.uniform(-0.25, 0.25, a.shape)
    z[:, 1:-1] += random.uniform(-0.25, 0.25, (around, high - 1))
    angle = 2 * np.pi * a.ravel() / around
    points = np.column_stack([np.cos(angle), np.sin(angle), 2 * np.pi / around * z.ravel()])
    at = np.vstack([np.arange(len(points)).reshape(around, high + 1), np.arange(high + 1)])
    quads = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 4)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])

    def middles(order: np.ndarray, block: bool) -> np.ndarray:
        nodes = (8 if block else 0) + triangles[order][:, [0, 1, 2, 0]]
        p = points[triangles[order]]
        normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        sides, place, patch = np.full(len(nodes), 3), points, np.zeros(len(nodes), np.int64)
        if block:
            nodes = np.vstack([np.arange(8).reshape(2, 4), nodes])
            square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
            place = np.vstack([np.column_stack([square, [-1.0] * 4]), np.column_stack([square, [-2.0] * 4]), points])
            normal = np.vstack([[0.0, 0.0, 4.0], [0.0, 0.0, 4.0], normal])
            sides, patch = np.append([4, 4], sides), np.append([1, 2], patch)
        size = np.sqrt(np.linalg.norm(normal, axis=1))
        found = bulges(nodes, sides, place, normal / size[:, None] ** 2, size, patch)
        assert found is not None
        return heights(found[-len(triangles) :], np.arange(len(triangles)), np.full((len(triangles), 3), 1 / 3))

    as_made, backwards = np.arange(len(triangles)), np.arange(len(triangles))[::-1]
    alone = middles(as_made, False)
    assert middles(as_made, True) == pytest.approx(alone, abs=1e-12)
    assert middles(backwards, False)[::-1] == pytest.approx(alone, abs=1e-12)
    depth = 1.0 - np.linalg.norm(points[triangles].mean(axis=1)[:, :2], axis=1)
    assert alone == pytest.approx(depth, abs=0.02 * depth.max())


def test_flat_faces_and_corners_of_a_block_have_none() -> None:
    model = build_model([Body("block", brick("block", (1.0, 1.0, 1.0), (3, 2, 2), STEEL))])
    assert contact_surface(model, [("block", side) for side in ("z+", "x+", "y-")]).bulge is None
    flat = build_model([Body("block", rectangle("block", (1.0, 1.0), (3, 2), STEEL))])
    assert contact_surface(flat, [("block", "x+"), ("block", "y+")]).bulge is None


def polygon(corners: list[tuple[float, float]] | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """An outline in the plane, anticlockwise: its points and facets."""
    n = len(corners)
    return np.asarray(corners, dtype=float), np.column_stack([np.arange(n), np.roll(np.arange(n), -1)])


def prism(corners: list[tuple[float, float]] | np.ndarray, layers: int, triangles: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """The sides of a prism over an outline, one cell high in each layer of the length of the first side."""
    flat, sides = polygon(corners)
    n, high = len(flat), np.linalg.norm(flat[1] - flat[0])
    points = np.concatenate([np.column_stack([flat, np.full(n, k * high)]) for k in range(layers + 1)])
    quads = np.concatenate([np.column_stack([sides + k * n, sides[:, ::-1] + (k + 1) * n]) for k in range(layers)])
    split = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return points, split if triangles else quads


def of_surface(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """How far the middle of each facet of a surface is over it."""
    joined = join([ContactSurface(facets, np.zeros(len(facets), np.int64))])
    patch, shape = smooth_patches(joined, points, np.deg2rad(23.0))
    found = bulges(joined.closed, (joined.nodes >= 0).sum(axis=1), points, shape.normal, shape.size, patch)
    k = facets.shape[1]
    return np.zeros(len(facets)) if found is None else heights(found, np.arange(len(facets)), np.full((len(facets), k), 1.0 / k))


def turned(steps: list[tuple[float, float]]) -> np.ndarray:
    """Corners of an outline by its sides, (length, degrees to the side before)."""
    length, angle = np.transpose(steps)
    along = np.deg2rad(np.cumsum(angle))
    return np.cumsum(length[:, None] * np.column_stack([np.cos(along), np.sin(along)]), axis=0)


def regular(sides: int) -> np.ndarray:
    angle = 2 * np.pi * np.arange(sides) / sides
    return np.column_stack([np.cos(angle), np.sin(angle)])


CHAMFERED = [(1.0, 0), (1.0, 20), (1.0, 70), (3.0, 70), (1.0, 20), (1.0, 90), (3.0, 90)]
FLAT = {
    "hexagon": regular(6),
    "octagon": regular(8),
    "12-gon": regular(12),
    "one chamfer": turned(CHAMFERED),
    "a chamfer on either side": turned([(1.0, 0), (1.0, 20), (1.0, 20), (3.0, 70), (1.0, 90), (3.0, 90)]),
    "other chamfers on either side": turned([(1.0, 0), (1.0, 8), (1.0, 20), (3.0, 70), (1.0, 90), (3.0, 90)]),
    "two chamfers on either side": turned([(1.0, 0), (1.0, 10), (1.0, 22), (1.0, 22), (1.0, 10), (3.0, 70), (1.0, 90), (3.0, 90)]),
    "the same angles beside a face of two": turned([(1.0, a) for a in (0, 10, 10, 0, 10, 10)] + [(3.0, 70), (1.0, 90), (3.0, 90)]),
    "two chamfers beside a longer face": turned([(1.0, 0), (1.0, 20), (2.2, 20), (1.0, 20), (1.0, 20), (3.0, 70), (1.0, 90), (3.0, 90)]),
    "dovetail": turned([(1.0, 0), (1.0, -15), (1.0, 15), (1.0, 15), (1.0, -15), (3.0, 90), (5.0, 90), (3.0, 90)]),
    "groove": turned([(1.0, 0), (1.0, -20), (1.0, 20), (1.0, 20), (1.0, -20), (3.0, 90), (5.0, 90), (3.0, 90)]),
    "teeth": turned([(1.0, 0), (1.0, 21), (0.8, -21), (1.0, -21), (1.2, 21)] * 4 + [(9.0, 90), (20.0, 90), (9.0, 90)]),
}


@pytest.mark.parametrize("unit", [1.0, 1e-3])
@pytest.mark.parametrize("name", list(FLAT))
def test_polygons_and_their_prisms_have_none(name: str, unit: float) -> None:
    """Sides that are alike in length and meet at less than 23 degrees by two or three, or at different angles, are no circle's chords."""
    corners = unit * FLAT[name]
    assert not of_surface(*polygon(corners)).any()
    for layers in (1, 2, 4):
        for triangles in (False, True):
            assert not of_surface(*prism(corners, layers, triangles)).any()


@pytest.mark.parametrize("unit", [1.0, 1e-3])
@pytest.mark.parametrize("chords", [4, 6, 9])
def test_one_straight_side_between_two_arcs_has_none(chords: int, unit: float) -> None:
    """A stadium whose straight parts are one facet each, 0.7 to 2 times as long as the chords: these have their sagitta, half of it at most
    beside the straight part, whose vertices the arc's normal is not known at."""
    angle = np.linspace(0.0, np.pi, 2 * chords + 1)
    arc = np.column_stack([np.sin(angle), -np.cos(angle)])
    sagitta = 1 - np.cos(np.pi / 4 / chords)
    chord = np.linalg.norm(arc[1] - arc[0])
    for straight in (0.7, 1.0, 1.5, 2.0):
        corners = unit * np.concatenate([arc + np.array([straight * chord, 0.0]), -arc])
        expected = np.tile(np.r_[0, np.full(2 * chords - 2, sagitta), 0, 0], 2)
        middle = np.tile(np.r_[0, np.ones(2 * chords - 2), 0, 1], 2) > 0  # but for the last chords
        for points, facets in (polygon(corners), prism(corners, 1), prism(corners, 3)):
            found = of_surface(points, facets)[: len(corners)] / unit
            assert found[middle] == pytest.approx(expected[middle], rel=1e-9, abs=1e-12)
            assert (found >= 0).all() and (found <= sagitta * (1 + 1e-9)).all()


def test_solids_of_flat_faces_have_none() -> None:
    """A face of one facet with chamfers of one facet on all four sides, a lead-in around the end of a shaft whose sides are chords, a
    dodecahedron's faces as fans of triangles."""

    for angle in (10.0, 15.0, 22.0):
        for inner in (1, 2):  # facets of the face between the chamfers, a side
            line = np.concatenate([[0.0], np.linspace(1.0, 1.0 + inner, inner + 1), [2.0 + inner]])
            n = len(line)
            a, b = np.meshgrid(line, line, indexing="ij")
            outside = np.maximum.reduce([1.0 - a, a - 1.0 - inner, 1.0 - b, b - 1.0 - inner, np.zeros_like(a)])
            points = np.column_stack([a.ravel(), b.ravel(), -np.tan(np.deg2rad(angle)) * outside.ravel()])
            at = np.arange(n * n).reshape(n, n)
            quads = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 4)
            assert not of_surface(points, quads).any()
    ring = np.column_stack([regular(20), np.zeros(20)])
    points, facets = prism(regular(20), 4)
    high = points[20, 2]
    points[80:] = ring * (1 - high * np.tan(np.deg2rad(15.0))) + [0.0, 0.0, 4 * high]
    lead_in, sagitta = of_surface(points, facets)[60:], 1 - np.cos(np.pi / 20)
    assert (lead_in >= 0).all() and lead_in.max() < 1.2 * sagitta
    golden = (1 + 5**0.5) / 2
    corners = np.array([(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)], dtype=float)
    corners = np.concatenate(
        [corners, *(np.roll([(0, a / golden, b * golden) for a in (-1, 1) for b in (-1, 1)], k, axis=1) for k in range(3))]
    )
    hull = ConvexHull(corners)
    facing = np.einsum("fd,fd->f", hull.equations[:, :3], np.cross(*np.moveaxis(np.diff(corners[hull.simplices], axis=1), 1, 0))) > 0
    assert not of_surface(corners, np.where(facing[:, None], hull.simplices, hull.simplices[:, ::-1])).any()
