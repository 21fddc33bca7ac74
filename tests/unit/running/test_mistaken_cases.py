"""What a case gets wrong beyond its parameters is one line that names it, and no run that finished; worlds without anything free."""

import csv
import io
import json
from pathlib import Path

import pytest

from fcsim.command_line.main import main
from fcsim.errors import InputError
from fcsim.export_fclib import read_fclib
from fcsim.running.case import load_case

SCRIPT = """
from dataclasses import dataclass

import numpy as np

from fcsim import Case, Everything, History, Sensor, Simulation, Support, Theta, build_model
from fcsim.mesh import rigid_rectangle


@dataclass(frozen=True)
class Parameters:
    steps: int = 3


def build(p):
    boxes = [rigid_rectangle("floor", (4.0, 0.5), (0.0, -0.25), 1.0), rigid_rectangle("box", (0.4, 0.2), (0.0, 0.1), 160.0)]
    model = build_model(boxes[:BODIES], supports=[Support("floor", ("x", "y", "rz"))], gravity=lambda t: (0.0, -9.81))
    simulation = Simulation(model, Everything(model, mu=0.3), Theta(1e-3), p.steps)
    return Case("world", "A world", SIMULATION, sensors=(SENSORS), plots=PLOTS)
"""


def world(folder: Path, sensors: str = "", simulation: str = "simulation", bodies: int = 2, plots: str = "{}") -> str:
    """Write the case and return its folder."""
    text = SCRIPT.replace("BODIES", str(bodies)).replace("SIMULATION", simulation).replace("SENSORS", sensors).replace("PLOTS", plots)
    (folder / "world").mkdir()
    (folder / "world" / "world.py").write_text(text)
    return str(folder / "world")


