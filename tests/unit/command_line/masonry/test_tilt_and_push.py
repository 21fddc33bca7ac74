"""fcsim limit | tilt | push: numbers, files and exit codes of a block whose statics is known."""

from __future__ import annotations

import csv
import errno
import json
import math
from pathlib import Path
from typing import Any

import pytest

from fcsim.command_line.main import main
from fcsim.errors import EXIT_BAD_INPUT, EXIT_OK


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> list[list[float]]:
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    return [[(high if c else low)[k] for k, c in enumerate(corner)] for corner in corners]


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """A block of 0.4 x 1.0 that topples at 0.4 and would slide at 0.7."""
    data: dict[str, Any] = {
        "schema": "masonry-problem/1",
        "name": "block",
        "dimension": 2,
        "contact": {"mu": 0.7},
        "loads": [{"kind": "acceleration", "value": [0, 0, -9.81]}],
        "expected": [{"quantity": "proportion", "value": 0.4}],
        "blocks": [
            {"id": "floor", "vertices": box((-2, 0, -1), (2, 0.3, 0)), "support": True},
            {"id": "block", "vertices": box((0, 0, 0), (0.4, 0.3, 1.0)), "density": 2000},
        ],
    }
    path = tmp_path / "block.json"
    path.write_text(json.dumps(data))
    return path


def test_limit_prints_and_writes(model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["limit", str(model), "--direction", "x", "--out", str(tmp_path / "out")]) == EXIT_OK
    printed = capsys.readouterr().out
    assert (
        "0.4\n" in printed
        and "1 joint turns" in printed
        and "1 block, 1 support, 1 joint, mu 0.7" in printed
        and "proportion: 0.4" in printed
    )
    found = json.loads((tmp_path / "out" / "analysis.json").read_text())
    assert found["limit_analysis"]["coulomb"]["multiplier"] == pytest.approx(0.4)
    (joint,) = csv.DictReader((tmp_path / "out" / "joints.csv").open())
    weight = 2000 * 0.4 * 0.3 * 9.81
    assert (joint["block"], joint["with"], joint["state"]) == ("floor", "block", "hinge")
    assert float(joint["N [kN]"]) == pytest.approx(1e-3 * weight, rel=1e-5)
    assert float(joint["T [kN]"]) == pytest.approx(0.4e-3 * weight, rel=1e-5)
    assert float(joint["eccentricity [m]"]) == pytest.approx(0.2, rel=1e-5)
    blocks = list(csv.DictReader((tmp_path / "out" / "blocks.csv").open()))
    assert float(blocks[1]["vx"]) == pytest.approx(1.0)  # about the toe: (h / 2, b / 2) omega, the larger one 1
    assert float(blocks[1]["vz"]) == pytest.approx(0.4, rel=1e-5)
    assert (tmp_path / "out" / "mechanism.png").stat().st_size > 5000


