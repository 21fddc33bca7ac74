"""Graded selections: of problems whose iterations are known, of folders with foreign names, of collections."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from fcsim.collection import Built, check_collection, read_manifest, select_problems
from fcsim.collection.folder import Name, members, parse_name
from fcsim.command_line.main import main
from fcsim.errors import InputError
from fcsim.export_fclib import GlobalRollingProblem, Solution, read_fclib, write_fclib
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.solvers import SOLVERS, Method, Status, solve
from fcsim.solvers.base import Iterate, Monitor, Options


def one_contact(iterations: int) -> LocalProblem:
    """W = I, q = (-1, 0, 0): r = (1, 0, 0) sticks. Its mu tells the made-up method how many iterations to take."""
    return LocalProblem(np.eye(3), np.array([-1.0, 0, 0]), np.array([iterations / 1000]))


def made_up(problem: Any, r: np.ndarray, monitor: Monitor, options: Options) -> Iterate:
    """Takes 1000 mu iterations, and gives up at options.max_iterations."""
    monitor.iterations = round(1000 * problem.mu[0])
    if monitor.iterations > options.max_iterations:
        monitor.iterations = options.max_iterations
        return Iterate(r, Status.MAX_ITERATIONS)
    return Iterate(-problem.q, Status.SOLVED)


@pytest.fixture(autouse=True)
def known_iterations(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SOLVERS, "MADE-UP", Method(made_up, Options(max_iterations=400), "none", "this test"))


def write(path: Path, problem: Any, **more: Any) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    return write_fclib(path, problem, **more)


def test_problems_without_a_delassus_operator_are_left_out(tmp_path: Path) -> None:
    """One file with a singular M ended the whole selection, after all others were solved, without its name."""
    H = sp.csc_array(np.eye(3))
    massless = GlobalProblem(sp.csc_array(np.diag([1.0, 0.0, 1.0])), H, np.array([-1.0, 0, 0]), np.zeros(3), np.array([0.5]))
    mixed = LocalProblem(np.eye(3), -np.ones(3), np.array([0.5]), np.ones((3, 1)), np.zeros((1, 1)), np.ones(1))
    write(tmp_path / "set" / "a.hdf5", massless)
    write(tmp_path / "set" / "b.hdf5", mixed)
    write(tmp_path / "set" / "c.hdf5", one_contact(3))
    selection = select_problems(tmp_path / "set", tmp_path / "out", count=3, solver="auto")
    assert [row.source for row in selection.entries] == ["c.hdf5"]
    assert any(note.startswith("a: left out, M is singular") for note in selection.notes)
    assert any(note.startswith("b: left out, R of 1 equality constraints is singular") for note in selection.notes)


def test_a_grade_that_most_problems_share_is_told(tmp_path: Path) -> None:
    for step, iterations in enumerate((3, 500, 600), 1):
        write(tmp_path / "set" / f"a-i00000-1-0000{step}.hdf5", one_contact(iterations))
    selection = select_problems(tmp_path / "set", tmp_path / "out", count=3, solver="MADE-UP")
    assert any(note.startswith("2 of 3 problems are left unsolved by MADE-UP") for note in selection.notes)


def test_graded(tmp_path: Path) -> None:
    """Steps 1 to 40 with 2, 20 and 200 iterations in turn, one unsolved: the choice, the names, the rows."""
    taken = {step: (2, 20, 200)[step % 3] for step in range(1, 41)} | {17: 500}
    for step, iterations in taken.items():
        write(tmp_path / "set" / f"SET-i00001-1-{step:05d}.hdf5", one_contact(iterations))
    selection = select_problems(tmp_path / "set", tmp_path / "out", count=9, solver="MADE-UP")
    assert [g.iterations for g in selection.graded] == [min(k, 400) for k in taken.values()]
    rows = read_manifest(tmp_path / "out")
    assert rows == list(selection.entries) and len(rows) == 9
    found = {row.step: row for row in rows}
    assert found[17].status == "MAX_ITERATIONS" and found[17].iterations == 400
    shares = [sum(row.iterations == k for row in rows) for k in (2, 20, 200)]
    assert sum(shares) == 8 and min(shares) == 2  # two and a remainder for each of four classes, the unsolved one holds a single problem
    for step, row in found.items():
        expected = min(taken[step], 400)
        assert row.name == f"SET-i{expected:05d}-1-{step:05d}.hdf5" and row.iterations == expected
        assert (row.solver, row.tol, row.form, row.source) == ("MADE-UP", 1e-8, "local", f"SET-i00001-1-{step:05d}.hdf5")
        assert (tmp_path / "out" / row.place).read_bytes() == (tmp_path / "set" / row.source).read_bytes()
        assert (row.rank, row.condition, row.n, row.error) == (3, 1.0, None, None)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "README.md", "distributions.png", "local", "manifest.csv", "selection.png",
    }  # fmt: skip
    text = (tmp_path / "out" / "README.md").read_text()
    assert "--count 9 --by iterations --solver MADE-UP --tol 1e-08 --time-limit 100 --seed 0" in text
    assert "39 solved" in text and "[2:400], 1 unsolved" in text
    again = select_problems(tmp_path / "set", tmp_path / "again", count=9, solver="MADE-UP")
    assert again.entries == selection.entries


def test_a_collection_of_both_forms(built: Built, tmp_path: Path) -> None:
    """The iterations are those that the method needs from r = 0, found here again; both forms are copied."""
    selection = select_problems(built.directory, tmp_path / "out", count=2, solver="ADMM", tol=1e-6)
    assert (tmp_path / "out" / "picture.png").read_bytes() == (built.directory / "picture.png").read_bytes()
    assert any("r = 0 solves it" in note for note in selection.notes)  # step 1 has no load yet
    assert sorted((e.form, e.step) for e in selection.entries) == [("global", 2), ("global", 3), ("local", 2), ("local", 3)]
    for entry in selection.entries:
        result = solve(read_fclib(tmp_path / "out" / entry.place).problem, "ADMM", tol=1e-6)
        assert result.solved and abs(entry.iterations - result.iterations) <= 1  # W of either form differs by round-off
        assert entry.name == f"FCSIM_LowWall_FEM-i{entry.iterations:05d}-25-{entry.step:05d}.hdf5"
        source = next(e for e in built.entries if e.place == entry.source)
        for name in ("form", "step", "time", "nc", "n", "m", "density", "symmetric", "rank", "condition", "error", "sha256", "fill"):
            assert getattr(entry, name) == getattr(source, name), name
        assert (entry.solver, entry.tol, entry.status) == ("ADMM", 1e-6, "SOLVED")
    assert not any(row.failures for row in check_collection(tmp_path / "out"))


def test_a_foreign_folder(tmp_path: Path) -> None:
    """Names of all kinds, folders in the folder, rolling friction, a broken file, one that r = 0 solves."""
    folder = tmp_path / "theirs"
    zeros = Solution(np.zeros(3), np.zeros(3))  # as real files hold
    for name, iterations in {"Rover1039": 5, "Rover998": 7, "sub/Example_A": 9, "Capsules-i100-12": 3}.items():
        write(folder / f"{name}.hdf5", one_contact(iterations), solution=zeros)
    write(folder / "at_ease.hdf5", LocalProblem(np.eye(3), np.array([1.0, 0, 0]), np.array([0.3])))
    (folder / "broken.hdf5").write_bytes((folder / "Rover1039.hdf5").read_bytes()[:700])
    eye = sp.eye_array(5, format="csc")
    write(folder / "roll.hdf5", GlobalRollingProblem(eye, eye, np.ones(5), np.zeros(5), np.array([0.5]), np.array([0.1])))
    selection = select_problems(folder, tmp_path / "out", count=10, solver="MADE-UP")
    assert {e.name: e.source for e in selection.entries} == {
        "Capsules-i00003-1-00012.hdf5": "Capsules-i100-12.hdf5",
        "Example_A-i00009-1-00000.hdf5": "sub/Example_A.hdf5",
        "Rover-i00005-1-01039.hdf5": "Rover1039.hdf5",
        "Rover-i00007-1-00998.hdf5": "Rover998.hdf5",
    }
    assert [e.error for e in selection.entries] == [1.0] * 4  # r = 0: ||P_K(-q)|| / ||q||
    for left_out, why in {"at_ease": "r = 0 solves it", "broken": "damaged", "roll": "rolling"}.items():
        assert any(note.startswith(f"{left_out}: left out") and why in note for note in selection.notes)
    assert not any(row.failures for row in check_collection(tmp_path / "out"))


def test_two_files_of_one_name(tmp_path: Path) -> None:
    """The same set, step and iterations twice: both are kept apart."""
    write(tmp_path / "in" / "SET-i00008-1-00003.hdf5", one_contact(5))
    write(tmp_path / "in" / "SET-i00009-1-00003.hdf5", one_contact(5))
    selection = select_problems(tmp_path / "in", tmp_path / "out", solver="MADE-UP")
    assert len({e.name for e in selection.entries}) == 2 == len(list((tmp_path / "out" / "local").iterdir()))
    assert {e.source for e in selection.entries} == {"SET-i00008-1-00003.hdf5", "SET-i00009-1-00003.hdf5"}


def test_names_of_any_bytes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A name that is no UTF-8 ended a selection by a UnicodeEncodeError once all was solved; one of two lines was two in tables."""
    for name in ("caf\udce9.hdf5", "two\nlines.hdf5", "\udcff/a b.hdf5", "a b.hdf5", "no\udcff.hdf5"):
        write(tmp_path / "in" / name, one_contact(5))
    (tmp_path / "in" / "no\udcff.hdf5").write_bytes(b"")
    selection = select_problems(tmp_path / "in", tmp_path / "out", solver="MADE-UP")
    assert len(selection.entries) == 4 == len(list((tmp_path / "out" / "local").iterdir()))
    assert not any(row.failures for row in check_collection(tmp_path / "out"))
    assert "no\\udcff: left out" in (tmp_path / "out" / "README.md").read_text(encoding="utf-8")
    assert main(["collection", "check", str(tmp_path / "in")]) == 1
    assert "\ntwo\\nlines.hdf5 " in capsys.readouterr().out


