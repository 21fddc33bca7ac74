"""Building collections: from a case, from a run's folder; whole or not at all."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.collection import Built, build_collection, check_collection, read_manifest
from fcsim.collection.manifest import AT_REST
from fcsim.command_line.main import main
from fcsim.errors import InputError, MissingDependency
from fcsim.export_fclib import FclibFile, read_fclib
from fcsim.running.case import load_case
from fcsim.running.run import RunOptions, run_case

FILES = {"README.md", "distributions.png", "global", "local", "manifest.csv", "picture.png"}


def dense(A: Any) -> np.ndarray:
    return A.toarray()


def contact_error(W: np.ndarray, q: np.ndarray, mu: np.ndarray, r: np.ndarray) -> float:
    """The error of r, contact by contact: distance of r to the projection of r - (u + g(u)) on the cone, over ||q||."""
    u, total = (W @ r + q).reshape(-1, 3), 0.0
    for r_a, u_a, mu_a in zip(r.reshape(-1, 3), u, mu, strict=True):
        z = r_a - u_a - np.array([mu_a * np.hypot(*u_a[1:]), 0, 0])
        t = np.hypot(*z[1:])
        if t <= mu_a * z[0]:
            p = z
        elif mu_a * t <= -z[0]:
            p = np.zeros(3)
        else:
            along = np.array([1, *(mu_a * z[1:] / t)])
            p = along * max(along @ z / (along @ along), 0)
        total += float((r_a - p) @ (r_a - p))
    return float(np.sqrt(total) / np.linalg.norm(q))


def files(built: Built, step: int) -> dict[str, FclibFile]:
    return {e.form: read_fclib(built.directory / e.place) for e in built.entries if e.step == step}


def test_files_of_a_collection(built: Built) -> None:
    assert built.complete
    assert {entry.name for entry in built.directory.iterdir()} == FILES
    assert not list(built.directory.parent.glob(".*"))  # nothing is left of the making
    assert read_manifest(built.directory) == list(built.entries)
    assert len(built.entries) == 6
    # two blocks of 3 x 2 x 2 nodes and two platens of 6 dofs; 6 nodes of each block on each platen, one face centre at the head joint
    n, nc = 2 * 12 * 3 + 2 * 6, 2 * 2 * 6 + 1
    for entry in built.entries:
        assert (entry.n, entry.nc, entry.m, entry.dimension) == (n, nc, 3 * nc, 3)
        assert entry.density == 3 * nc / n
        assert entry.name == f"FCSIM_LowWall_FEM-i{entry.iterations:05d}-{nc}-{entry.step:05d}.hdf5"
        assert entry.time == pytest.approx(1e-3 * entry.step)
        assert (entry.solver, entry.tol, entry.source) == ("NSN-AC", 1e-8, "")
        assert entry.sha256 == hashlib.sha256((built.directory / entry.place).read_bytes()).hexdigest()
    assert sorted((e.form, e.step) for e in built.entries) == [(form, step) for form in ("global", "local") for step in (1, 2, 3)]


@pytest.mark.parametrize("step", [2, 3])
def test_both_forms_are_one_problem(built: Built, step: int) -> None:
    whole, local = files(built, step)["global"], files(built, step)["local"]
    M, H, p = dense(whole.problem.M), dense(whole.problem.H), whole.problem
    W = H.T @ np.linalg.solve(M, H)
    q = p.w + H.T @ np.linalg.solve(M, p.f)
    assert_allclose(dense(local.problem.W), W, atol=1e-12 * np.abs(W).max())
    assert_allclose(local.problem.q, q, atol=1e-10 * np.abs(q).max())
    assert_array_equal(local.problem.mu, p.mu)
    assert_array_equal(local.solution.r, whole.solution.r)
    assert_array_equal(local.solution.u, whole.solution.u)
    assert_array_equal(local.guesses[0].r, whole.guesses[0].r)
    assert local.solution.v is None
    v = np.linalg.solve(M, H @ whole.solution.r + p.f)
    assert_allclose(whole.solution.v, v, atol=1e-10 * np.abs(v).max())

    entry = next(e for e in built.entries if e.step == step and e.form == "local")
    sigma = np.linalg.svd(W, compute_uv=False)
    kept = sigma[sigma > 75 * np.finfo(float).eps * sigma[0]]
    assert (entry.symmetric, entry.rank) == (True, len(kept))
    assert entry.rank == np.linalg.matrix_rank(W) < 75  # 4 blocks' corner nodes on a rigid platen: hyperstatic
    assert entry.condition == pytest.approx(kept[0] / kept[-1], rel=1e-3)
    assert entry.fill == pytest.approx(np.count_nonzero(np.abs(W) > 1e-14 * np.abs(W).max()) / 75**2, rel=0.1)
    judged = contact_error(W, q, p.mu, whole.solution.r)
    for form in ("global", "local"):
        stated = next(e for e in built.entries if e.step == step and e.form == form).error
        assert stated <= 1e-8
        assert stated == pytest.approx(judged, rel=0.05, abs=2e-12)


def test_info_of_the_files(built: Built) -> None:
    info = files(built, 3)["local"].info
    assert info.title == "Masonry wall under compression and shear, step 3"
    for part in ("fcsim 0.", "numpy", '"divisions": [2, 1, 1]', '"beta": 0.05', "seed: none"):
        assert part in info.description
    for part in ("n = 84", "nc = 25", "m/n = 0.8929", "symmetric", "rank 72 of 75", "condition 2.54e+04", "eigenvalues", "error"):
        assert part in info.math_info
    assert files(built, 3)["global"].info.description == info.description


def test_readme(built: Built) -> None:
    text = (built.directory / "README.md").read_text()
    for row in (
        "| authors | A. Mason |",
        "| required accuracy | 1e-08 |",
        "| number of problems | 3 |",
        "| forms | 3 global, 3 local |",
        "| coefficient of friction | [0.53:0.83] |",
        "| degrees of freedom | 84 |",
        "| contacts | 25 |",
        "| contact density m/n | 0.8929 |",
        "| W | symmetric, rank deficient by 3, condition 2.537e+04 |",
        "fcsim collection build cases/masonry_wall --set courses=1 --set blocks=2 --set divisions=2,1,1 --set steps=3 --every 1 --out DIR",
        "![the last step](picture.png)",
        "(distributions.png)",
    ):
        assert row in text
    for name in ("picture.png", "distributions.png"):
        assert (built.directory / name).read_bytes().startswith(b"\x89PNG")


@pytest.fixture
def run(case_folder: Path, tmp_path: Path) -> Callable[..., Path]:
    """Runs of the case two_blocks: 12 steps, FCLIB files of every second."""

    def make(forms: tuple[str, ...] = ("global",), every: int = 2) -> Path:
        out = tmp_path / f"run{len(list(tmp_path.iterdir()))}"
        run_case(load_case(case_folder), {}, out, RunOptions(export_every=every, export_forms=forms, vtk_every=0))
        return out

    return make


def test_from_a_run(run: Callable[..., Path], case_folder: Path, tmp_path: Path, without_pyvista: None) -> None:
    directory = run()
    before = {path: path.read_bytes() for path in directory.rglob("*") if path.is_file()}
    built = build_collection(directory, tmp_path / "out", every=4)
    assert [(e.form, e.step) for e in sorted(built.entries, key=lambda e: (e.form, e.step or 0))] == [
        (form, step) for form in ("global", "local") for step in (4, 8, 12)
    ]
    assert any("VTK" in note for note in built.notes)
    assert {path: path.read_bytes() for path in directory.rglob("*") if path.is_file()} == before
    # the case itself gives the same files, byte by byte
    again = build_collection(case_folder, tmp_path / "again", every=4)
    assert again.entries == built.entries
    text = (tmp_path / "out" / "README.md").read_text()
    assert "fcsim collection build cases/two_blocks --every 4 --out DIR" in text and "](picture.png)" not in text


def test_a_run_with_local_files_only(run: Callable[..., Path], tmp_path: Path) -> None:
    built = build_collection(run(("local",), 6), tmp_path / "out")
    assert [e.form for e in built.entries] == ["local", "local"]
    assert built.entries[0].n is None and built.entries[0].density is None
    assert any("no global form" in note for note in built.notes)


def test_a_run_that_was_not_finished(run: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    directory = run()
    about = json.loads((directory / "run.json").read_text())
    (directory / "run.json").write_text(json.dumps({**about, "status": "not converged", "message": "step 13 did not converge"}))
    assert main(["collection", "build", str(directory), "--out", str(tmp_path / "out")]) == 1
    assert "step 13 did not converge" in capsys.readouterr().out
    assert "step 13 did not converge" in (tmp_path / "out" / "README.md").read_text()
    assert len(read_manifest(tmp_path / "out")) == 12


def test_at_rest(run: Callable[..., Path], tmp_path: Path) -> None:
    """A step that the solver left at r = 0 although the plain error is large."""
    from fcsim.export_fclib import Solution, write_fclib

    directory = run()
    path = next((directory / "fclib" / "global").glob("*-00002.hdf5"))
    problem = read_fclib(path).problem
    zero = np.zeros(problem.m)
    v = np.linalg.solve(dense(problem.M), problem.f)
    write_fclib(path, problem, solution=Solution(problem.H.T @ v + problem.w, zero, v))
    built = build_collection(directory, tmp_path / "out")
    assert {e.step for e in built.entries if e.status == AT_REST} == {2}
    assert any("At rest in step 2" in note for note in built.notes)


def test_refusals(built: Built, run: Callable[..., Path], case_folder: Path, tmp_path: Path) -> None:
    directory = run()
    with pytest.raises(InputError, match="finished run"):
        build_collection(directory, tmp_path / "out", assignments={"steps": "3"})
    with pytest.raises(InputError, match="step that 7 divides, got 2, 4, 6"):
        build_collection(directory, tmp_path / "out", every=7)
    with pytest.raises(InputError, match="every: expected"):
        build_collection(directory, tmp_path / "out", every=0)
    with pytest.raises(InputError, match="two_blocks: expected steps that every = 2 divides"):  # it named a folder that was gone
        build_collection(case_folder, tmp_path / "out", assignments={"steps": "1"}, every=2)
    with pytest.raises(InputError, match="expected a folder NAME"):
        build_collection(tmp_path / "nothing", tmp_path / "out")
    with pytest.raises(InputError, match="--overwrite"):
        build_collection(directory, built.directory)
    with pytest.raises(InputError, match="apart from"):
        build_collection(directory, directory, overwrite=True)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("years of work")
    with pytest.raises(InputError, match=r"found thesis\.tex"):
        build_collection(directory, tmp_path / "mine", overwrite=True)
    assert (tmp_path / "mine" / "thesis.tex").read_text() == "years of work"
    assert not (tmp_path / "out").exists() and not list(tmp_path.glob(".*"))


def test_a_case_is_named_within_the_collection(case_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A case that comes with fcsim stands with fcsim, not in the working directory, which may be the collection's and stays where it is."""
    monkeypatch.setattr("fcsim.running.known_cases.PLACES", (tmp_path,))
    (here := tmp_path / "here").mkdir()
    monkeypatch.chdir(here)
    for overwrite in (False, True):
        built = build_collection(case_folder.name, ".", assignments={"steps": "3"}, pictures=False, every=3, overwrite=overwrite)
        assert len(built.entries) == 2 and here.samefile(".")
        assert not any(row.failures for row in check_collection(here)) and (here / "manifest.csv").is_file()
    assert not list(tmp_path.glob(".*"))


