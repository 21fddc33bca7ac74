"""Seeded mutations of every file that fcsim reads: one error of ours, or a right answer; no foreign exception, no false SOLVED.

How many, and with which seed: see conftest.py.
"""

import csv
import io
import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from fcsim.collection import check_collection
from fcsim.collection.manifest import Entry, write_manifest
from fcsim.errors import FcsimError
from fcsim.export_fclib import Solution, read_fclib, write_fclib
from fcsim.files import sha256
from fcsim.problem import GlobalProblem, Judge, LocalProblem
from fcsim.running.case import load_case
from fcsim.running.checkpoint import read_checkpoint
from fcsim.running.folder import open_run
from fcsim.running.run import RunOptions, run_case
from fcsim.solvers import solve

SCALE = float(os.environ.get("FCSIM_FAULTS", "0"))
SEED = int(os.environ.get("FCSIM_FAULTS_SEED", "0"))
Apart = Callable[[Callable[[int], str], int], list[tuple[int, str]]]
Keep = Callable[[Path, str, int], Path]
DATA = Path(__file__).parent / "data"
CASE = Path(__file__).parents[2] / "cases" / "stack"
SOLVERS = ("NSN-AC", "NSGS-AC", "auto")
NUMBERS = (0, 1, -1, 2, 7, 2**31, 2**62, -(2**40), 1e300, -1e300, 1e-300, float("nan"), float("inf"), 0.5, -0.0)


def rng(name: str, number: int) -> np.random.Generator:
    return np.random.default_rng([SEED, number, *name.encode()])


def how_many(few: int, all_of_them: int) -> int:
    return max(few, round(SCALE * all_of_them))


def within(call: Callable[[], Any]) -> Any:
    """What the call returns, None where it refuses; anything else it raises is a fault."""
    try:
        return call()
    except FcsimError as error:
        assert str(error)
        return None


# FCLIB


def small_problems(folder: Path) -> list[Path]:
    rows = np.random.default_rng(3)
    A = rows.standard_normal((6, 6))
    local = LocalProblem(A @ A.T + np.eye(6), rows.standard_normal(6), np.array([0.3, 0.7]))
    H = np.vstack([np.eye(6), np.eye(6)])
    whole = GlobalProblem(M=np.eye(12) * 2, f=rows.standard_normal(12), H=H, w=np.zeros(6), mu=np.array([0.3, 0.7]))
    answers = [Solution(np.zeros(6), np.zeros(6)), Solution(np.zeros(6), np.zeros(6), np.zeros(12))]
    return [write_fclib(folder / f"{k}.hdf5", p, solution=s) for k, (p, s) in enumerate(zip((local, whole), answers, strict=True))]


def datasets(file: h5py.File) -> list[str]:
    names: list[str] = []
    file.visititems(lambda name, entry: names.append(name) if isinstance(entry, h5py.Dataset) else None)
    return names


def mutate_dataset(file: h5py.File, random: np.random.Generator) -> None:
    name = str(random.choice(datasets(file)))
    values = np.asarray(file[name][()])
    kind = random.integers(7)
    del file[name]
    if kind == 0:
        return  # missing
    if kind == 1:
        file.create_group(name)
    elif kind == 2:
        file[name] = np.array([b"text"])
    elif kind == 3:
        file[name] = np.concatenate([np.ravel(values), np.ravel(values)[:1]]) if values.dtype.kind in "fiu" else values
    elif kind == 4:
        file[name] = np.ravel(values)[: max(values.size - 1, 0)]
    elif kind == 5:
        file[name] = np.reshape(values, (1, *values.shape))
    else:
        flat = np.array(np.ravel(values), dtype=np.float64) if values.dtype.kind in "fiu" else np.zeros(1)
        if flat.size:
            flat[random.integers(flat.size)] = random.choice(NUMBERS)
        with np.errstate(invalid="ignore"):
            file[name] = flat.reshape(values.shape if flat.size == values.size else (-1,)).astype(random.choice([np.float64, values.dtype]))


