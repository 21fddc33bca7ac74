"""Elements that lock are named as a run begins, and others are not."""

from typing import Any

import pytest

from fcsim.assembly.locking import locking
from fcsim.mesh.blocks import brick, rectangle
from fcsim.mesh.material import ByRegion, Material, mooney_rivlin
from fcsim.mesh.material.thermal import Thermal
from fcsim.mesh.part import Part


@pytest.mark.parametrize(
    ("elements", "nu", "said"),
    [("Q1", 0.3, False), ("Q1", 0.45, False), ("Q1", 0.495, True), ("Q1-bbar", 0.4999, False), ("Q1-enhanced", 0.4999, False)],
)
def test_hexahedra(elements: str, nu: float, said: bool) -> None:
    part = brick("b", (1.0, 0.1, 0.1), (2, 1, 1), Material(1e6, nu, 1.0), elements=elements)
    assert (f"Poisson's ratio {nu:.4f}" in locking(part)) == said


@pytest.mark.parametrize(("length", "nu", "said"), [(1.0, 0.4999, False), (10.0, 0.4999, True), (10.0, 0.45, False)])
def test_long_tetrahedra_of_second_order(length: float, nu: float, said: bool) -> None:
    part = brick("b", (length, 1.0, 1.0), (1, 1, 1), Material(1e6, nu, 1.0), "tetrahedron", elements="P2")
    assert bool(locking(part)) == said


@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e9])
def test_rubber_in_any_unit(scale: float) -> None:
    rubber = mooney_rivlin(0.293 * scale, 0.177 * scale, 1410.0 * scale, scale)
    assert "lock" in locking(rectangle("r", (1.0, 1.0), (1, 1), rubber))
    assert "lock" in locking(rectangle("r", (1.0, 1.0), (1, 1), Thermal(rubber, 1e-5, 10.0)))
    assert not locking(rectangle("r", (1.0, 1.0), (1, 1), rubber, plane="stress"))


def test_one_of_several_materials() -> None:
    part = rectangle("r", (1.0, 1.0), (2, 1), Material(1.0, 0.0, 1.0))
    materials: Any = ByRegion({"a": Material(1.0, 0.2, 1.0), "b": Material(1.0, 0.499, 1.0)})
    two = Part("two", part.points, part.cells, part.cell_type, part.surfaces, materials, regions={"a": [0], "b": [1]})
    assert "0.4990" in locking(two)
