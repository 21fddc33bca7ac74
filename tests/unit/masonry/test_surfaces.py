"""Masonry problems from surface files: what stands and falls is that of the same blocks given otherwise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from fcsim.errors import InputError
from fcsim.masonry import Acceleration, MasonryProblem, analyse, bracket, masonry_of_surfaces, pushed, read_model
from fcsim.masonry.atlas.shapes import cuboid
from fcsim.masonry.remarks import remarks

trimesh = pytest.importorskip("trimesh")
pytestmark = pytest.mark.usefixtures("read_here")


@pytest.fixture
def column(tmp_path: Path) -> Path:
    """Two drums of 0.4 x 0.4 x 0.5 m on each other, in millimetres."""
    boxes = [trimesh.creation.box((400.0, 400.0, 500.0)).apply_translation((0.0, 0.0, 500.0 * k + 250.0)) for k in (0, 1)]
    trimesh.util.concatenate(boxes).export(tmp_path / "column.stl")
    return tmp_path / "column.stl"


def test_a_column_topples_at_its_proportion(column: Path) -> None:
    problem = masonry_of_surfaces(column, mu=0.7, scale=1e-3)
    assert [block.support for block in problem.blocks] == [False, False, True]
    assert analyse(pushed(problem, (1.0, 0.0, 0.0))).coulomb.multiplier == pytest.approx(0.4, rel=1e-4)


def test_a_drum_that_is_held(column: Path) -> None:
    free = masonry_of_surfaces(column, scale=1e-3).blocks[:2]
    low = min(free, key=lambda block: block.surface.points[:, 2].min()).name
    held = masonry_of_surfaces(column, mu=0.9, scale=1e-3, supports=[low])
    assert analyse(pushed(held, (0.0, 1.0, 0.0))).coulomb.multiplier == pytest.approx(0.8, rel=1e-4)
    with pytest.raises(InputError, match="supports: expected names or patterns"):
        masonry_of_surfaces(column, scale=1e-3, supports=["pier*"])


@pytest.mark.slow
def test_a_column_falls_in_simulation_in_metres_as_in_millimetres_and_tonnes(column: Path) -> None:
    """The file's millimetres scaled, and the same column in mm, t, s and N: multipliers have no unit, so that the brackets are one."""
    metres = pushed(masonry_of_surfaces(column, mu=0.7, scale=1e-3), (1.0, 0.0, 0.0))
    large = masonry_of_surfaces(column, mu=0.7, density=2e-9, scale=1.0)
    weight = (Acceleration((0.0, 0.0, -9810.0)), Acceleration((9810.0, 0.0, 0.0), scaled=True))
    found = [bracket(problem, 0.39, 0.41, resolution=0.01) for problem in (metres, replace(large, loads=weight))]
    for seen in found:
        assert seen.fall == pytest.approx((0.4, 0.4), rel=0.011) and seen.fall[0] <= 0.4 * (1 + 1e-6)
    assert found[1].fall == pytest.approx(found[0].fall, rel=1e-9)


def test_a_file_of_no_known_kind_is_told_all_that_are(tmp_path: Path) -> None:
    """It was told the formats of surfaces alone, not that a JSON or a mesh would do."""
    with pytest.raises(InputError, match=r"expected a model of blocks \(\.json, \.stl, .*\.msh, .*got '\.txt'"):
        read_model(tmp_path / "wall.txt")


def test_corners_of_an_obj_that_are_counted_from_the_last(tmp_path: Path) -> None:
    """Faces of the first object took corners of the last one: a column was read as drums within each other."""
    lines: list[str] = []
    for k in (0, 1):
        drum = trimesh.creation.box((0.4, 0.4, 0.5)).apply_translation((0.0, 0.0, 0.5 * k + 0.25))
        lines += [f"o drum {k}", *("v {} {} {}".format(*corner) for corner in drum.vertices)]
        lines += ["f " + " ".join(f"{corner - 8}//" for corner in face) for face in drum.faces]
    (tmp_path / "column.obj").write_text("\n".join(lines))
    problem = masonry_of_surfaces(tmp_path / "column.obj", mu=0.7)
    assert [block.surface.points[:, 2].min() for block in problem.blocks] == pytest.approx([0.0, 0.5, -0.1])
    assert analyse(pushed(problem, (1.0, 0.0, 0.0))).coulomb.multiplier == pytest.approx(0.4, rel=1e-4)


@pytest.mark.parametrize(("axes", "lies"), [((0, 1, 2), False), ((0, 2, 1), True)], ids=["z up", "y up"])
def test_a_wall_that_was_drawn_with_y_up_is_asked_after(axes: tuple[int, ...], lies: bool, tmp_path: Path) -> None:
    """Three courses of two blocks; in a row on the floor, as columns that stand beside each other are, they are no such wall."""
    size, places = (0.6, 0.2, 0.3), [(0.6 * i, 0.1, 0.3 * k + 0.15) for k in range(3) for i in range(2)]

    def said(places: list[tuple[float, ...]], axes: tuple[int, ...]) -> list[str]:
        solids = [trimesh.creation.box([size[a] for a in axes]).apply_translation([place[a] for a in axes]) for place in places]
        trimesh.util.concatenate(solids).export(tmp_path / "wall.stl")
        found = remarks(analyse(pushed(masonry_of_surfaces(tmp_path / "wall.stl"), (1.0, 0.0, 0.0))), None)
        return [remark for remark in found if "drawn with y up" in remark]

    assert bool(said(places, axes)) is lies
    assert not said([(0.0, 0.2 * k, 0.15) for k in range(3)], (0, 1, 2))


@pytest.mark.parametrize(("beams", "lies"), [(1, True), (2, False)], ids=["on a floor", "planks on two beams"])
def test_planks_that_lie_on_two_beams_are_no_wall_on_its_side(beams: int, lies: bool) -> None:
    """They were asked after as one that was drawn with y up."""
    wide = 4.0 / beams**2
    held = [cuboid(f"beam {k}", (3.0 * k, 0.0, -0.3), (3.0 * k + wide, 2.0, 0.0), support=True) for k in range(beams)]
    planks = [cuboid(f"plank {k}", (0.0, 0.4 * k, 0.0), (4.0, 0.4 * k + 0.4, 0.1)) for k in range(5)]
    found = remarks(analyse(pushed(MasonryProblem("deck", 3, (*held, *planks), 0.6), (1.0, 0.0, 0.0))), None)
    assert any("drawn with y up" in remark for remark in found) is lies