def test_a_parameter_study(tmp_path: Path) -> None:
    """Four folders with files of equal names, as runs with other parameters leave them: no problem is lost, and all is counted."""
    for k, iterations in enumerate((5, 5, 5, 7)):
        write(tmp_path / "in" / f"mu{k}" / "local" / "SET-i00001-1-00003.hdf5", one_contact(iterations))
    write(tmp_path / "in" / "mu0" / "local" / "set-i00001-1-00003.hdf5", one_contact(5))  # differs in capitals alone
    selection = select_problems(tmp_path / "in", tmp_path / "out", solver="MADE-UP")
    files = sorted((tmp_path / "out" / "local").iterdir())
    assert len(files) == 5 == len({path.name.lower() for path in files}) == len(selection.entries)
    assert {(tmp_path / "in" / row.source).read_bytes() == (tmp_path / "out" / row.place).read_bytes() for row in selection.entries} == {
        True
    }
    assert len({row.source for row in selection.entries}) == 5
    readme = (tmp_path / "out" / "README.md").read_text()
    assert readme.startswith("# 5 problems of graded difficulty") and "| number of problems | 5 |" in readme and "5 local" in readme
    assert not any(row.failures for row in check_collection(tmp_path / "out"))


def test_parameters_are_taken_along(built: Built, tmp_path: Path) -> None:
    """From the manifests of collections in the folder, as a parameter study has them."""
    shutil.copytree(built.directory, tmp_path / "in" / "first")
    shutil.copytree(built.directory, tmp_path / "in" / "second")
    selection = select_problems(tmp_path / "in", tmp_path / "out", count=4, solver="NSN-AC", tol=1e-6)
    assert len(selection.entries) == 8
    for entry in read_manifest(tmp_path / "out"):
        parameters = json.loads(entry.parameters)
        assert parameters["courses"] == 1 and parameters["blocks"] == 2 and parameters["E"] == 2.2e9


