"""How far curved surfaces stand out over their facets: circles, spheres, saddles, cylinders by their equations; flat faces not at all."""

import numpy as np
import pytest

from fcsim.assembly.model import build_model
from fcsim.contact_detection.surfaces.bulges import bulges, heights
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh.blocks import brick, rectangle
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
    for facets in ((1, 1, 0), (1, 2, 0), (3, 2, 0), (1, 1, 1), (2, 1, 2)):
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
    inside = np.abs(centre[:, :2]).max(axis=1) < 0.3
    assert b[inside] == pytest.approx(exact[inside], abs=0.06 * np.abs(exact).max() + 1e-6)
    at_rim = np.abs(centre[:, :2]).min(axis=1) < 0.3  # but for the corners of the graph
    if shape != "saddle" and corners == 4:
        assert b[at_rim] == pytest.approx(exact[at_rim], abs=0.3 * np.abs(exact).max())


def test_flat_faces_and_corners_of_a_block_have_none() -> None:
    model = build_model([Body("block", brick("block", (1.0, 1.0, 1.0), (3, 2, 2), STEEL))])
    assert contact_surface(model, [("block", side) for side in ("z+", "x+", "y-")]).bulge is None
    flat = build_model([Body("block", rectangle("block", (1.0, 1.0), (3, 2), STEEL))])
    assert contact_surface(flat, [("block", "x+"), ("block", "y+")]).bulge is None
