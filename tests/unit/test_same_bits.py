"""The same bits on one thread and on several, and what a run's files are when they are written beside the next step."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from fcsim.linear.block_rows import BLOCKS_A_PIECE, product_by_rows
from fcsim.linear.products import product, times, transposed_times
from fcsim.problem import LocalProblem, delassus_sum
from fcsim.problem.delassus_sum import DelassusSum
from fcsim.running.case import load_case
from fcsim.running.outputs import RunOptions
from fcsim.running.run import run_case
from fcsim.running.vtk_series import SeriesWriter
from fcsim.runtime import threads
from fcsim.solvers import solve
from fcsim.threads import tasks

ROOT = Path(__file__).parents[2]
BODIES, JOINT = 8, 50


def _read_anew() -> None:
    threads.cache_clear()
    tasks._before_a_fork()
    tasks._making.release()


@pytest.fixture
def on(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[int], None]]:
    """Compute on so many threads from now on, whatever this machine has."""

    def compute_on(count: int) -> None:
        monkeypatch.setenv("FCSIM_THREADS", str(count))
        _read_anew()

    yield compute_on
    monkeypatch.undo()
    _read_anew()


def chain() -> tuple[sp.csc_array, list[np.ndarray]]:
    """H of joints of contacts between bodies in a row, on the unknowns of the bodies' surfaces, and the bodies' compliances."""
    rng = np.random.default_rng(3)
    k, m = 6 * JOINT, 3 * JOINT * (BODIES - 1)
    H = sp.lil_array((BODIES * k, m))
    for j in range(BODIES - 1):
        for i in range(3 * JOINT):
            H[j * k + 3 * JOINT + i, 3 * JOINT * j + i] = -1
            H[(j + 1) * k + i, 3 * JOINT * j + i] = 1
    compliances = []
    for _ in range(BODIES):
        A = rng.standard_normal((k, k)) / np.sqrt(k)
        compliances.append(A @ A.T + 0.1 * np.eye(k))
    return sp.csc_array(H), compliances


def summed() -> sp.bsr_array:
    """W of the chain."""
    H, compliances = chain()
    k = 6 * JOINT
    W = DelassusSum(H, np.repeat(np.arange(BODIES), k), np.tile(np.arange(k), BODIES), BODIES, 3)
    W.add(0, np.stack(compliances), np.arange(BODIES))
    return W.matrix()


def test_w_is_the_sum_of_the_bodies_shares_whatever_the_threads(on: Callable[[int], None]) -> None:
    on(1)
    alone = summed()
    on(3)
    together = summed()
    H, compliances = chain()
    assert len(alone.indices) > 2 * BLOCKS_A_PIECE  # large enough to be cut
    np.testing.assert_allclose(together.toarray(), (H.T @ sp.block_diag([sp.csr_array(C) for C in compliances]) @ H).toarray(), atol=1e-12)
    assert alone.data.tobytes() == together.data.tobytes()


def test_products_are_right_whatever_the_threads(on: Callable[[int], None]) -> None:
    on(1)
    W, rng = summed(), np.random.default_rng(5)
    q, r = rng.standard_normal((2, W.shape[0]))
    A, B = rng.standard_normal((1700, 1300)).astype(np.float32), rng.standard_normal((1300, 40)).astype(np.float32)
    x, y = rng.standard_normal(1300).astype(np.float32), rng.standard_normal(1700).astype(np.float32)

    def all_of_them() -> list[np.ndarray]:
        C = np.empty((1700, 40), dtype=np.float32)
        product(A, B, C)
        return [product_by_rows(W, q, r), times(A, x), transposed_times(A, y), C]

    alone = all_of_them()
    on(3)
    for one, other, expected in zip(alone, all_of_them(), (W @ r + q, A @ x, A.T @ y, A @ B), strict=True):
        np.testing.assert_allclose(other, expected, rtol=1e-3 if other.dtype == np.float32 else 1e-10, atol=1e-3)
        assert one.tobytes() == other.tobytes()


def test_threads_that_begin_at_once_add_to_one_sum(on: Callable[[int], None], monkeypatch: pytest.MonkeyPatch) -> None:
    """Whose entries are made slowly, as in memory that the system has to find first: else a thread made its own and lost what it held."""

    class SlowZeros:
        def __getattr__(self, name: str) -> Any:
            return getattr(np, name)

        def zeros(self, *arguments: Any) -> np.ndarray:
            time.sleep(0.05)
            return np.zeros(*arguments)

    on(4)
    rng, bodies, size = np.random.default_rng(0), 8, 6
    H = sp.csc_array(sp.block_diag([rng.standard_normal((size, 6)) for _ in range(bodies)]))
    body, column = np.divmod(np.arange(bodies * size), size)
    C = rng.standard_normal((bodies, size, size))
    C = C + C.transpose(0, 2, 1)
    monkeypatch.setattr(delassus_sum, "WORK_A_PIECE", 1)
    monkeypatch.setattr(delassus_sum, "np", SlowZeros())
    W = DelassusSum(H, body, column, bodies, 3)
    W.add(0, C, np.arange(bodies))
    found, expected = W.matrix(), H.toarray().T @ sp.block_diag(list(C)).toarray() @ H.toarray()
    np.testing.assert_allclose(found.toarray() if sp.issparse(found) else found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


MADE_TWICE = """
import functools, os, time

