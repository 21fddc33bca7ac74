"""Nodal areas: what a uniform pressure gives to each node of a surface."""

import numpy as np
import pytest

from fcsim.assembly.loads import nodal_area
from fcsim.assembly.model import build_model
from fcsim.errors import InputError
from fcsim.mesh.blocks import brick, rectangle, rigid_box
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body

MATERIAL = Material(1e9, 0.3, 1000.0)


def test_nodal_areas_of_a_turned_brick():
    """The top of 0.3 x 0.4 m in 3 x 2 rectangles: a node owns a quarter of each of its 1, 2 or 4 rectangles, wherever the body stands."""
    part = brick("b", (0.3, 0.4, 0.1), (3, 2, 1), MATERIAL)
    quarter_turn = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    other = rigid_box("plane", (1, 1, 1), (0, 0, -1), 1.0)
    model = build_model([Body("first", part), Body("second", part, quarter_turn, np.array([5.0, 0, 0])), other])
    area = nodal_area(model, "second", "z+")
    assert area.sum() == pytest.approx(0.12)
    assert np.unique(np.round(area, 12)).tolist() == [0, 0.005, 0.01, 0.02]
    own = np.unique(part.surfaces["z+"]) + model.node_offset[1]
    assert np.flatnonzero(area).tolist() == own.tolist()


def test_nodal_areas_in_2d_carry_the_thickness():
    part = rectangle("r", (0.3, 0.1), (3, 1), MATERIAL, thickness=0.5)
    area = nodal_area(build_model([Body("r", part)]), "r", "y+")
    assert sorted(area[area > 0]) == pytest.approx([0.025, 0.025, 0.05, 0.05])


def test_refused():
    part = brick("b", (1, 1, 1), (1, 1, 1), MATERIAL)
    model = build_model([Body("b", part), rigid_box("plane", (1, 1, 1), (0, 0, -1), 1.0)])
    with pytest.raises(InputError, match="expected a deformable body, got the rigid body 'plane'"):
        nodal_area(model, "plane", "z+")
    with pytest.raises(InputError, match="expected one of the surfaces"):
        nodal_area(model, "b", "top")