def test_whole_or_not_at_all(run: Callable[..., Path], copy: Path, case_folder: Path, tmp_path: Path) -> None:
    """What stops half-way leaves the earlier collection as it was, and nothing else."""
    directory = run()
    before = {path: path.read_bytes() for path in copy.rglob("*") if path.is_file()}

    def fail(what: str, done: int, total: int) -> None:
        if done == 2:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        build_collection(directory, copy, overwrite=True, progress=fail)

    def interrupt(case: Any, step: Any) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        build_collection(case_folder, copy, overwrite=True, watch=interrupt)
    assert {path: path.read_bytes() for path in copy.rglob("*") if path.is_file()} == before
    assert not list(copy.parent.glob(".*"))
    built = build_collection(directory, copy, overwrite=True)
    assert len(built.entries) == 12
    assert not list(copy.glob("*/FCSIM_LowWall*"))


@pytest.fixture
def without_pyvista(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(*_: Any) -> None:
        raise MissingDependency("pyvista cannot be imported")

    monkeypatch.setattr("fcsim.view.scene.survey", absent)


def test_without_pyvista(case_folder: Path, tmp_path: Path, without_pyvista: None) -> None:
    built = build_collection(case_folder, tmp_path / "out", every=12)
    assert any("No picture: pyvista" in note for note in built.notes)
    assert {e.name for e in (tmp_path / "out").iterdir()} == FILES - {"picture.png"}


def test_command(case_folder: Path, tmp_path: Path, without_pyvista: None, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["collection", "build", str(case_folder), "--steps", "4", "--set", "E=2e7", "--every", "2", "--out", str(tmp_path / "out")]
    assert main(arguments) == 0
    assert "2 problems, 4 files" in capsys.readouterr().out
    assert main(arguments) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert main([*arguments, "--overwrite", "--spectrum-up-to", "0"]) == 0
    assert all(entry.rank is None and entry.condition is None for entry in read_manifest(tmp_path / "out"))
    assert main(["collection", "check", str(tmp_path / "out")]) == 0
