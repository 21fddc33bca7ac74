"""The command line: run, solve, info, solvers; exit codes and messages."""

import argparse
import csv
import errno
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

from fcsim import __version__
from fcsim.command_line.main import _parser, main
from fcsim.export_fclib import Solution, read_fclib, write_fclib
from fcsim.problem import GlobalProblem, LocalProblem, natural_map_residual
from fcsim.problem.rolling import GlobalRollingProblem
from fcsim.solvers import ALIASES, SOLVERS

ROOT = Path(__file__).parents[3]
QUIET = ["--export-every", "0", "--vtk-every", "0"]


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("kept") / "exported"


@pytest.fixture
def problem_file(case_folder: Path, tmp_path: Path, kept: Path) -> Path:
    """Step 12 of the small case as an FCLIB file: each test has its own copy."""
    if not kept.exists():
        arguments = ["--export-every", "12", "--vtk-every", "0", "--export-form", "both"]
        assert main(["run", str(case_folder), "--out", str(kept), *arguments]) == 0
    shutil.copytree(kept / "fclib", tmp_path / "exported" / "fclib")
    return next((tmp_path / "exported" / "fclib" / "global").iterdir())


def test_where_nothing_can_be_written_is_told_before_anything_is_computed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Analyses and pages were computed first, and lost. A test runs as root, whom permissions do not hold."""
    monkeypatch.setattr("os.access", lambda path, mode: Path(path) != tmp_path)
    analyses = ("limit m.json --out", "push m.json --export", "info m.json --draw", "atlas --out")
    for command in (*analyses, "compare a b --page", "profile r --out"):
        assert main([*command.split(), str(tmp_path / "not" / "there.obj")]) == 2
        assert f"there.obj: expected a place that can be written to, {tmp_path} cannot" in capsys.readouterr().err


def test_run_with_options(case_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    arguments = ["--steps", "4", "--set", "E=3e7", "--set", "size=0.2,0.2,0.2", "--solver", "NSGS-AC", "--tol", "1e-6"]
    assert main(["run", str(case_folder), "--out", str(out), *QUIET, *arguments]) == 0
    about = json.loads((out / "run.json").read_text())
    assert (about["solver"], about["tol"], about["steps"], about["parameters"]["E"]) == ("NSGS-AC", 1e-6, 4, 3e7)
    assert about["parameters"]["size"] == [0.2, 0.2, 0.2]
    with (out / "steps.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["solver"] for row in rows] == ["NSGS-AC"] * 4
    assert sorted(entry.name for entry in out.iterdir()) == ["checkpoint.h5", "run.json", "steps.csv", "steps.h5"]
    printed = capsys.readouterr().out
    assert "finished: 4 steps" in printed
    for phase in ("detection", "assembly", "solve", "output"):
        assert phase in printed
    assert str(out) in printed.replace("\n", "")


def test_default_folder_and_resume(case_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["run", "two_blocks", "--steps", "3", *QUIET]) == 0
    assert main(["run", "two_blocks", "--steps", "5", "--resume", *QUIET]) == 0
    assert json.loads((tmp_path / "results" / "two_blocks" / "run.json").read_text())["steps_done"] == 5


def test_a_resumed_run_writes_what_it_began_to_write(case_folder: Path, tmp_path: Path) -> None:
    """Options of the first command hold for the second, but where that says otherwise; they went back to the defaults without a word."""
    out, case = tmp_path / "out", str(case_folder)
    begun = ["--export-every", "2", "--export-form", "both", "--vtk-every", "0", "--witness-every", "0", "--checkpoint-every", "1"]
    begun.append("--export-iterations")
    assert main(["run", case, "--steps", "2", "--out", str(out), *begun]) == 0
    assert main(["run", case, "--steps", "4", "--out", str(out), "--resume"]) == 0
    assert [len(list((out / "fclib" / form).iterdir())) for form in ("global", "local")] == [2, 2]
    assert not (out / "vtk").exists()
    first = json.loads((out / "run.json").read_text())["options"]
    assert (first["witness_every"], first["checkpoint_every"]) == (0, 1)
    assert first["export_iterations"]
    back = ["--no-export-iterations"]
    assert main(["run", case, "--steps", "6", "--out", str(out), "--resume", "--export-form", "local", "--vtk-every", "3", *back]) == 0
    assert [len(list((out / "fclib" / form).iterdir())) for form in ("global", "local")] == [2, 3]
    assert len(list((out / "vtk").glob("blocks_*"))) == 1
    assert not json.loads((out / "run.json").read_text())["options"]["export_iterations"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--set", "height=1"], "has the parameters size"),
        (["--set", "E=stiff"], "expects a number"),
        (["--set", "E"], "expected NAME=VALUE"),
        (["--solver", "NSN-XX"], "solver 'NSN-XX': expected one of auto, NSN-AC"),
        (["--tol", "-1"], "tol: expected a number > 0"),
        (["--steps", "-1"], "steps: expected"),
        (["--vtk-every", "-1"], "vtk-every: expected"),
        (["--resume"], "found no run.json"),
    ],
)
def test_bad_input_is_one_line_and_code_two(
    case_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert main(["run", str(case_folder), "--out", str(tmp_path / "out"), *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("fcsim: ") and message in captured.err and captured.err.count("\n") == 1
    assert captured.out == ""
    assert not (tmp_path / "out").exists()


def test_missing_case_and_foreign_folder(case_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", str(tmp_path / "nothing"), "--out", str(tmp_path / "out")]) == 2
    assert "nothing" in capsys.readouterr().err
    assert main(["run", str(case_folder), "--out", str(case_folder)]) == 2
    assert "found two_blocks.py\n" in capsys.readouterr().err
    assert main(["run", str(case_folder), "--out", "/dev/null/out"]) == 2
    assert capsys.readouterr().err.startswith("fcsim: ")


def test_existing_run(case_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = ["run", str(case_folder), "--out", str(tmp_path / "out"), "--steps", "2", *QUIET]
    assert main(run) == 0
    assert main(run) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert main([*run, "--overwrite"]) == 0


def test_unconverged_run_has_code_one(case_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        main(["run", str(case_folder), "--out", str(tmp_path / "out"), *QUIET, "--set", "max_iterations=0", "--set", "fallback=off"]) == 1
    )
    assert json.loads((tmp_path / "out" / "run.json").read_text())["status"] == "not converged"
    assert "did not converge" in capsys.readouterr().out


def test_fallback_is_reported(case_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", str(case_folder), "--out", str(tmp_path / "out"), *QUIET, "--set", "max_iterations=0"]) == 0
    captured = capsys.readouterr()
    assert "fallback chain used (NSN-AC from previous steps: maximum number of iterations reached" in " ".join(captured.err.split())
    with (tmp_path / "out" / "steps.csv").open(newline="") as file:
        assert max(int(row["attempts"]) for row in csv.DictReader(file)) >= 2


def test_parameters_are_listed(case_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", str(case_folder), "--parameters"]) == 0
    listed = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert listed["E"] == "10000000.0" and listed["divisions"] == "(2, 2, 1)"


def test_parameters_are_listed_with_what_they_are(case_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`tilt 0.0` of a model of blocks did not say that it is degrees a second."""
    script, head = case_folder / "two_blocks.py", "class Parameters:\n"
    text = script.read_text(encoding="utf-8")
    script.write_text(text.replace(head, head + '    """E: stiffness [Pa]\n    of both."""\n', 1), encoding="utf-8")
    assert main(["run", str(case_folder), "--parameters"]) == 0
    assert capsys.readouterr().out.endswith("\n\nE: stiffness [Pa]\nof both.\n")
    assert main(["run", str(case_folder), "--parameters", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["about"] == "E: stiffness [Pa]\nof both."


def test_solve_prints_json(problem_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    content = read_fclib(problem_file)
    problem = content.problem
    assert isinstance(problem, GlobalProblem)
    for arguments in ([], ["--solver", "NSGS-AC"], ["--start", "guess"], ["--start", "solution"]):
        assert main(["solve", str(problem_file), "--json", *arguments]) == 0
        answer = json.loads(capsys.readouterr().out)
        assert {"status", "error", "iterations", "seconds", "nc", "n"} <= set(answer)
        assert answer["status"] == "SOLVED" and answer["error"] <= 1e-8 == answer["tol"]
        assert (answer["nc"], answer["n"], answer["dimension"], answer["form"]) == (problem.nc, problem.n, 3, "global")
        assert answer["seconds"] == pytest.approx(sum(answer["seconds_by_phase"].values()))
    local = next((problem_file.parents[1] / "local").iterdir())
    assert main(["solve", str(local), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert (answer["form"], answer["n"], answer["checks"]["momentum"]) == ("local", problem.m, None)


def test_unsolved_problem_has_code_one(problem_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["solve", str(problem_file), "--json", "--set", "max_iterations=0"]) == 1
    answer = json.loads(capsys.readouterr().out)
    assert (answer["status"], answer["iterations"], answer["message"]) == ("MAX_ITERATIONS", 0, "")
    assert main(["solve", str(problem_file), "--set", "max_iterations=0"]) == 1
    assert "maximum number of iterations reached" in capsys.readouterr().out


def test_remarks_are_in_json_and_a_floor_says_what_is_rest(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One mass far from closing outweighs one that falls; and with a floor far above ||q|| r = 0 is the answer."""
    q = np.array([1e9, 0, 0, -1.0, 0.1, 0])
    write_fclib(tmp_path / "far.hdf5", LocalProblem(np.eye(6), q, np.full(2, 0.5)))
    assert main(["solve", str(tmp_path / "far.hdf5"), "--json"]) == 0
    assert "outweigh" in json.loads(capsys.readouterr().out)["message"]
    write_fclib(tmp_path / "rest.hdf5", LocalProblem(np.eye(3), np.array([-1e-12, 0, 0]), np.array([0.5])))
    written = tmp_path / "solved.hdf5"
    assert main(["solve", str(tmp_path / "rest.hdf5"), "--floor", "1e-3", "--write-solution", str(written)]) == 0
    solution = read_fclib(written).solution
    assert solution is not None and not solution.r.any()


def test_written_solution_is_one(problem_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Checked with M from the file alone, then described and taken as the starting point."""
    solved = tmp_path / "solved.hdf5"
    assert main(["solve", str(problem_file), "--tol", "1e-10", "--write-solution", str(solved)]) == 0
    content = read_fclib(solved)
    p, s = content.problem, content.solution
    assert isinstance(p, GlobalProblem) and s is not None and s.v is not None
    assert np.abs(p.M @ s.v - p.H @ s.r - p.f).max() <= 1e-10 * np.abs(p.f).max()
    q = p.w + p.H.T @ np.linalg.solve(p.M.toarray(), p.f)
    assert natural_map_residual(s.r, p.H.T @ s.v + p.w, p.mu) <= 1e-9 * np.linalg.norm(q)
    capsys.readouterr()
    assert main(["info", str(solved)]) == 0
    described = capsys.readouterr().out
    assert f"contacts     {p.nc} in 3D: {p.m} local unknowns, {p.n} degrees of freedom" in described
    assert "mu from 0.3 to 0.3" in described and "solution     stored, error" in described
    assert main(["solve", str(solved), "--start", "solution", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["iterations"] == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--solver", "NSN-XX"], "expected one of auto, NSN-AC"),
        (["--tol", "0"], "tol: expected"),
        (["--solver", "NSN-AC", "--set", "rho=best"], "option rho: expected one of"),
        (["--set", "max_iterations=many"], "expects a value of type int"),
        (["--set", "iterations=3"], "option 'iterations': expected one of"),
        (["--write-solution", "/nowhere/x.hdf5"], "expected an existing folder"),
        (["--write-solution", "/"], "expected a file to write, found a folder"),
        (["--floor", "-1"], "floor: expected a number >= 0"),
    ],
)
def test_solve_refuses(problem_file: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str) -> None:
    capsys.readouterr()
    assert main(["solve", str(problem_file), *arguments]) == 2
    captured = capsys.readouterr()
    assert message in captured.err and captured.err.startswith("fcsim: ")


def test_a_singular_matrix_is_told_by_its_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    H, f = sp.eye_array(3, format="csc"), np.array([-1.0, 0.0, 0.0])
    file = write_fclib(tmp_path / "a.hdf5", GlobalProblem(sp.csc_array(np.diag([1.0, 1.0, 0.0])), H, f, np.zeros(3), np.array([0.3])))
    assert main(["solve", str(file)]) == 2
    assert capsys.readouterr().err.startswith(f"fcsim: {file}: its equations of motion cannot be solved: M is singular")


def test_the_answer_is_told_before_a_full_disk_refuses_the_solution(
    problem_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, *_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr("fcsim.export_fclib.write_fclib", full)
    capsys.readouterr()
    assert main(["solve", str(problem_file), "--write-solution", str(tmp_path / "solved.hdf5")]) == 2
    said = capsys.readouterr()
    assert "solved; scaled error" in said.out and "written" not in said.out
    assert said.err == f"fcsim: {tmp_path / 'solved.hdf5'}: No space left on device\n"


@pytest.mark.parametrize("link", ["", "symbolic", "hard"])
def test_the_problem_itself_is_not_replaced_by_its_solution(problem_file: Path, capsys: pytest.CaptureFixture[str], link: str) -> None:
    before, target = problem_file.read_bytes(), problem_file
    if link:
        target = problem_file.with_name(f"{link}.hdf5")
        (target.symlink_to if link == "symbolic" else target.hardlink_to)(problem_file)
    capsys.readouterr()
    assert main(["solve", str(problem_file), "--write-solution", str(target)]) == 2
    assert "expected another file than the problem's own" in capsys.readouterr().err
    assert problem_file.read_bytes() == before


def test_files_that_are_no_problem(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "text.hdf5").write_text("no HDF5")
    for command in ("solve", "info"):
        for name in ("text.hdf5", "missing.hdf5"):
            assert main([command, str(tmp_path / name)]) == 2
            assert name in capsys.readouterr().err


def test_solvers_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["solvers"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert {line.split()[0] for line in lines[1:-1] if not line.startswith(" ")} == set(SOLVERS)
    assert all(len(line) <= 140 for line in lines)
    shown = " ".join(line.strip() for line in lines)
    assert all(f"alias: {name}" in shown for name in ALIASES)
    assert "stages=100 nsgs then 200 newton" in shown


def test_version_and_wrong_commands(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["--version"])
    assert stop.value.code == 0 and capsys.readouterr().out == f"fcsim {__version__}\n"
    for arguments in ([], ["walk"], ["run"], ["run", "x", "--steps", "many"]):
        with pytest.raises(SystemExit) as stop:
            main(arguments)
        assert stop.value.code == 2
    for arguments, said in (
        (["run", "x", "--steps", "1e3"], "argument --steps: expected a whole number, such as 1000, got '1e3'"),
        (["solve", "x", "--tol", "1e-"], "argument --tol: expected a number, such as 1e-8, got '1e-'"),
        (["collection", "select", "x", "--count", "ten"], "argument --count: expected a whole number, such as 1000, got 'ten'"),
    ):
        with pytest.raises(SystemExit):
            main(arguments)
        assert said in capsys.readouterr().err


def in_a_process(*command: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run([sys.executable, *command], cwd=cwd, env=environment, capture_output=True, text=True, timeout=120)


def test_the_wall_is_an_ordinary_script(tmp_path: Path) -> None:
    script = ROOT / "cases" / "masonry_wall" / "masonry_wall.py"
    done = in_a_process(str(script), "--steps", "2", "--out", "wall", "--export-every", "1", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "finished: 2 steps" in done.stdout
    files = sorted((tmp_path / "wall" / "fclib" / "global").iterdir())
    assert [read_fclib(path).problem.nc for path in files] == [688, 688]
    assert all(path.name.startswith("FCSIM_LowWall_FEM-i") for path in files)


def test_a_reader_that_leaves_early_is_no_error(tmp_path: Path) -> None:
    """fcsim solvers | head -1"""
    command = f"{sys.executable} -m fcsim.command_line.main solvers | head -1; exit ${{PIPESTATUS[0]}}"
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(["bash", "-c", command], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")


def test_an_option_that_the_case_has_no_parameter_for_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It said "--set solver=...", which nobody had given."""
    script = tmp_path / "mine.py"
    fields = "@dataclass(frozen=True)\nclass Parameters:\n    steps: int = 1\n"
    script.write_text(f"from dataclasses import dataclass\n\n\n{fields}\n\ndef build(p):\n    return None\n")
    for option, value in (("--solver", "auto"), ("--tol", "0.001")):
        assert main(["run", str(script), option, value, "--out", str(tmp_path / "out")]) == 2
        expected = f"fcsim: {option} {value}: case mine has no parameter {option[2:]} that it could set, but steps;"
        assert expected in capsys.readouterr().err


def test_a_stored_solution_with_rolling_friction_is_judged(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A sphere dropped on a plane: r_N = 1 stops a unit mass; half of that leaves half of its velocity, of which errors are shares."""
    H = np.zeros((6, 5))
    H[:3, :3] = [[0, 1, 0], [0, 0, 1], [1, 0, 0]]
    H[3:5, 3:] = np.eye(2)
    problem = GlobalRollingProblem(np.eye(6), H, np.array([0, 0, -1.0, 0, 0, 0]), np.zeros(5), np.array([0.5]), np.array([0.1]))
    for share, error in ((1.0, "0.000e+00"), (0.5, "5.000e-01")):
        r = np.array([share, 0, 0, 0, 0])
        u = np.array([share - 1.0, 0, 0, 0, 0])
        v = np.array([0, 0, share - 1.0, 0, 0, 0])
        path = write_fclib(tmp_path / f"{share}.hdf5", problem, solution=Solution(u, r, v))
        assert main(["info", str(path)]) == 0
        assert f"solution     stored, error {error} (published: {error})" in capsys.readouterr().out


def test_info_says_where_the_stored_u_is_not_that_of_the_stored_r(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """W = 1, q = (-1, 0, 0), r = (1, 0, 0): u = 0; with (0, 3, 4) the file contradicts itself by 5 |q|, though r is an answer."""
    problem = LocalProblem(np.eye(3), np.array([-1.0, 0.0, 0.0]), np.array([0.3]))
    for u, said in ((np.zeros(3), False), (np.array([0.0, 3.0, 4.0]), True)):
        path = tmp_path / f"{said}.hdf5"
        write_fclib(path, problem, solution=Solution(u=u, r=np.array([1.0, 0.0, 0.0])))
        assert main(["info", str(path)]) == 0
        assert ("the stored u is another one than that of the stored r, by 5.0e+00 |q|" in capsys.readouterr().out) is said


@pytest.mark.parametrize("command", ["bench", "profile", "collection"])
def test_a_file_in_the_place_of_a_folder_is_named(tmp_path: Path, command: str, capsys: pytest.CaptureFixture[str]) -> None:
    """It was "[Errno 17] File exists" or "[Errno 20] Not a directory"."""
    problem, file = tmp_path / "set" / "one.hdf5", tmp_path / "file"
    problem.parent.mkdir()
    write_fclib(problem, LocalProblem(np.eye(3), np.array([-1.0, 0.1, 0.0]), np.array([0.5])))
    file.write_text("something else")
    measured = tmp_path / "measured"
    before = ["bench", str(problem.parent), "--solvers", "NSGS-AC", "--tols", "1e-2", "--out", str(measured)]
    asked = {
        "bench": [*before[:-1], str(file)],
        "profile": ["profile", str(measured), "--out", str(file)],
        "collection": ["collection", "select", str(problem.parent), "--out", str(file / "set")],
    }[command]
    if command == "profile":
        assert main(before) == 0
    assert main(asked) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert str(file) in said and "expected a folder to write into, found a file there or above it" in said
    assert file.read_text() == "something else"


def _leaves(parser: argparse.ArgumentParser, name: str = "fcsim") -> Iterator[tuple[str, argparse.ArgumentParser]]:
    below = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    for action in below:
        for word, command in action.choices.items():
            yield from _leaves(command, f"{name} {word}")
    if not below:
        yield name, parser


def test_every_option_says_what_it_does_and_what_it_is_by_default() -> None:
    commands = dict(_leaves(_parser()))
    assert len(commands) > 20
    for name, command in commands.items():
        for action in command._actions:
            assert action.help, f"{name} {action.dest}"
            has_one = action.option_strings and action.nargs != 0 and action.default not in (None, [], argparse.SUPPRESS)
            assert not has_one or "default" in action.help, f"{name} {action.option_strings[0]} does not say that {action.default} is taken"


def test_what_the_system_refuses_is_said_in_words(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """It was "[Errno 13] Permission denied: 'results'"."""
    for number, said in (
        (13, "results: expected a place that this user may read and write, got: Permission denied"),
        (28, "results: No space"),
    ):

        def refused(*_: object, number: int = number, **__: object) -> None:
            raise OSError(number, os.strerror(number), "results")

        monkeypatch.setattr(Path, "mkdir", refused)
        assert main(["new", "mine"]) == 2
        error = capsys.readouterr().err
        assert said in error and "Errno" not in error


def test_memory_that_is_not_there_is_said_in_words(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def takes_all(options: object) -> int:
        raise MemoryError("Unable to allocate 7.28 TiB")

    monkeypatch.setattr("fcsim.command_line.info._info", takes_all)
    assert main(["info", "a.hdf5"]) == 2
    assert "memory: expected more of it than is free (Unable to allocate 7.28 TiB)" in capsys.readouterr().err


def test_a_full_disk_is_told_of_by_the_file_that_was_to_be_written(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    """Of a copy the file that was read was named."""

    def full(options: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device", "read.hdf5", None, "written.hdf5")

    monkeypatch.setattr("fcsim.command_line.info._info", full)
    assert main(["info", "read.hdf5"]) == 2
    assert capsys.readouterr().err == "fcsim: written.hdf5: No space left on device\n"
