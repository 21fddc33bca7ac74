"""The measuring scripts: their numbers against direct solves and statics, and that hangs, crashes and false claims are results."""

from __future__ import annotations

import csv
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from fcsim.bench.fclib_problem import FclibProblem
from fcsim.bench.workers import killable, siconos_client, solves
from fcsim.bench.workers.killable import Task, run_killable
from fcsim.export_fclib import GlobalRollingProblem, read_fclib, write_fclib
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.solvers import solve

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
SYSTEM_PYTHON = Path("/usr/bin/python3")


@pytest.fixture
def scripts(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Import a module of the folder benchmarks by its name."""
    monkeypatch.syspath_prepend(BENCHMARKS)
    from importlib import import_module

    def load(name: str) -> ModuleType:
        return import_module(name)

    return load


def sliding_block(mu: float = 0.3) -> GlobalProblem:
    """A point of mass 2 pushed down by 10 and sideways by 5: it slides, r = (10, -3, 0) and u = (0, (5 - 3) / 2, 0)."""
    return GlobalProblem(
        M=2 * sp.eye_array(3, format="csc"), H=sp.eye_array(3, format="csc"), f=np.array([-10.0, 5, 0]), w=np.zeros(3), mu=np.array([mu])
    )


def unsymmetric_local() -> LocalProblem:
    """Three contacts in 3D, contacts 0 and 2 not coupled, W positive definite and not symmetric; one contact of each kind or so."""
    rng = np.random.default_rng(5)
    root = rng.standard_normal((9, 12))
    W = root @ root.T + 4 * np.eye(9)
    W[:3, 6:] = W[6:, :3] = 0
    W[:3, 3:6] += 0.5 * rng.standard_normal((3, 3))
    return LocalProblem(W, np.array([-3.0, 1, 0.5, -2, 0.1, 0, 1, 0.3, 0.2]), np.array([0.2, 0.7, 0.4]))


def run_script(name: str, *arguments: str | Path) -> None:
    done = subprocess.run([sys.executable, BENCHMARKS / name, *arguments], check=False, timeout=300, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_the_judge_knows_the_sliding_block() -> None:
    problem = FclibProblem("block", "global", sliding_block())
    assert problem.scale == pytest.approx(np.hypot(5, 2.5))
    assert problem.error(np.array([10.0, -3, 0])) == pytest.approx(0, abs=1e-15)
    # without reactions u = (-5, 2.5, 0): -(u + g(u)) = (4.25, -2.5, 0) projects on the cone's edge at ((4.25 + 0.75) / 1.09) (1, -0.3)
    assert problem.error(np.zeros(3)) == pytest.approx(5 / 1.09 * np.hypot(1, 0.3) / np.hypot(5, 2.5))
    assert problem.error(np.array([np.nan, 0, 0])) == np.inf


def test_table_says_what_a_direct_solve_says(scripts: Any, tmp_path: Path) -> None:
    problems: dict[str, GlobalProblem | LocalProblem] = {"block": sliding_block(), "unsymmetric": unsymmetric_local()}
    folder = tmp_path / "files"
    folder.mkdir()
    for name, problem in problems.items():
        write_fclib(folder / f"{name}.hdf5", problem)
    eye = sp.eye_array(5, format="csc")
    write_fclib(folder / "rolling.hdf5", GlobalRollingProblem(eye, eye, np.zeros(5), np.zeros(5), np.ones(1), np.ones(1)))
    out = tmp_path / "table.md"
    methods = ["--solver", "NSN-NM", "--solver", "NSGS-AC", "--solver", "2D-LEMKE"]
    arguments = [str(folder), *methods, "--time-limit", "5", "--out", str(out)]
    run_script("solver_table.py", *arguments)
    rows, text = rows_of(out.with_suffix(".csv")), out.read_text(encoding="utf-8")
    assert {(row["problem"], row["method"], float(row["tol"])) for row in rows} == {
        (name, method, tol) for name in problems for method in ("NSN-NM", "NSGS-AC") for tol in (1e-4, 1e-8)
    }
    for row in rows:
        read = read_fclib(folder / f"{row['problem']}.hdf5").problem
        assert isinstance(read, GlobalProblem | LocalProblem)
        direct = solve(read, row["method"], tol=float(row["tol"]), error="published")  # as the table asks
        assert row["solved"] == "True" and row["status"] == "SOLVED"
        assert int(row["iterations"]) == direct.iterations
        assert float(row["error"]) == pytest.approx(direct.error, rel=1e-6, abs=1e-14)
        assert 0 < float(row["seconds"]) < 5
        assert f"({direct.iterations})" in text
    assert "rolling: left out" in text
    assert str(tmp_path) not in text
    # going on with a complete record measures nothing again
    assert scripts("solver_table").main([*arguments, "--resume"]) == 0
    assert rows_of(out.with_suffix(".csv")) == rows


def test_false_claims_are_wrong_not_solved(scripts: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    table = scripts("solver_table")
    problem = FclibProblem("block", "global", sliding_block())

    def claim(*_: Any, **options: Any) -> Any:
        result = solve(sliding_block(mu=0.2), "NSN-NM", tol=options["tol"])  # solved, but another problem
        assert result.solved
        return result

    monkeypatch.setattr(solves, "solve", claim)
    [(_, [row])] = solves.measure(problem, ["NSN-NM"], [1e-8], 5.0)
    assert row["status"] == "SOLVED" and not row["solved"]
    # r = (10, -2, 0), u = (0, 1.5, 0): r - (u + g(u)) = (9.55, -3.5, 0) projects on ((9.55 + 1.05) / 1.09) (1, -0.3)
    edge = (9.55 + 1.05) / 1.09
    assert row["error"] == pytest.approx(np.hypot(10 - edge, 0.3 * edge - 2) / np.hypot(5, 2.5))
    assert table.cell(row).startswith("*WRONG")


def test_hangs_and_crashes_end_their_task_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whose clock stands until a task hangs: how long children take to begin and to end is the machine's."""
    hanging, since = multiprocessing.get_context("fork").Event(), list[float]()

    def clock() -> float:
        if not hanging.is_set():
            return 0.0
        since[:] = since or [time.monotonic()]
        return time.monotonic() - since[0]

    def hangs() -> Iterator[int]:
        yield 1
        hanging.set()
        time.sleep(60)
        yield 2

    def crashes() -> Iterator[int]:
        os.kill(os.getpid(), signal.SIGKILL)
        yield 1

    def leaves() -> Iterator[int]:
        os._exit(7)
        yield 1

    def fails() -> Iterator[int]:
        yield 3
        raise ValueError("no")

    monkeypatch.setattr(killable, "time", SimpleNamespace(monotonic=clock))
    tasks = [Task(f.__name__, f, 0.5 if f is hangs else 60.0) for f in (hangs, crashes, leaves, fails)]
    for jobs in (1, 3):
        hanging.clear()
        since.clear()
        ended = {end.key: (end.items, end.how) for end in run_killable(tasks, jobs, quiet=True)}
        assert ended == {
            "hangs": ([1], "time limit"),
            "crashes": ([], f"killed by signal {int(signal.SIGKILL)}"),
            "leaves": ([], "exit code 7"),
            "fails": ([3], "ValueError: no"),
        }


@pytest.fixture
def siconos() -> None:
    if siconos_client.siconos_version(SYSTEM_PYTHON) is None:
        pytest.skip(f"{SYSTEM_PYTHON} cannot import siconos.numerics")


@pytest.mark.usefixtures("siconos")
def test_siconos_reads_every_storage_as_it_is_meant() -> None:
    local = unsymmetric_local()
    ours = solve(local, "NSN-NM", tol=1e-13).r
    problem = FclibProblem("unsymmetric", "local", local)
    with siconos_client.siconos_on(problem, SYSTEM_PYTHON) as siconos:
        for configuration in (("NSGS", "block"), ("NSGS", "dense"), ("NSGS sparse", "sparse")):
            assert configuration in siconos.configurations
            reply = siconos.request(configuration=configuration[0], storage=configuration[1], tol=1e-13, limit=10.0)
            np.testing.assert_allclose(reply["r"], ours, atol=1e-9)
        cut = siconos.request(configuration="VI_EG", storage="block", tol=0.0, limit=0.3)  # never met: it is ended
        assert cut["status"] == "time limit" and "r" not in cut
    with siconos_client.siconos_on(FclibProblem("block", "global", sliding_block()), SYSTEM_PYTHON) as siconos:
        reply = siconos.request(configuration="GLOBAL NSGS_WR", storage="global", tol=1e-12, limit=10.0)
        np.testing.assert_allclose(reply["r"], [10, -3, 0], atol=1e-9)


@pytest.mark.usefixtures("siconos")
def test_comparison_with_siconos(scripts: Any, tmp_path: Path) -> None:
    write_fclib(tmp_path / "unsymmetric.hdf5", unsymmetric_local())
    out = tmp_path / "against.md"
    arguments = ["--solver", "NSN-NM", "--tol", "1e-6", "--time-limit", "1", "--siconos-python", str(SYSTEM_PYTHON), "--out", str(out)]
    run_script("against_siconos.py", tmp_path / "unsymmetric.hdf5", *arguments)
    rows = rows_of(out.with_suffix(".csv"))
    solved = [row for row in rows if row["solved"] == "True"]
    assert {"fcsim", "siconos"} == {row["program"] for row in solved}
    assert all(float(row["error"]) <= 1.01e-6 for row in solved)
    assert all(float(row["siconos_tol"]) <= 1e-6 for row in solved if row["program"] == "siconos")
    theirs = min(float(row["seconds"]) for row in solved if row["program"] == "siconos")
    [ours] = [float(row["seconds"]) for row in solved if row["program"] == "fcsim"]
    [line] = [line for line in out.read_text(encoding="utf-8").splitlines() if line.startswith("| unsymmetric |")]
    assert line.split("|")[-2].strip() == line.split("|")[-4].strip() == f"{theirs / ours:.2g}"
    assert scripts("against_siconos").main([str(tmp_path / "unsymmetric.hdf5"), *arguments, "--resume"]) == 0
    assert rows_of(out.with_suffix(".csv")) == rows


def test_growth_from_wall_to_wall(scripts: Any, tmp_path: Path) -> None:
    growth = scripts("growth")
    rows = [
        {"contacts": c, "cpu": 2e-3 * c**1.2, "step": 3e-3 * c, "solve": c, "assembly": c, "detection": c, "output": c, "peak_MiB": 400.0}
        for c in (700, 2800, 11000)
    ]
    assert growth.exponents(rows, "cpu") == pytest.approx([1.2, 1.2])
    assert growth.exponents(rows, "peak_MiB") == pytest.approx([0, 0])
    growth.plot(rows, tmp_path / "growth.png")
    assert (tmp_path / "growth.png").stat().st_size > 10_000


def test_growth_measures_a_wall_that_carries_its_weight(scripts: Any) -> None:
    row = scripts("growth").measure(12, 4, output=True)
    assert (row["dofs"], row["contacts"]) == (7212, 688)  # the masonry wall's README
    assert row["error"] <= 1e-4 and row["imbalance"] < 1e-10
    assert row["reaction"] == pytest.approx(1, abs=0.05)  # it still swings
    assert row["output"] > 0 and row["first_output"] > 0
    assert 1.5 < row["output_MB"] < 3  # M of the README's wall: 400 620 entries of 12 bytes, which compression leaves about a third of


def test_auto_on_files_is_measured_with_code_that_is_loaded(scripts: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each file takes its own stages: those of the second were compiled while it was measured."""
    auto = scripts("auto")
    (tmp_path / "set").mkdir()
    for name, problem in {"a": sliding_block(), "b": unsymmetric_local(), "c": sliding_block(0.4)}.items():
        write_fclib(tmp_path / "set" / f"{name}.hdf5", problem)
    solved: list[tuple[str, str, bool]] = []
    measuring: list[bool] = []

    def once(problem: object, method: str, tol: float, limit: float) -> tuple[str, float, int]:
        solved.append((type(problem).__name__, method, bool(measuring)))
        return "SOLVED", 1.0, 1

    def measured(*given: Any) -> tuple[str, float, int]:
        measuring.append(True)
        answer = once(*given)
        measuring.clear()
        return answer

    monkeypatch.setattr(auto, "once", once)
    monkeypatch.setattr(auto, "measured", measured)
    given = SimpleNamespace(out=tmp_path / "out.jsonl", files=[tmp_path / "set"], seeds=[], tols=[1e-8], methods=("NSN-AC",), limit=3.0)
    auto.judge(given, [])
    one = [("auto", True), ("NSN-AC", True)]
    every = [("auto", False), ("NSN-AC", False)]
    assert solved == [
        *(("GlobalProblem", *how) for how in (*every, *one)),
        *(("LocalProblem", *how) for how in (*every, *one)),
        *(("GlobalProblem", *how) for how in (("auto", False), *one)),
    ]
