"""Case scripts: loading them, reading their parameters, refusals."""

import dataclasses
import os
import py_compile
import sys
from pathlib import Path

import pytest

from fcsim.errors import InputError
from fcsim.running.case import History, load_case
from fcsim.running.parameters import parse_parameters


def test_folder_and_script_are_the_same_case(case_folder: Path) -> None:
    for path in (case_folder, case_folder / "two_blocks.py", str(case_folder)):
        script = load_case(path)
        assert script.name == "two_blocks"
        assert script.build(script.parameters()).simulation.steps == 12


def test_a_case_in_the_working_folder(case_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(case_folder)
    assert load_case(".").name == "two_blocks"


def test_a_script_changed_within_a_second_is_read_anew(case_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the same size and the same second, which is what Python's byte code is known by."""
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    script = case_folder / "two_blocks.py"
    text, stamp = script.read_text(), (1_700_000_000, 1_700_000_000)
    os.utime(script, stamp)
    assert load_case(script).parameters().E == 1e7
    py_compile.compile(str(script))
    script.write_text(text.replace("E: float = 1e7", "E: float = 3e7"))
    os.utime(script, stamp)
    assert load_case(script).parameters().E == 3e7


def test_parameters_are_read_as_their_types(case_folder: Path) -> None:
    script = load_case(case_folder)
    texts = {"size": "0.1, 0.2,0.3", "divisions": "(2,1,1)", "E": "2e9", "held": "On", "rule": "faces", "steps": "7", "solver": "NSGS-AC"}
    p = parse_parameters(script, texts)
    assert (p.size, p.divisions, p.E, p.held, p.rule, p.steps, p.solver) == ((0.1, 0.2, 0.3), (2, 1, 1), 2e9, True, "faces", 7, "NSGS-AC")
    assert p.tol == 1e-8
    assert [type(value) for value in p.divisions] == [int, int, int]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("height", "3", "has the parameters size, divisions, E"),
        ("E", "stiff", r"--set E=stiff: case two_blocks expects a number"),
        ("steps", "1.5", "expects a whole number"),
        ("held", "maybe", "expects on or off"),
        ("rule", "edges", "expects one of nodes, faces"),
        ("size", "1,2", "expects 3 values"),
        ("size", "1,2,x", "expects"),
    ],
)
def test_bad_parameters_are_refused(case_folder: Path, name: str, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_parameters(load_case(case_folder), {name: text})


def test_what_is_not_a_case(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"missing.*found no"):
        load_case(tmp_path / "missing")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"holds NAME\.py.*empty/empty\.py"):
        load_case(tmp_path / "empty")
    (tmp_path / "data.txt").write_text("x")
    with pytest.raises(InputError, match="expected a folder"):
        load_case(tmp_path / "data.txt")
    (tmp_path / "half.py").write_text("def build(p): return None\n")
    with pytest.raises(InputError, match="expected a dataclass Parameters and a function build"):
        load_case(tmp_path / "half.py")
    (tmp_path / "broken.py").write_text("def build(:\n")
    with pytest.raises(InputError, match="cannot be loaded as Python"):
        load_case(tmp_path / "broken.py")


def test_sensors_and_plots_are_checked(case_folder: Path) -> None:
    case = load_case(case_folder).build(load_case(case_folder).parameters())
    lift, x = case.sensors
    with pytest.raises(InputError, match="lift more than once"):
        dataclasses.replace(case, sensors=(lift, x, lift))
    with pytest.raises(InputError, match="expected columns among lift, x, got 'y'"):
        dataclasses.replace(case, plots={"imposed": "y"})
    with pytest.raises(InputError, match="got 'z'"):
        dataclasses.replace(case, plots={"imposed": "x", "reaction": ("lift", "z")})


def test_histories_are_checked(case_folder: Path) -> None:
    case = load_case(case_folder).build(load_case(case_folder).parameters())
    dataclasses.replace(case, plots={"histories": (History("lift", ("lift",)), History("path", ("lift",), against="x"))})
    with pytest.raises(InputError, match="expected columns among lift, x, got 'speed'"):
        dataclasses.replace(case, plots={"histories": (History("a", ("lift", "speed")),)})
    with pytest.raises(InputError, match="expected columns among lift, x, got 'y'"):
        dataclasses.replace(case, plots={"histories": (History("a", ("lift",), against="y"),)})
    with pytest.raises(InputError, match="history 'a': expected columns of one unit, got lift, x"):
        dataclasses.replace(case, plots={"histories": (History("a", ("lift", "x")),)})


def test_parameters_that_a_script_cannot_compute_with(tmp_path: Path) -> None:
    (tmp_path / "ratio.py").write_text(
        "from dataclasses import dataclass\n\n@dataclass(frozen=True)\nclass Parameters:\n    h: float = 1.0\n\n"
        "def build(p):\n    return 1 / p.h\n"
    )
    script = load_case(tmp_path / "ratio.py")
    with pytest.raises(InputError, match="case 'ratio': expected parameters that its script can compute with: float division by zero"):
        script.build(script.parameters(h=0.0))


def test_what_a_library_refuses_is_said_with_the_scripts_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = """
from dataclasses import dataclass
import numpy as np

@dataclass(frozen=True)
class Parameters:
    seed: int = -1

def build(parameters):
    np.random.default_rng(parameters.seed)
"""
    monkeypatch.chdir(tmp_path)
    Path("dice.py").write_text(script)
    for path in (Path("dice.py"), tmp_path / "dice.py"):
        case = load_case(path)
        with pytest.raises(
            InputError, match=r"dice\.py, line 10: np\.random\.default_rng\(parameters\.seed\): ValueError: expected non-negative"
        ):
            case.build(case.parameters())


def test_a_case_that_comes_with_fcsim_is_loaded_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As `fcsim run stack` does: the lessons of the gallery, taken from the site, found `../../../cases/stack` in no folder of a user."""
    monkeypatch.chdir(tmp_path)
    script = load_case("stack")
    assert script.name == "stack" and "overhang" in {field.name for field in dataclasses.fields(script.parameters)}