@pytest.mark.parametrize(
    ("measure", "said"),
    [
        ("'many'", "sensor 'a', step 1: expected a number, got str many"),
        ("None", "sensor 'a', step 1: expected a number, got NoneType None"),
        ("np.ones(2)", "sensor 'a', step 1: expected a number, got ndarray [1. 1.]"),
        ("1 / (step.number - 2)", "sensor 'a', step 2: ZeroDivisionError: division by zero"),
        ("step.nothing", "sensor 'a', step 1: AttributeError: 'Step' object has no attribute 'nothing'"),
    ],
)
def test_sensors_that_measure_no_number(tmp_path: Path, capsys: pytest.CaptureFixture[str], measure: str, said: str) -> None:
    case = world(tmp_path, f"Sensor('a', 'label', 'N', lambda step: {measure}),")
    assert main(["run", case, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert said in error and "Traceback" not in error
    assert json.loads((tmp_path / "out" / "run.json").read_text())["status"] == "failed"


def test_numbers_of_any_kind_are_measured(tmp_path: Path) -> None:
    """Of NumPy, whole, without a value (nan) and arrays without dimensions."""
    kinds = ("np.float32(0.5)", "np.array(2.5)", "np.int64(7)", "3", "float('nan')")
    case = world(tmp_path, " ".join(f"Sensor('s{k}', '', '', lambda step: {kind})," for k, kind in enumerate(kinds)))
    assert main(["run", case, "--out", str(tmp_path / "out")]) == 0
    with (tmp_path / "out" / "steps.csv").open() as file:
        row = next(csv.DictReader(file))
    assert [row[f"s{k}"] for k in range(5)] == ["0.5", "2.5", "7", "3", "nan"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"sensors": "Sensor('step', '', '', lambda step: 1.0),"}, "expected columns that no run has by itself, got 'step'"),
        ({"sensors": "Sensor('seconds_solve', '', '', lambda step: 1.0),"}, "expected columns that no run has by itself"),
        ({"sensors": "len,"}, "case 'world', sensors: expected each a Sensor, got builtin_function_or_method"),
        (
            {"sensors": "Sensor('a', '', '', len)"},
            "case 'world', sensors: expected a tuple of Sensors, (first, second) or (one,), got Sensor",
        ),
        ({"plots": "{'impose': 'a'}"}, "case 'world', plots: expected some of imposed, reaction, bound, histories, got 'impose'"),
        ({"plots": "{'reaction': 'a'}"}, "case 'world', plots: expected a tuple as 'reaction', as (one,), got 'a'"),
        ({"plots": "{'histories': ('a',)}"}, "case 'world', plots: expected each of 'histories' a History, got str"),
        ({"plots": "{'histories': (History('h', 'ab'),)}"}, "history 'h', columns: expected a tuple, as (one,), got 'ab'"),
        ({"plots": "{'bound': 3.0}"}, "case 'world', plots: expected 'bound' as (value, label), got 3.0"),
        ({"plots": "['a']"}, "case 'world', plots: expected a dictionary of some of imposed, reaction, bound, histories, got list"),
        ({"simulation": "list(simulation)"}, "case 'world', simulation: expected a Simulation, got list"),
    ],
)
def test_cases_that_are_none(tmp_path: Path, capsys: pytest.CaptureFixture[str], given: dict[str, str], said: str) -> None:
    """Refused before anything is written: a sensor named as a column of every run had ended a run that was "finished" without steps.h5."""
    assert main(["run", world(tmp_path, **given), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert said in error and "Traceback" not in error
    assert not (tmp_path / "out").exists()


def test_a_parameter_without_a_default(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """After one that has a default: Python's dataclass ends the script with a traceback of its own."""
    script = Path(world(tmp_path)) / "world.py"
    script.write_text(script.read_text().replace("    steps: int = 3", "    steps: int = 3\n    mu: float"))
    assert main(["run", str(script), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert "world.py, line " in error and "TypeError: non-default argument 'mu' follows default argument" in error


def test_a_world_in_which_all_is_held(tmp_path: Path) -> None:
    """Nothing moves and nothing touches; its problems, without a degree of freedom, are written and read like others."""
    assert main(["run", world(tmp_path, bodies=1), "--out", str(tmp_path / "out"), "--export-every", "1", "--export-form", "both"]) == 0
    files = sorted((tmp_path / "out" / "fclib").rglob("*.hdf5"))
    assert len(files) == 6
    assert all(read_fclib(file).problem.nc == 0 for file in files)
    assert main(["solve", str(files[0])]) == 0


def test_a_run_without_steps_has_no_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", world(tmp_path), "--steps", "0", "--out", str(tmp_path / "out")]) == 0
    assert main(["render", str(tmp_path / "out")]) == 2
    assert "expected a run of at least one step" in capsys.readouterr().err


ROLLS = """
from dataclasses import dataclass

from fcsim import Case, ExactContacts, Simulation, Support, Theta, build_model
from fcsim.contact_law import Gap, Rolling, Spinning
from fcsim.mesh import rigid_plane, rigid_sphere


@dataclass(frozen=True)
class Parameters:
    steps: int = 1


def build(p):
    bodies = [rigid_plane("floor", (0, 0, 0), (0, 0, 1), size=1.0), rigid_sphere("ball", 0.1, (0.0, 0.0, 0.1), 1.0)]
    model = build_model(bodies, supports=[Support("floor", ("x", "y", "z", "rx", "ry", "rz"))], gravity=lambda t: (0.0, 0.0, -9.81))
    return Case("rolls", "It rolls", Simulation(model, ExactContacts(model, 0.5), Theta(1e-3, law=LAW), p.steps))
"""


@pytest.mark.parametrize(
    ("law", "options", "said"),
    [
        ("Spinning(0.01, Rolling(0.01))", (), "has both for one contact: FCLIB's rolling problems have two moments a contact"),
        ("Rolling(0.01, Spinning(0.01))", (), "has both for one contact"),
        ("Rolling(0.01)", ("--export-form", "both"), "FCLIB has no local form"),
        ("Rolling(0.01, Spinning(0.01))", ("--export-every", "0"), ""),
        ("Rolling(0.0, Spinning(0.01))", (), ""),
    ],
)
def test_resistances_that_fclib_has_no_place_for_are_refused_before_the_first_step(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], law: str, options: tuple[str, ...], said: str
) -> None:
    """It was refused where the first file would have been written, step 10."""
    (tmp_path / "rolls").mkdir()
    (tmp_path / "rolls" / "rolls.py").write_text(ROLLS.replace("LAW", law))
    assert main(["run", str(tmp_path / "rolls"), "--out", str(tmp_path / "out"), *options]) == (2 if said else 0)
    assert said in capsys.readouterr().err and (tmp_path / "out").exists() == (not said)


@pytest.mark.parametrize("in_build", [False, True])
def test_a_script_that_asks_where_nobody_answers_is_refused_by_its_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, in_build: bool
) -> None:
    script = tmp_path / "asks.py"
    lines = ["from dataclasses import dataclass", "@dataclass(frozen=True)", "class Parameters:", "    mu: float = 0.5"]
    script.write_text("\n".join([*lines, "def build(p):" if in_build else "if True:", "    mu = float(input('mu? '))", "build = build\n"]))
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    with pytest.raises(InputError, match=r"asks\.py, line 6: expected a script that asks nothing"):
        case = load_case(script)
        case.build(case.parameters())


@pytest.mark.parametrize("line", ["assert p.steps > 3, 'too few'", "raise RuntimeError('too few')"])
def test_what_build_raises_itself_is_refused_by_its_line(tmp_path: Path, capsys: pytest.CaptureFixture[str], line: str) -> None:
    """It was a traceback, and exit code 1, which says that a step did not converge."""
    folder = Path(world(tmp_path))
    script = folder / "world.py"
    script.write_text(script.read_text().replace("def build(p):", f"def build(p):\n    {line}"))
    assert main(["run", str(folder), "--out", str(tmp_path / "out")]) == 2
    kind = "AssertionError" if "assert" in line else "RuntimeError"
    assert f"world.py, line 16: {line}: {kind}: too few" in capsys.readouterr().err


def test_a_module_beside_the_script_is_named_with_what_finds_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`python world.py` finds it: a newcomer was told that there is none."""
    script = Path(world(tmp_path)) / "world.py"
    script.write_text("from lengths import side\n" + script.read_text())
    assert main(["run", str(script.parent), "--out", str(tmp_path / "out")]) == 2
    assert "lies beside" not in capsys.readouterr().err
    (script.parent / "lengths.py").write_text("side = 1.0\n")
    assert main(["run", str(script.parent), "--out", str(tmp_path / "out")]) == 2
    assert f"it lies beside the script, whose folder is not on Python's path: PYTHONPATH={script.parent}" in capsys.readouterr().err


def test_a_script_that_goes_elsewhere_is_told_what_was_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of a relative --out it said `results: out ()`."""
    monkeypatch.chdir(tmp_path)
    script = Path(world(tmp_path)) / "world.py"
    script.write_text(script.read_text().replace("    boxes =", "    import os\n\n    os.chdir('/')\n    boxes ="))
    assert main(["run", "world", "--out", "out", "--export-every", "0", "--vtk-every", "0"]) == 0
    assert "results: out (run.json, steps.csv)" in capsys.readouterr().out
