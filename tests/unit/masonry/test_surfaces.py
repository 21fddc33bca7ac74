"""Masonry problems from surface files: what stands and falls is that of the same blocks given otherwise."""

from __future__ import annotations

from pathlib import Path

import pytest

from fcsim.errors import InputError
from fcsim.masonry import analyse, masonry_of_surfaces, pushed

trimesh = pytest.importorskip("trimesh")


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