def mutate_bytes(path: Path, random: np.random.Generator) -> None:
    """Some bytes of the file itself, which HDF5 has to make sense of."""
    content = bytearray(path.read_bytes())
    for _ in range(int(random.integers(1, 6))):
        content[int(random.integers(len(content)))] = int(random.integers(256))
    path.write_bytes(content[: int(random.integers(len(content)))] if random.random() < 0.1 else content)


def judged(problem: GlobalProblem | LocalProblem, solver: str) -> tuple[bool, str]:
    """Whether it is said to be solved, and what is wrong with that: the judge's own error is compared up to what friction magnifies
    round-off by, and, of local problems, up to the round-off of u = W r + q itself: an entry of 1e12 (seed1511-18098) leaves of u no more
    than the order of summation does."""
    result = solve(problem, solver, tol=1e-8, time_limit=1.0)
    if not result.solved:
        return False, ""
    error, magnified = Judge(problem).scaled_error(result.r), max(1.0, float(problem.mu.max(initial=0.0)))
    unsure = 1e-12 * magnified
    if isinstance(problem, LocalProblem) and (size := float(np.linalg.norm(problem.q))) > 0:
        sums = abs(problem.W) @ np.abs(result.r) + np.abs(problem.q)
        unsure += magnified * problem.m * np.finfo(float).eps * float(np.linalg.norm(sums)) / size
    return True, "" if error <= 1e-6 + unsure else f"false SOLVED by {solver}: {result.error:.1e} said, {error:.1e} found"


@pytest.mark.filterwarnings("ignore")
def test_fclib_files(tmp_path: Path, apart: Apart, keep: Keep) -> None:
    """Read and solved; SOLVED only where a judge of its own agrees. Every fourth file is changed in its bytes."""
    originals, solved = small_problems(tmp_path), tmp_path / "solved"
    for solver in SOLVERS:  # compiled here, for all children
        solve(read_fclib(originals[0]).problem, solver)

    def file(number: int) -> Path:
        random, path = np.random.default_rng([SEED, number]), tmp_path / f"mutated{number % 2}.hdf5"
        shutil.copyfile(originals[number % 2], path)
        if number % 4 == 3:
            mutate_bytes(path, random)
            return path
        with h5py.File(path, "r+") as content:
            for _ in range(random.integers(1, 3)):
                mutate_dataset(content, random)
        return path

    def case(number: int) -> str:
        content = read_fclib(file(number))
        if not isinstance(content.problem, GlobalProblem | LocalProblem):
            return ""
        is_solved, wrong = judged(content.problem, SOLVERS[number % len(SOLVERS)])
        if is_solved:
            with solved.open("a") as note:
                note.write("x")
        return wrong

    findings = apart(case, how_many(150, 20_000))
    for number, _ in findings:
        keep(file(number), "fclib", number)
    assert not findings
    assert solved.stat().st_size > 10


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("path", sorted(DATA.glob("*.hdf5")), ids=lambda path: path.stem)
@pytest.mark.parametrize("solver", ["NSN-AC", "NSGS-AC", "auto"])
def test_files_that_were_found(path: Path, solver: str) -> None:
    content = within(lambda: read_fclib(path))
    if content is not None:
        found = within(lambda: judged(content.problem, solver))
        assert found is None or not found[1]


