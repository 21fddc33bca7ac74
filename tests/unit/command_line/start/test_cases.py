"""fcsim cases, new, and the names of cases that `run` takes."""

import ast
import errno
import json
import typing
from pathlib import Path

import pytest

from fcsim.command_line.main import main
from fcsim.command_line.start.begin import write_case
from fcsim.errors import InputError
from fcsim.running.case import load_case
from fcsim.running.known_cases import case_place, declared_parameters, known_cases
from fcsim.running.parameters import parse_parameters

ROOT = Path(__file__).parents[4]


def test_every_case_of_the_repository_is_known(capsys: pytest.CaptureFixture[str]) -> None:
    folders = sorted(path.name for path in (ROOT / "cases").iterdir() if path.is_dir() and (path / "README.md").is_file())
    assert [case.name for case in known_cases()] == folders and all(case.about for case in known_cases())
    assert main(["cases"]) == 0
    listed = [line.split()[0] for line in capsys.readouterr().out.splitlines()[1:] if line]
    assert listed[: len(folders)] == folders


def test_a_case_is_described_without_being_run(capsys: pytest.CaptureFixture[str]) -> None:
    """The declared parameters, their order, defaults and choices are those of the class."""
    script = load_case(ROOT / "cases" / "hertz")
    declared = declared_parameters(script.path)
    values = script.parameters()
    assert [p.name for p in declared] == [name for name in vars(values)]
    assert [ast.literal_eval(p.default) for p in declared] == list(vars(values).values())
    assert next(p.choices for p in declared if p.name == "contact") == ("sphere", "cylinder", "two-spheres")
    assert main(["cases", "hertz"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("# Hertz's contact") and str(script.path) in said and "two-spheres" in said


@pytest.mark.parametrize("name", ["stack", "rocks", "hertz"])
def test_choices_of_a_case_are_those_of_its_annotations(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """`blocks_are` was said to expect a BlockKind, a name that a user does not know."""
    script = load_case(ROOT / "cases" / name)
    hints = typing.get_type_hints(script.parameters)
    literals = {key: typing.get_args(hint) for key, hint in hints.items() if typing.get_origin(hint) is typing.Literal}
    assert literals
    declared = {p.name: p.choices for p in declared_parameters(script.path)}
    assert {key: declared[key] for key in literals} == literals
    assert main(["cases", name]) == 0
    assert all(", ".join(choices) in capsys.readouterr().out for choices in list(literals.values())[:1])


def test_a_path_goes_before_a_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert case_place("hertz") == ROOT / "cases" / "hertz"
    (tmp_path / "hertz").mkdir()
    assert case_place("hertz") == Path("hertz")


def test_a_name_that_is_none_is_answered_with_those_like_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "masonry_wal"]) == 2
    assert "did you mean masonry_wall?" in capsys.readouterr().err
    with pytest.raises(InputError, match=r"found no \S*qqq$"):
        case_place("qqq")


def test_a_new_case_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As written and by the command line: the friction on the sliding block is 0.4 of its weight of 39.24 N."""
    folder = tmp_path / "my_shelf"
    assert main(["new", str(folder)]) == 0
    assert str(folder / "my_shelf.py") in capsys.readouterr().out
    script = load_case(folder)
    case = script.build(parse_parameters(script, {"steps": "20", "E": "2e8"}))
    assert case.name == "my_shelf" and "NAME" not in script.path.read_text(encoding="utf-8").replace("results/NAME", "")
    *_, last = case.simulation
    assert case.sensors[1].measure(last) == pytest.approx(-0.4 * 0.002 * 2000 * 9.81, rel=0.02)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("2d", "no digit first"),
        ("a-b", "letters, digits and '_'"),
        ("..", "expected a name"),
        ("class", "a keyword or a package"),
        ("numpy", "a keyword or a package"),  # python numpy/numpy.py would import itself
        ("json", "a keyword or a package"),
        ("__main__", "a keyword or a package"),
    ],
)
def test_names_that_no_case_can_have(name: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=said):
        write_case(tmp_path / name)


def test_a_case_that_is_there_stays(tmp_path: Path) -> None:
    write_case(tmp_path / "mine")
    with pytest.raises(InputError, match="not taken"):
        write_case(tmp_path / "mine")
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="expected a folder"):
        write_case(tmp_path / "file")


def test_parameters_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "hertz", "--parameters", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["command"] == "run" and answer["exit_code"] == 0 and answer["parameters"]["E"] == 20e9
    assert main(["run", "hertz", "--parameters", "--set", "E=3e9", "--tol", "1e-5", "--json"]) == 0  # --set was left aside
    answer = json.loads(capsys.readouterr().out)
    assert (answer["parameters"]["E"], answer["parameters"]["tol"]) == (3e9, 1e-5)


def test_a_full_disk_leaves_no_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, *_: object, **__: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    (tmp_path / "there").mkdir()
    monkeypatch.setattr(Path, "write_text", full)
    for place in ("one/two", "there/two", "there/there"):
        with pytest.raises(OSError, match="No space left"):
            write_case(tmp_path / place)
    assert [str(found.relative_to(tmp_path)) for found in tmp_path.rglob("*")] == ["there"]