@pytest.mark.parametrize(
    ("stem", "nc", "name"),
    [
        ("LMGC_LowWall_FEM-i00056-688-00272", 688, Name("LMGC_LowWall_FEM", 56, 272)),
        ("Capsules-i100-1090", 276, Name("Capsules", 100, 1090)),
        ("Capsules-i100-276", 276, Name("Capsules", 100, None)),
        ("spheres-in-a-box-98-i10000-256-10", 256, Name("spheres-in-a-box-98", 10000, 10)),
        ("wall-688-00122", 688, Name("wall", None, 122)),
        ("Rover11035", 1, Name("Rover", None, 11035)),
        ("FC3D_Example1_SBM", 3, Name("FC3D_Example1_SBM")),
        ("CubeH8", 1, Name("CubeH8")),
        ("12345", 1, Name("12345")),
    ],
)
def test_names(stem: str, nc: int, name: Name) -> None:
    assert parse_name(stem, nc) == name


def test_members_of_a_run(tmp_path: Path) -> None:
    for place in ("fclib/global/a-2", "fclib/local/a-2", "fclib/local/a-10", "b", ".b.partial"):
        write(tmp_path / f"{place}.hdf5", one_contact(1))
    found = [(m.stem, [str(p.relative_to(tmp_path)) for p in m.paths]) for m in members(tmp_path)]
    assert found == [
        ("a-2", ["fclib/global/a-2.hdf5", "fclib/local/a-2.hdf5"]),
        ("a-10", ["fclib/local/a-10.hdf5"]),
        ("b", ["b.hdf5"]),
    ]


