"""fcsim atlas, settle, tilt --blocks and --export: numbers of statics, files, mistakes."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import pytest

from fcsim.command_line.main import main
from fcsim.errors import EXIT_BAD_INPUT, EXIT_OK
from fcsim.masonry import pushed, write_masonry
from fcsim.masonry.atlas import table
from fcsim.masonry.atlas.answers import Answer
from fcsim.masonry.atlas.entries import of_folder
from fcsim.masonry.atlas.shapes import arch, one_block


@pytest.mark.slow
def test_the_atlas_answers_and_keeps_its_answers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, out = tmp_path / "problems", tmp_path / "atlas"
    folder.mkdir()
    write_masonry(folder / "block.json", pushed(one_block(0.4, 1.0, 0.3), (1.0, 0.0, 0.0)))
    (folder / "broken.json").write_text("{}")
    asked = ["atlas", str(folder), "--out", str(out), "--only", "block", "--only", "descending*"]
    assert main(asked) == EXIT_OK
    said = capsys.readouterr()
    assert "left out: broken.json" in said.out and "block ..." in said.err
    rows = {row["name"]: row for row in csv.DictReader((out / "atlas.csv").open())}
    assert float(rows["block"]["associative"]) == pytest.approx(0.3, rel=1e-6)
    assert float(rows["block"]["stands"]) <= 0.3 * (1 + 1e-9) <= float(rows["block"]["falls"]) * 1.005
    assert float(rows["block"]["soft_falls"]) == pytest.approx(0.3, rel=0.03)
    branch = rows["descending branch of a block"]
    assert float(branch["simulated"]) == pytest.approx(math.tan(0.5 * math.atan(1 / 3)), rel=0.01)
    assert main(asked) == EXIT_OK
    assert "block ..." not in capsys.readouterr().err  # it was there


def test_a_name_that_is_not_there_is_answered_by_those_that_are(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In quotes, since there are commas in them."""
    assert main(["atlas", "--out", str(tmp_path / "atlas"), "--only", "nothing"]) == EXIT_BAD_INPUT
    assert "'block that slides', 'stack of four, tilted', " in capsys.readouterr().err


def test_answers_are_kept_while_problem_and_code_are_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_masonry(tmp_path / "block.json", pushed(one_block(0.4, 1.0, 0.3), (1.0, 0.0, 0.0)))
    entries, _ = of_folder(tmp_path)
    monkeypatch.setattr(table, "answered", lambda entry, watch: Answer(entry.name, 1, "how long is it"))
    assert [kept for _, kept in table.answers_of(tmp_path, entries)] == [False]
    assert [kept for _, kept in table.answers_of(tmp_path, entries)] == [True]
    monkeypatch.setattr(table, "_code", lambda: "changed")
    assert [kept for _, kept in table.answers_of(tmp_path, entries)] == [False]


def test_settle_prints_and_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = tmp_path / "arch.json", tmp_path / "out"
    write_masonry(path, arch(7, 0.3, 0.8))
    options = ["--of", "v-1", "--move", "0.01,0,0", "--steps", "5"]
    assert main(["settle", str(path), *options, "--out", str(out), "--export", str(tmp_path / "arch.obj")]) == EXIT_OK
    assert "stands still at 10 mm" in capsys.readouterr().out
    seen = json.loads((out / "settle.json").read_text())
    assert len(seen["moved"]) == 6 and not seen["falls"] and seen["movements"][0]["support"] == "v-1"
    rows = list(csv.DictReader((out / "settle.csv").open()))
    assert len(rows) == 6 and rows[0]["widest joint [mm]"] == rows[0]["slip [mm]"] == "0"  # it was the round-off of a solver
    assert (out / "settle.png").stat().st_size > 5000 and (out / "cracks.png").stat().st_size > 5000
    assert (tmp_path / "arch.obj").read_text().count("\no ") + (tmp_path / "arch.obj").read_text().startswith("o ") == 9
    capsys.readouterr()
    assert main(["settle", str(path), *options, "--blocks", "deformable", "--json"]) == EXIT_OK  # stiff ones: as the rigid ones do
    soft = json.loads(capsys.readouterr().out)
    assert soft["forces"]["v-1"][-1] == pytest.approx(seen["forces"]["v-1"][-1], rel=0.02) and not soft["turned"]
    for wrong in (
        [],
        ["--E", "1e9", *options],
        ["--move", "1,0,0"],
        ["--of", "v3", "--move", "1,0,0"],
        ["--about", "0,0,0", *options],
        [*options, "--export", "a.doc"],
    ):
        assert main(["settle", str(path), *wrong]) == EXIT_BAD_INPUT


@pytest.mark.slow
def test_deformable_blocks_tilt_and_fall_into_a_drawing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = tmp_path / "block.json", tmp_path / "out"
    write_masonry(path, one_block(0.4, 1.0, 0.7))
    tilt = ["tilt", str(path), "--json", "--resolution", "0.02"]
    assert main([*tilt, "--blocks", "deformable", "--out", str(out), "--export", str(tmp_path / "fallen.json")]) == EXIT_OK
    found = json.loads((out / "analysis.json").read_text())["simulation"]
    assert found["fall"][0] <= 0.4 * 1.01 and found["fall"][1] == pytest.approx(0.4, rel=0.03)
    assert (out / "openings.csv").stat().st_size and (tmp_path / "fallen.json").stat().st_size
    capsys.readouterr()
    for wrong in (["--E", "1e9"], ["--blocks", "deformable", "--static"], ["--blocks", "deformable", "--nu", "0.5"], ["--export", "a.doc"]):
        assert main([*tilt, *wrong]) == EXIT_BAD_INPUT


@pytest.mark.parametrize("given", ["x", "0.01", "0,0", "0,0,0,0", "a,b,c", "nan,0,0", "inf,0,0"])
def test_a_movement_is_three_finite_numbers(given: str, capsys: pytest.CaptureFixture[str]) -> None:
    """An axis' name would be a metre, two zeros a movement of the plane."""
    with pytest.raises(SystemExit, match="2"):
        main(["settle", "arch.json", "--move", given])
    assert "argument --move: expected three" in capsys.readouterr().err