class Slow(functools.cached_property):
    def __get__(self, instance, owner=None):
        if instance is None or self.attrname in instance.__dict__:
            return self if instance is None else instance.__dict__[self.attrname]
        time.sleep(0.002)
        value = self.func(instance)
        if self.attrname in instance.__dict__:
            with open(os.environ["MADE_TWICE"], "a") as log:
                print(type(instance).__qualname__, self.attrname, file=log)
        instance.__dict__[self.attrname] = value
        return value

functools.cached_property = Slow
"""


def test_no_property_is_made_twice_by_two_threads(tmp_path: Path) -> None:
    """However long they take: the wall's steps on three threads with its files beside them. Who adds to such a value would lose it."""
    (tmp_path / "sitecustomize.py").write_text(MADE_TWICE)
    log = tmp_path / "twice.txt"
    path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = {**os.environ, "FCSIM_THREADS": "3", "PYTHONPATH": path, "MADE_TWICE": str(log)}
    given = ["--set", "steps=4", "--export-every", "1", "--out", str(tmp_path / "out")]
    command = [sys.executable, "-m", "fcsim", "run", str(ROOT / "cases" / "masonry_wall"), *given]
    ended = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300, cwd=ROOT)
    assert ended.returncode == 0, ended.stderr[-2000:]
    assert not log.exists(), log.read_text()


@pytest.mark.parametrize(("solver", "limit"), [("NSN-AC", 30), ("ADMM", 60), ("NSGS-AC", 15), ("auto", 0)])
def test_solvers_find_the_same_bits(on: Callable[[int], None], solver: str, limit: int) -> None:
    on(1)
    W, rng = summed(), np.random.default_rng(7)
    q = rng.standard_normal(W.shape[0])
    q[::3] -= 0.5
    options = {"max_iterations": limit} if limit else {}
    found = []
    for count in (1, 3):
        on(count)
        found.append(solve(LocalProblem(W, q, np.full(len(q) // 3, 0.6)), solver, tol=1e-7, **options))
    assert found[0].r.any() and found[0].r.tobytes() == found[1].r.tobytes() and found[0].u.tobytes() == found[1].u.tobytes()
    assert found[0].iterations == found[1].iterations


@pytest.mark.parametrize("count", [1, 2])
def test_an_error_of_a_step_s_files_ends_the_run(
    on: Callable[[int], None], count: int, case_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With its message, and whole files of the steps before, as where nothing is beside."""
    on(count)
    write = SeriesWriter.write

    def fail(self: SeriesWriter, step: object) -> None:
        if step.number == 4:  # type: ignore[attr-defined]
            raise ValueError("no such thing can be drawn")
        write(self, step)  # type: ignore[arg-type]

    monkeypatch.setattr(SeriesWriter, "write", fail)
    out = tmp_path / "out"
    with pytest.raises(ValueError, match="no such thing can be drawn"):
        run_case(load_case(case_folder), {"steps": "8"}, out, RunOptions(export_every=1, vtk_every=1, checkpoint_every=1))
    about = json.loads((out / "run.json").read_text())
    assert (about["status"], about["steps_done"], about["threads"]) == ("failed", 3, count)
    assert "no such thing can be drawn" in about["message"]
    assert [line.split(",")[0] for line in (out / "steps.csv").read_text().splitlines()] == ["step", "1", "2", "3"]
    monkeypatch.setattr(SeriesWriter, "write", write)
    summary = run_case(load_case(case_folder), {}, out, RunOptions(export_every=1, vtk_every=1, checkpoint_every=1), resume=True)
    assert summary.converged and summary.steps == 8 and summary.computed == 5
    assert len(list((out / "fclib" / "global").iterdir())) == 8 and not list(out.rglob("*.partial*"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "given"),
    [
        ("masonry_wall", ("steps=20",)),
        ("granular", ("steps=30",)),
        ("boxes", ("steps=20",)),
        ("rocks", ("steps=20",)),
    ],
)
def test_runs_are_the_same_bits(case: str, given: tuple[str, ...], tmp_path: Path) -> None:
    """In processes of their own: every FCLIB file, and every column of the table but the seconds."""
    for count in (1, 2):
        command = [
            sys.executable,
            "-m",
            "fcsim",
            "run",
            str(ROOT / "cases" / case),
            "--out",
            str(tmp_path / str(count)),
            "--export-every",
            "5",
        ]
        command += [part for assignment in given for part in ("--set", assignment)]
        environment = {**os.environ, "FCSIM_THREADS": str(count)}
        ended = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=900, cwd=ROOT)
        assert ended.returncode == 0, ended.stderr[-2000:]
    files = sorted(path.relative_to(tmp_path / "1") for path in (tmp_path / "1" / "fclib").rglob("*.hdf5"))
    assert len(files) >= 3
    assert files == sorted(path.relative_to(tmp_path / "2") for path in (tmp_path / "2" / "fclib").rglob("*.hdf5"))
    for path in files:
        assert (tmp_path / "1" / path).read_bytes() == (tmp_path / "2" / path).read_bytes(), path
    tables = []
    for count in (1, 2):
        header, *rows = [line.split(",") for line in (tmp_path / str(count) / "steps.csv").read_text().splitlines()]
        tables.append([[entry for name, entry in zip(header, row, strict=False) if not name.startswith("seconds")] for row in rows])
    assert tables[0] == tables[1]