def test_a_selection_within_its_source_does_not_count_its_own_copies(tmp_path: Path) -> None:
    for k in range(3):
        write(tmp_path / f"p{k}.hdf5", one_contact(5 + k))
    for _ in range(2):
        selection = select_problems(tmp_path, tmp_path / "out", solver="MADE-UP", overwrite=True)
        assert len(selection.graded) == 3


def test_refusals(built: Built, tmp_path: Path) -> None:
    for arguments, message in (
        ({"solver": "NSN"}, "solver 'NSN': expected one of"),
        ({"count": 0}, "count: expected"),
        ({"tol": 0.0}, "tol: expected"),
        ({"time_limit": -1.0}, "time limit: expected"),
        ({"solver": "2D-CPG"}, "none is left"),
    ):
        with pytest.raises(InputError, match=message):
            select_problems(built.directory, tmp_path / "out", **arguments)
    with pytest.raises(InputError, match="apart from"):
        select_problems(built.directory, built.directory, overwrite=True)
    with pytest.raises(InputError, match="holds none"):
        select_problems(tmp_path, tmp_path / "out")
    with pytest.raises(InputError, match="no such folder"):
        select_problems(tmp_path / "nothing", tmp_path / "out")
    assert not (tmp_path / "out").exists()
    shutil.copytree(built.directory, tmp_path / "copy")
    (tmp_path / "copy" / "manifest.csv").write_text("a,b\n")
    with pytest.raises(InputError, match="expected the columns name,form"):
        select_problems(tmp_path / "copy", tmp_path / "out")


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for step in range(1, 6):
        write(tmp_path / "in" / f"S-i00001-1-{step:05d}.hdf5", one_contact(100 * step))
    arguments = ["collection", "select", str(tmp_path / "in"), "--count", "3", "--by", "iterations", "--solver", "MADE-UP"]
    assert main([*arguments, "--out", str(tmp_path / "out")]) == 0
    assert "3 of 5 problems" in capsys.readouterr().out
    assert main([*arguments, "--out", str(tmp_path / "out")]) == 2
    capsys.readouterr()
    assert main([*arguments, "--out", str(tmp_path / "json"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["problems"], told["of"], told["unsolved"], told["collection"]) == (3, 5, 1, str(tmp_path / "json")) and "text" not in told
    assert main(["collection", "check", str(tmp_path / "json"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["failed"] == 0 and [row["nc"] for row in told["files"]] == [1, 1, 1] and "text" not in told
