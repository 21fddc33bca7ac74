"""fcsim limit --friction: what is said of the friction that joints have."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from fcsim.command_line.main import main
from fcsim.errors import EXIT_OK
from fcsim.masonry import MasonryProblem, pushed, write_masonry
from fcsim.masonry.atlas.shapes import cuboid, one_block


def said_of(problem: MasonryProblem, path: Path, options: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    write_masonry(path, problem)
    assert main(["limit", str(path), *options]) == EXIT_OK
    return capsys.readouterr().out


def test_friction_is_that_of_the_joints_and_not_of_pairs_that_are_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A block pushed by a tenth of its weight needs 0.1 of the 0.2 of its only joint; 0.15 of 0.3 was said, the mu of all other pairs."""
    block = pushed(one_block(0.4, 1.0, 0.3), (1.0, 0.0, 0.0))
    names = [each.name for each in block.blocks]
    weak = replace(block, between={(names[0], names[1]): 0.2})
    asked = ["--friction", "--multiplier", "0.1"]
    assert "reduction of friction 2: it needs mu 0.1 of 0.2" in said_of(weak, tmp_path / "weak.json", asked, capsys)
    assert "1 joints, mu 0.2\n" in said_of(weak, tmp_path / "weak.json", [], capsys)


def test_what_is_wedged_is_not_said_to_need_no_friction(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A stone between two walls: any friction holds it, in equilibrium with what wedges it; none does not."""
    walls = [cuboid(name, (x, 0.0, 0.0), (x + 1.0, 0.4, 0.5), support=True) for name, x in (("left", -1.0), ("right", 0.4))]
    problem = MasonryProblem("chimney", 2, (*walls, cuboid("stone", (0.0, 0.0, 0.0), (0.4, 0.4, 0.5))), 0.9)
    assert "stands with a thousandth of its friction" in said_of(problem, tmp_path / "chimney.json", ["--friction"], capsys)
