"""fcsim limit --friction: what is said of the friction that joints have."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fcsim.command_line.main import main
from fcsim.errors import EXIT_BAD_INPUT, EXIT_OK, InputError
from fcsim.masonry import LimitProblem, MasonryProblem, analyse, collapse, pushed, write_masonry
from fcsim.masonry.atlas.shapes import cuboid, one_block
from fcsim.masonry.remarks import remarks


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
    assert "1 joint, mu 0.2\n" in said_of(weak, tmp_path / "weak.json", [], capsys)


def test_what_is_wedged_is_not_said_to_need_no_friction(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A stone between two walls: any friction holds it, in equilibrium with what wedges it; none does not."""
    walls = [cuboid(name, (x, 0.0, 0.0), (x + 1.0, 0.4, 0.5), support=True) for name, x in (("left", -1.0), ("right", 0.4))]
    problem = MasonryProblem("chimney", 2, (*walls, cuboid("stone", (0.0, 0.0, 0.0), (0.4, 0.4, 0.5))), 0.9)
    assert "stands with a thousandth of its friction" in said_of(problem, tmp_path / "chimney.json", ["--friction"], capsys)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--density=-5"], "density: expected a number > 0 in kg/m^3, got -5"),
        (["--density", "1500"], "density: expected it with blocks whose file has none"),
        (["--tolerance=-1"], "tolerance: expected a distance > 0 in m, got -1"),
        (["--tolerance=nan"], "tolerance: expected a distance > 0 in m, got nan"),
        (["--tolerance=10"], "tolerance: expected at most 0.25 m, a quarter of the smallest block's extent ('block'), got 10"),
    ],
)
def test_options_that_say_nothing_possible_or_nothing_new_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], said: str
) -> None:
    """Negative densities, and those of blocks that have theirs, were passed over; a negative tolerance was named as detection names it."""
    write_masonry(tmp_path / "block.json", pushed(one_block(0.4, 1.0, 0.3), (1.0, 0.0, 0.0)))
    assert main(["limit", str(tmp_path / "block.json"), *options]) == EXIT_BAD_INPUT
    assert said in capsys.readouterr().err


def test_what_is_no_option_is_not_advised(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Blocks that overlap were to be allowed by an argument of Python; a turn out of the plane was shown as Python shows it."""
    problem = one_block(0.4, 1.0, 0.3)
    stone = next(block for block in problem.blocks if not block.support)
    twin = replace(stone, surface=replace(stone.surface, name="twin"))
    write_masonry(tmp_path / "twins.json", replace(problem, blocks=(*problem.blocks, twin)))
    assert main(["limit", str(tmp_path / "twins.json"), "--direction", "x"]) == EXIT_BAD_INPUT
    said = capsys.readouterr().err
    assert "expected at most 2 %: move them apart\n" in said.lower() and "masonry problem" in said
    write_masonry(tmp_path / "block.json", replace(problem, dimension=2))
    held = next(block.name for block in problem.blocks if block.support)
    assert main(["settle", str(tmp_path / "block.json"), "--of", held, "--turn", "0,0,1"]) == EXIT_BAD_INPUT
    assert "a turn about y alone, got move (0.0, 0.0, 0.0), turn (0.0, 0.0, 1.0) degrees" in capsys.readouterr().err


def test_a_density_in_other_units_is_asked_about(tmp_path: Path) -> None:
    """2.2 is that of stone in g/cm^3, 22 in kN/m^3, 22000 in N/m^3; 2200 is not asked about, nor is 1 under a gravity of 1."""
    problem = pushed(one_block(0.4, 1.0, 0.3), (1.0, 0.0, 0.0))
    for density, asked in ((2.2, True), (22.0, True), (22e3, True), (2200.0, False)):
        blocks = tuple(block if block.support else replace(block, density=density, mass=None) for block in problem.blocks)
        said = " ".join(remarks(analyse(replace(problem, blocks=blocks)), None))
        assert (f"density {density:g} kg/m^3 of " in said) == asked
    blocks = tuple(block if block.support else replace(block, density=1.0, mass=None) for block in problem.blocks)
    loads = tuple(replace(load, value=(0.0, 0.0, -1.0)) if load.value[2] else load for load in problem.loads)
    assert "density" not in " ".join(remarks(analyse(replace(problem, blocks=blocks, loads=loads)), None))


def test_a_folder_for_one_number_is_refused_before_it_is_computed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    write_masonry(tmp_path / "block.json", pushed(one_block(0.4, 1.0, 0.3), (1.0, 0.0, 0.0)))
    monkeypatch.setattr("fcsim.masonry.friction_factor", None)
    assert main(["limit", str(tmp_path / "block.json"), "--friction", "--out", str(tmp_path / "out")]) == EXIT_BAD_INPUT
    assert "--out: expected it without --friction" in capsys.readouterr().err


def test_trials_begin_from_joints_that_the_tolerance_closes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A block 1 mm above its floor touches it at a tolerance of 2 mm; the bracket took it to hang in the air."""
    block, lift = one_block(0.4, 1.0, 0.3), np.array([0.0, 0.0, 1e-3])
    lifted = [b if b.support else replace(b, surface=replace(b.surface, points=b.surface.points + lift)) for b in block.blocks]
    problem = pushed(replace(block, blocks=tuple(lifted)), (1.0, 0.0, 0.0))
    asked: list[float | None] = []

    def asked_for(problem: MasonryProblem, *, tolerance: float | None = None) -> LimitProblem:
        asked.append(tolerance)
        raise InputError("enough")  # before any trial

    monkeypatch.setattr(collapse, "limit_problem", asked_for)
    write_masonry(tmp_path / "block.json", problem)
    assert main(["push", str(tmp_path / "block.json"), "--tolerance", "2e-3"]) == EXIT_BAD_INPUT
    assert asked == [2e-3] and "enough" in capsys.readouterr().err
