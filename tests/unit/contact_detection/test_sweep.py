"""Contacts that are met on the way of a step: by the face through which a body comes, and no deeper than bodies overlap."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import Model, build_model
from fcsim.contact_detection import Detector, Everything, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_detection.sweep import bounded, brought_back
from fcsim.mesh import Body, Material, Part, brick, rectangle, rigid_box, rigid_polyhedron


def tip_over_a_box(start: tuple[float, float, float]) -> Model:
    """A tetrahedron that stands on its tip at `start` above a cube of 1 m whose top is at z = 0 and whose rim is at x = 0."""
    tip = np.array(start)
    tetrahedron = rigid_polyhedron("tip", tip + np.array([(0, 0, 0), (0.3, 0, 0.8), (-0.2, 0.3, 0.8), (-0.2, -0.3, 0.8)]), 1000.0)
    return build_model([rigid_box("box", (1, 1, 1), (-0.5, 0, -0.5), 1.0), tetrahedron])


def test_a_tip_that_comes_through_the_top_near_the_rim_is_held_by_the_top() -> None:
    """At the end of its way it is 10 cm below the top and 1 cm inside the side, its least way out: by that alone it would come in."""
    model = tip_over_a_box((-0.01, 0.0, 0.1))
    way = np.zeros((model.n_nodes, 3))
    way[model.node_offset[1] :, 2] = -0.2
    found = Everything(model, 0.5)(model.reference, way)
    own = np.flatnonzero(found.nodes[:, 0] == model.node_offset[1] + int(np.argmin(model.bodies[1].points[:, 2])))
    assert len(own) == 1
    assert_allclose(found.frame[own[0], 0], [0, 0, 1], atol=1e-12)
    assert_allclose(found.gap[own[0]], 0.1, atol=1e-12)


def test_what_is_brought_back_is_no_deeper_than_what_overlaps() -> None:
    """A contact found elsewhere whose gap at the beginning is negative although nothing overlaps there: it begins closed, not open."""
    model = tip_over_a_box((-0.5, 0.0, 1e-3))
    detection = Everything(model, 0.5)
    here = detection(model.reference)
    lower = model.reference.copy()
    lower[model.node_offset[1] :, 2] -= 5e-3
    deeper = detection(lower)
    assert deeper.gap.min() < -3e-3
    assert_allclose(bounded(deeper, here).gap, 0.0)  # nothing overlaps here
    assert_allclose(bounded(deeper, deeper).gap, deeper.gap)  # what does, stays
    assert_allclose(brought_back(deeper, model.reference).gap.min(), 1e-3, atol=1e-12)


@pytest.mark.parametrize("far", [0.02, 0.03])
def test_a_thin_bar_on_its_way_through_another_meets_the_side_that_it_comes_from(far: float) -> None:
    """Beyond the middle of 5 mm the other side is nearer: it was held shut at once, against its own side 12 mm away, and no reactions keep
    both apart."""
    w, apart = 5e-3, 12.1e-3
    model = build_model([rigid_box("a", (2.0, w, w), (0.0, 0.0, 0.0), 1.0), rigid_box("b", (w, 2.0, w), (0.13, 0.17, -w - apart), 1.0)])
    way = np.zeros((model.n_nodes, 3))
    way[model.node_offset[1] :, 2] = far
    found = Everything(model, 0.3)(model.reference, way)
    assert len(found) == 4
    assert_allclose(found.gap, apart, atol=1e-12)
    assert_allclose(found.frame[:, 0], np.tile([0.0, 0.0, 1.0], (4, 1)), atol=1e-12)


@pytest.mark.parametrize("rule", ["mortar", "mortar-faces", "segments"])
@pytest.mark.parametrize(("begin", "way"), [((0.0, 0.0, 0.0), (0.45, 0.3, 0.0)), ((0.0, 0.0, 0.3), (0.0, 0.0, -0.35))])
def test_what_a_face_meets_on_its_way_has_its_area_once(rule: Any, begin: tuple[float, ...], way: tuple[float, ...]) -> None:
    """A face of 1 m^2 slides on one of 4 m^2, or comes down on it: other facets bear the same part of it (by segments it was 1.54 m^2)."""
    stone = Material(E=1e9, nu=0.2, density=2000.0)
    floor = Body("floor", brick("floor", (2.0, 2.0, 0.5), (5, 5, 1), stone), translation=(-0.3, -0.3, -0.5))
    block = Body("block", brick("block", (1.0, 1.0, 0.5), (3, 3, 1), stone, "tetrahedron"), translation=begin)
    model = build_model([floor, block])
    surfaces = contact_surface(model, [("block", "z-")]), contact_surface(model, [("floor", "z+")])
    moved = np.zeros((model.n_nodes, 3))
    moved[model.node_offset[1] :] = way
    found = Detector([SurfacePair(*surfaces, 0.3, 0.02, rule)], model.n_nodes)(model.reference, moved)
    assert found.area is not None
    assert_allclose(found.area.sum(), 1.0, rtol=1e-6)


@pytest.mark.parametrize("rule", ["mortar", "mortar-faces", "segments"])
@pytest.mark.parametrize("elements", ["P1", "P2"])
def test_a_face_that_slides_on_to_another_body_has_its_area_once(rule: Any, elements: str) -> None:
    """From one of two floors side by side on to the other (by segments it was 1.6 m^2 by cells of first order, 1.95 by those of second)."""
    stone = Material(E=1e9, nu=0.2, density=2000.0)
    floors = [
        Body(f"floor{k}", brick("f", size, cells, stone, "tetrahedron", elements=elements), translation=at)
        for k, size, cells, at in ((0, (1.0, 2.0, 0.5), (3, 4, 1), (-0.3, -0.3, -0.5)), (1, (2.0, 2.0, 0.5), (4, 4, 1), (0.7, -0.3, -0.5)))
    ]
    block = brick("block", (1.0, 1.0, 0.5), (2, 2, 1), stone, "tetrahedron", elements=elements)
    model = build_model([*floors, Body("block", block, translation=(-0.25, 0.0, 0.0))])
    surfaces = contact_surface(model, [("block", "z-")]), contact_surface(model, [("floor0", "z+"), ("floor1", "z+")])
    moved = np.zeros((model.n_nodes, 3))
    moved[model.node_offset[2] :] = (1.0, 0.13, 0.0)
    found = Detector([SurfacePair(*surfaces, 0.3, 0.02, rule)], model.n_nodes)(model.reference, moved)
    assert found.area is not None
    assert_allclose(found.area.sum(), 1.0, rtol=1e-4)


@pytest.mark.parametrize("rule", ["mortar", "mortar-faces", "segments"])
def test_what_leaves_one_face_of_a_body_and_meets_another_of_it_has_its_own_area(rule: Any) -> None:
    """A slab between the jaws of one body, 0.1 m of play: as it left the lower one the upper one had a millionth of its area."""
    stone = Material(E=1e9, nu=0.2, density=2000.0)
    whole = rectangle("jaws", (2.0, 3.0), (5, 3), stone)
    jaws = Part(
        "jaws", whole.points, whole.cells[np.abs(whole.points[whole.cells].mean(axis=1)[:, 1] - 1.5) > 0.6], "quadrilateral", {}, stone
    )
    along = np.argsort(jaws.points[:, 0])
    low, high = (along[np.isclose(jaws.points[along, 1], y)] for y in (1.0, 2.0))
    faces = {"low": np.stack([low[1:], low[:-1]], axis=1), "high": np.stack([high[:-1], high[1:]], axis=1)}
    jaws = Part("jaws", jaws.points, jaws.cells, "quadrilateral", faces, stone)
    slab = rectangle("slab", (1.0, 0.9), (3, 2), stone)
    model = build_model([Body("jaws", jaws), Body("slab", slab, translation=(0.5, 1.0))])
    pairs = [
        SurfacePair(contact_surface(model, [("slab", one)]), contact_surface(model, [("jaws", other)]), 0.3, 0.01, rule)
        for one, other in (("y-", "low"), ("y+", "high"))
    ]
    moved = np.zeros((model.n_nodes, 2))
    moved[model.node_offset[1] :, 1] = 0.11
    found = Detector(pairs, model.n_nodes)(model.reference, moved)
    assert found.area is not None
    upper = found.frame[:, 0, 1] < 0
    assert_allclose([found.area[upper].sum(), found.area[~upper].sum()], 1.0, rtol=1e-6)