# a run's folder


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four steps of the stack of bricks."""
    out = tmp_path_factory.mktemp("run") / "out"
    run_case(load_case(CASE), {"steps": "4"}, out, RunOptions(export_every=0, vtk_every=2, checkpoint_every=2))
    return out


def test_run_json(run: Path, tmp_path: Path, apart: Apart, mutate_json: Any, mutate_text: Any) -> None:
    about = json.loads((run / "run.json").read_text())
    copy = Path(shutil.copytree(run, tmp_path / "copy"))
    script = load_case(CASE)

    def case(number: int) -> str:
        random = rng("run.json", number)
        text = json.dumps(mutate_json(about, random)).encode()
        (copy / "run.json").write_bytes(mutate_text(text, random) if number % 4 == 0 else text)
        within(lambda: open_run(copy))
        if number % 5 == 0:
            within(lambda: run_case(script, {}, copy, resume=True))
        return ""

    assert not apart(case, how_many(150, 3000))


def test_steps_csv(run: Path, tmp_path: Path, apart: Apart, mutate_text: Any) -> None:
    text = (run / "steps.csv").read_bytes()
    copy = Path(shutil.copytree(run, tmp_path / "copy"))
    script = load_case(CASE)

    def case(number: int) -> str:
        (copy / "steps.csv").write_bytes(mutate_text(text, rng("steps.csv", number)))
        within(lambda: open_run(copy))
        if number % 5 == 0:
            within(lambda: run_case(script, {}, copy, resume=True))
        return ""

    assert not apart(case, how_many(150, 3000))


def test_checkpoints(run: Path, tmp_path: Path, apart: Apart) -> None:
    """Every change is found, by its shape or by the checksum."""
    path = tmp_path / "checkpoint.h5"

    def case(number: int) -> str:
        shutil.copyfile(run / "checkpoint.h5", path)
        with h5py.File(path, "r+") as file:
            before = {name: file[name][()] for name in datasets(file)}
            mutate_dataset(file, rng("checkpoint", number))
            after = {name: file[name][()] for name in datasets(file)}
        same = before.keys() == after.keys() and all(
            before[n].dtype == after[n].dtype and before[n].tobytes() == after[n].tobytes() and before[n].shape == after[n].shape
            for n in before
        )
        return "" if same or within(lambda: read_checkpoint(path)) is None else "a changed checkpoint is read"

    assert not apart(case, how_many(100, 2000))


def test_manifests(tmp_path: Path, apart: Apart, values: tuple[Any, ...], mutate_text: Any) -> None:
    """Read, and every path in it kept within the folder."""
    (tmp_path / "secret.hdf5").write_bytes(b"x")
    folder = tmp_path / "collection"
    (folder / "local").mkdir(parents=True)
    problem = LocalProblem(np.eye(3), np.array([-1.0, 0, 0]), np.array([0.3]))
    name = "SET-i00001-1-00001.hdf5"
    path = write_fclib(folder / "local" / name, problem, solution=Solution(np.zeros(3), np.array([1.0, 0, 0])))
    known = {"rank": 3, "condition": 1.0, "solver": "NSN-AC", "iterations": 1, "error": 0.0, "sha256": sha256(path), "status": "SOLVED"}
    sizes = {"nc": 1, "n": None, "m": 3, "density": None, "symmetric": True, "tol": 1e-8, "fill": 1.0, "dimension": 3, "source": ""}
    write_manifest(folder, [Entry(name=name, form="local", step=1, time=None, **known, **sizes)])
    assert not any(row.failures for row in check_collection(folder))
    text = (folder / "manifest.csv").read_bytes()
    header, row = list(csv.reader(io.StringIO(text.decode())))
    texts = [str(value).replace("\ud800", "") for value in values]

    def case(number: int) -> str:
        random = rng("manifest", number)
        if number % 2:
            (folder / "manifest.csv").write_bytes(mutate_text(text, random))
        else:
            changed = list(row)
            changed[int(random.integers(len(row)))] = texts[int(random.integers(len(texts)))]
            with (folder / "manifest.csv").open("w", newline="") as file:
                csv.writer(file, lineterminator="\n").writerows([header, changed])
        rows = within(lambda: check_collection(folder))
        outside = [r.place for r in rows or () if not (folder / r.place).resolve().is_relative_to(folder.resolve())]
        return f"places outside: {outside}" if outside else ""

    assert not apart(case, how_many(150, 3000))
