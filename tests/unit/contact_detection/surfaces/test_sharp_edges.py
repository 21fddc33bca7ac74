"""Splitting surfaces at sharp edges."""

import numpy as np
import pytest

from fcsim.assembly.model import build_model
from fcsim.contact_detection import ContactSurface, split_at_sharp_edges
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.errors import InputError
from fcsim.mesh.blocks import brick, rigid_box, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body


def facets_of(surfaces: list[ContactSurface]) -> set[tuple[int, ...]]:
    return {tuple(facet) for surface in surfaces for facet in surface.facets.tolist()}


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_boxes_have_three_pairs_of_sides(cell: str) -> None:
    """Two boxes: every facet once, each part the two opposite faces of both."""
    part = brick("box", (1, 2, 3), (2, 2, 3), Material(1.0, 0.0, 1.0), cell)
    model = build_model([Body("a", part), Body("b", part, translation=np.array([5.0, 0, 0]))])
    skin = contact_surface(model, [(name, side) for name in "ab" for side in part.surfaces])
    parts = split_at_sharp_edges(skin, model.reference)
    assert len(parts) == 3
    assert facets_of(parts) == facets_of([skin]) and sum(len(p.facets) for p in parts) == len(skin.facets)
    for p in parts:
        assert set(p.bodies) == {0, 1}
        corners = model.reference[p.facets]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        axis = np.abs(normal / np.linalg.norm(normal, axis=1)[:, None])
        np.testing.assert_allclose(axis, np.broadcast_to(axis[0], axis.shape), atol=1e-12)


def test_rectangles_have_two() -> None:
    model = build_model([rigid_rectangle("a", (1, 1), (0.5, 0.5), 1.0, (3, 2))])
    skin = contact_surface(model, [("a", side) for side in ("x-", "x+", "y-", "y+")])
    assert [len(p.facets) for p in split_at_sharp_edges(skin, model.reference)] == [4, 6]


def test_smooth_surfaces_stay_whole() -> None:
    """A circle of 12 segments turns by 30 degrees at each node: smooth at 45, and at 20 in pieces."""
    angle = 2 * np.pi * np.arange(12) / 12
    circle = ContactSurface(np.column_stack([np.arange(12), np.roll(np.arange(12), -1)]), np.zeros(12, int))
    points = np.column_stack([np.cos(angle), np.sin(angle)])
    assert [len(p.facets) for p in split_at_sharp_edges(circle, points)] == [12]
    assert [len(p.facets) for p in split_at_sharp_edges(circle, points, np.deg2rad(20))] == [6, 6]


def test_triangles_among_quadrilaterals() -> None:
    """A square folded along its diagonal into two triangles beside a flat quadrilateral."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0.9], [0, 1, 0], [-1, 0, 0], [-1, 1, 0]])
    surface = ContactSurface(np.array([[0, 3, 5, 4], [0, 1, 3, -1], [1, 2, 3, -1]]), np.zeros(3, int))
    parts = split_at_sharp_edges(surface, points, np.deg2rad(30))
    assert facets_of(parts) == facets_of([surface])
    assert sorted(len(p.facets) for p in parts) == [1, 2]


def test_errors_and_nothing() -> None:
    model = build_model([rigid_box("a", (1, 1, 1), (0, 0, 0), 1.0)])
    skin = contact_surface(model, [("a", "x-")])
    with pytest.raises(InputError, match="angle: expected a number between 0 and pi, got 4"):
        split_at_sharp_edges(skin, model.reference, 4.0)
    with pytest.raises(InputError, match="below the 2 positions"):
        split_at_sharp_edges(skin, model.reference[:2])
    empty = ContactSurface(np.empty((0, 4), int), np.empty(0, int))
    assert split_at_sharp_edges(empty, model.reference) == [empty]
