"""Elements that lock are named as a run begins, and others are not."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fcsim import Body, Support, build_model
from fcsim.assembly.locking import locking, locking_in_bending, locking_in_flow, locking_parts
from fcsim.mesh.blocks import brick, rectangle
from fcsim.mesh.material import ByRegion, FinitePlastic, Material, Plastic, mooney_rivlin, neo_hooke
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


@pytest.mark.parametrize(("length", "energy"), [(0.5, 0.858), (1.0, 0.607), (2.0, 0.280)])
@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_cells_too_long_to_bend(length: float, energy: float, unit: float) -> None:
    """The share that is said is that of the cantilevers of docs/elements.md: 8 x 4 x 4 cells, energy over Timoshenko's."""
    part = brick("beam", (length * unit, 0.1 * unit, 0.1 * unit), (8, 4, 4), Material(1e6, 0.2, 1.0))
    said = locking_in_bending(part)
    if energy > 0.8:
        assert not said
    else:
        percent = float(said.split("about ")[1].split(" %")[0])
        assert percent == pytest.approx(100 * (1 / energy - 1), rel=0.05)


def round_bar(material: Material) -> Part:
    """Of 4 x 4 x 8 cells, the square of each section bent into a disk."""
    part = brick("b", (2.0, 2.0, 20.0), (4, 4, 8), material, origin=(-1.0, -1.0, 0.0))
    x, y, z = part.points.T
    return replace(part, points=np.stack([x * np.sqrt(1 - y**2 / 2), y * np.sqrt(1 - x**2 / 2), z], axis=1))


def test_which_parts_are_said_to_bend_too_stiffly() -> None:
    stone = Material(1e6, 0.2, 1.0)
    assert not locking_in_bending(brick("cube", (1.0, 1.0, 1.0), (1, 1, 1), stone))
    assert not locking_in_bending(brick("brick", (0.2, 0.1, 0.1), (8, 4, 4), stone))
    assert not locking_in_bending(brick("beam", (2.0, 0.1, 0.1), (8, 1, 1), stone, elements="Q1-enhanced"))
    assert not locking_in_bending(brick("beam", (2.0, 0.1, 0.1), (80, 1, 1), stone))
    assert '"P2"' in locking_in_bending(brick("beam", (1.0, 0.1, 0.1), (8, 2, 2), stone, "tetrahedron"))
    assert "enhanced" not in locking_in_bending(brick("beam", (2.0, 0.1, 0.1), (8, 1, 1), neo_hooke(1e6, 0.3, 1.0)))  # linear ones alone
    assert locking_in_bending(brick("plate", (1.0, 1.0, 0.02), (8, 8, 1), stone))
    assert locking_in_bending(rectangle("strip", (2.0, 0.1), (8, 2), stone))


@pytest.mark.parametrize("kind", ["beam", "planks", "plate", "simplices", "strip", "round bar"])
def test_parts_meshed_at_an_angle_are_named_by_the_same_numbers(kind: str) -> None:
    """What stands obliquely is as high as it is long along the axes of space: nothing was said of it, or another number."""
    stone = Material(1e6, 0.2, 1.0)
    parts = {
        "beam": brick("b", (2.0, 0.1, 0.1), (8, 2, 2), stone),
        "planks": brick("b", (1.2, 1.1, 0.3), (2, 4, 1), stone),  # four times as long as high, but for round-off
        "plate": brick("b", (1.0, 1.0, 0.02), (8, 4, 1), stone),
        "simplices": brick("b", (1.0, 0.1, 0.1), (8, 2, 2), stone, "tetrahedron"),
        "strip": rectangle("b", (2.0, 0.1), (8, 2), stone),
        "round bar": round_bar(stone),
    }
    part = parts[kind]
    said, d = locking_in_bending(part), part.dimension
    assert said
    for angle in (17, 41, 90, 133):
        turn = Rotation.from_euler("zxz"[: 2 * d - 3], [angle, 2 * angle, 31][: 2 * d - 3], degrees=True).as_matrix().reshape(3, 3)[:d, :d]
        assert locking_in_bending(replace(part, points=part.points @ turn.T + 0.3)) == said


@pytest.mark.parametrize(("supports", "said"), [([("x", "y")], 0), ([("x",), ("y",)], 0), ([("x",)], 1), ([], 1)])
def test_what_is_held_wholly_does_not_bend(supports: list[tuple[str, ...]], said: int) -> None:
    strip = rectangle("strip", (2.0, 0.1), (8, 2), Material(1e6, 0.2, 1.0))
    held = [Support("strip", directions) for directions in supports]
    assert len(locking_parts(build_model([Body("strip", strip)], supports=[*held, Support("strip", ("x", "y"), "x-")]))) == said


@pytest.mark.parametrize("law", [Plastic, FinitePlastic])
def test_plastic_flow_keeps_the_volume(law: Any) -> None:
    steel = law(2e11, 0.3, 7800.0, 2.5e8)
    assert "lock once most of it flows" in locking_in_flow(brick("b", (1.0, 1.0, 1.0), (1, 1, 1), steel))
    assert not locking_in_flow(brick("b", (1.0, 1.0, 1.0), (1, 1, 1), steel, elements="Q1-bbar"))
    assert not locking_in_flow(rectangle("b", (1.0, 1.0), (1, 1), steel, plane="stress"))
    assert not locking_in_flow(brick("b", (1.0, 1.0, 1.0), (1, 1, 1), Material(2e11, 0.3, 7800.0)))