def test_tilt_says_the_angle(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tilt", str(model), "--static", "--mu", "0.3"]) == EXIT_OK
    assert f"{math.degrees(math.atan(0.3)):.3f}" in capsys.readouterr().out


def test_push_brackets_the_load(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["push", str(model), "--direction=-x", "--resolution", "0.05", "--json"]) == EXIT_OK
    found = json.loads(capsys.readouterr().out)
    low, high = found["simulation"]["fall"]
    assert low <= 0.4 * (1 + 1e-6) and high >= 0.4 * (1 - 1e-6) and high - low <= 0.05 * high


@pytest.mark.slow
def test_the_collapse_is_filmed_and_its_cracks_are_measured(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The block turns about its toe: the joint opens by the base times the angle, and does not slip."""
    out = tmp_path / "out"
    monkeypatch.setattr("fcsim.command_line.masonry.tilt_and_push._FALL", 0.2)  # [s] that are filmed
    assert main(["push", str(model), "--direction", "x", "--resolution", "0.05", "--out", str(out), "--film"]) == EXIT_OK
    (joint,) = csv.DictReader((out / "openings.csv").open())
    opening, slip = float(joint["opening [mm]"]), float(joint["slip [mm]"])
    assert 0.4 / math.hypot(0.4, 1.0) * 10.0 == pytest.approx(opening, rel=0.3)  # the far corner moves by 1 % of 1 m
    assert slip < 0.05 * opening
    for name in ("cracks.png", "mechanism.png", "run/film.gif", "run/run.json", "run/steps.csv"):
        assert (out / name).stat().st_size > 500
    assert "collapse: finished" in capsys.readouterr().out


def test_a_model_runs_as_a_case(model: Path, tmp_path: Path) -> None:
    """Deformable: the floor carries the weight once the waves of its beginning have gone."""
    out = tmp_path / "run"
    settings = ["--set", "blocks_are=deformable", "--set", "E=1e7", "--set", "beta=5e-3", "--set", "cells=1", "--steps", "60"]
    assert main(["run", str(model), *settings, "--out", str(out), "--export-every", "0", "--vtk-every", "0"]) == EXIT_OK
    rows = list(csv.DictReader((out / "steps.csv").open()))
    assert len(rows) == 60
    assert float(rows[-1]["multiplier"]) == 0.0
    assert float(rows[-1]["displacement"]) == pytest.approx(2000 * 9.81 * 1.0**2 / (2 * 1e7), rel=0.15)  # rho g h^2 / 2 E


def test_a_film_of_a_tilt_says_the_angle(model: Path) -> None:
    """What `fcsim render` writes under the title: the imposed column, here the table's angle after each step of 0.5 degrees."""
    from fcsim.masonry.case import any_case

    case = any_case(model)
    made = case.build(case.parameters(tilt=50.0, h=0.01, steps=2))
    assert made.plots["imposed"] == "tilt"
    angle = next(sensor for sensor in made.sensors if sensor.column == "tilt")
    assert [angle.measure(step) for step in made.simulation] == pytest.approx([0.5, 1.0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["push", "--direction", "x", "--branch", "--blocks", "deformable"], "knows rigid blocks"),
        (["push", "--direction", "x", "--branch", "--resolution", "0.01"], "--resolution: expected it without --branch"),
        (["push", "--direction", "x", "--branch", "--tolerance", "1e-3"], "--tolerance: expected it without --branch"),
        (["push"], "a load that the multiplier scales, or --direction"),
        (["limit"], ""),
        (["limit", "--direction", "y"], "plane of x and z"),
        (["tilt", "--direction", "z"], "horizontal"),
        (["push", "--direction", "x", "--resolution", "2"], "resolution: expected a share"),
        (["limit", "--mu", "-1"], "mu: expected"),
        (["push", "--direction", "x", "--film"], "--out DIR"),
        (["tilt", "--static", "--resolution", "0.1"], "--resolution: expected it without --static"),
        (["shake", "--direction", "y"], "--direction: expected it with --record"),
        (["shake", "--factor", "1"], "--factor: expected it with --record"),
        (["shake", "--record", "none.csv", "--factor", "inf"], "--factor: expected a finite number, got inf"),
    ],
)
def test_what_cannot_be_asked(model: Path, arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    expected = EXIT_BAD_INPUT if message else EXIT_OK
    assert main([arguments[0], str(model), *arguments[1:]]) == expected
    assert message in capsys.readouterr().err


def test_directions_are_refused_by_the_parser(model: Path) -> None:
    for text in ("w", "1,2", "0,0,0", "1,nan,0"):
        with pytest.raises(SystemExit):
            main(["limit", str(model), "--direction", text])


def test_long_histories_say_how_far_they_are(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Where a sliding structure takes 2000 equilibria, and a shaken one as many steps, nothing was said until the end."""
    assert main(["push", str(model), "--direction", "x", "--branch", "--step", "0.002", "--to", "0.02"]) == EXIT_OK
    said = capsys.readouterr()
    assert "displacement 10 of 10: 20 mm, multiplier 0.35" in said.err
    first = said.err.index("displacement 0 of 10")
    begun = said.err.index("limit analysis of 2 blocks"), said.err.index("at rest: the multiplier that sets them in motion")
    assert begun[0] < begun[1] < first  # of a dome, a minute before the first of them
    assert "bears a multiplier still at 20 mm" in said.out and "\n20 " in said.out  # a row of the table, too
    record = model.with_name("record.csv")
    record.write_text("t [s],a [g]\n0,0\n0.1,0.1\n0.2,0\n")
    assert main(["shake", str(model), "--record", str(record), "--duration", "0.1", "--h", "0.01"]) == EXIT_OK
    assert "step 10 of 10: 0.1 s" in capsys.readouterr().err


@pytest.mark.parametrize(
    "command", [["limit"], ["shake", "--duration", "0.02", "--h", "0.01"], ["settle", "--move", "0,0,-0.01", "--steps", "1"]]
)
@pytest.mark.parametrize("form", [[], ["--json"]])
def test_the_answer_is_told_before_a_full_disk_refuses_the_files(
    command: list[str], form: list[str], model: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, *_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    for module in ("report", "exports.settlement"):
        monkeypatch.setattr(f"fcsim.masonry.{module}.write_record", full)
    name, *options = command
    assert main([name, str(model), *options, *form, "--out", str(model.parent / "out")]) == 2
    said = capsys.readouterr()
    assert "No space left on device" in said.err and "out" not in said.out.splitlines()[-1]
    assert json.loads(said.out) if form else len(said.out.splitlines()) >= 3


def test_what_does_not_move_moves_by_0(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It moved by 7.4e-09 mm, and turned by 4.3e-10 degrees: the round-off of a solver."""
    record = model.with_name("record.csv")
    record.write_text("t [s],a [g]\n0,0\n0.1,0.1\n0.2,0\n")
    assert main(["shake", str(model), "--record", str(record), "--duration", "0.03", "--h", "0.01"]) == EXIT_OK
    said = capsys.readouterr().out
    assert said.count(" 0 mm ") == 2 and " 0 degrees " in said
    assert "block: 1 block, 1 support, 0.03 s in 3 steps" in said  # the floor was counted as a block
