"""The process that writes a run's FCLIB files: the bytes of its files, its errors, its end, and that of the run when it is killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

from fcsim.export_fclib import read_fclib
from fcsim.export_fclib.chunks import Compressor
from fcsim.export_fclib.content import Solution
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.running.beside.writing_process import WritingProcess
from fcsim.running.fclib_series import StepFile


@pytest.fixture
def process() -> Iterator[WritingProcess]:
    found = WritingProcess()
    deadline = time.monotonic() + 60
    while not found.ready and time.monotonic() < deadline:
        time.sleep(0.01)
    assert found.ready
    yield found
    found.end()


def step_file(folder: Path, step: int, *, local: bool = False) -> StepFile:
    rng = np.random.default_rng(step)
    n, nc = 300, 20
    H = sp.random_array((n, 3 * nc), density=0.1, rng=rng, format="csr")
    w, mu, r = rng.random(3 * nc), np.full(nc, 0.5), rng.random(3 * nc)
    problem: GlobalProblem | LocalProblem = GlobalProblem(sp.csr_array(sp.eye_array(n)), H, rng.random(n), w, mu)
    answer = Solution(w, r, rng.random(n))
    if local:
        problem, answer = LocalProblem((H.T @ H).toarray(), w, mu), Solution(w, r)
        problem.delassus  # noqa: B018 - derived from W, which no other process is given
    return StepFile(folder, f"SET-i00003-{nc}-{step:05d}.hdf5", f"SET-i*-{step:05d}.hdf5", problem, answer, answer, ("a", "b", "c"))


@pytest.mark.parametrize("local", [False, True])
def test_files_have_the_bytes_that_this_process_writes(process: WritingProcess, tmp_path: Path, local: bool) -> None:
    compressor = Compressor()
    for step in (1, 2):
        here = step_file(tmp_path / "here", step, local=local).write(compressor)
        apart = process.write(step_file(tmp_path / "apart", step, local=local))
        assert apart == tmp_path / "apart" / here.name
        assert apart.read_bytes() == here.read_bytes()
    read_fclib(apart)
    assert "delassus" not in step_file(tmp_path, 1, local=True).bare().problem.__dict__
    (tmp_path / "apart" / "SET-i00009-20-00002.hdf5").touch()  # of an interrupted run
    process.write(step_file(tmp_path / "apart", 2, local=local))
    assert len(list((tmp_path / "apart").iterdir())) == 2


def test_an_error_is_told_and_the_next_file_is_written(process: WritingProcess, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match="file") as caught:
        process.write(step_file(tmp_path / "file" / "global", 1))
    assert isinstance(caught.value, NotADirectoryError)
    assert process.write(step_file(tmp_path / "good", 1)).is_file()


def test_signals_that_end_a_run_leave_it_and_its_death_is_told(process: WritingProcess, tmp_path: Path) -> None:
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        os.kill(process.number, number)
    process.write(step_file(tmp_path, 1))
    os.kill(process.number, signal.SIGKILL)
    with pytest.raises(OSError, match=r"00002\.hdf5: the process that writes FCLIB files has ended \(SIGKILL\)"):
        process.write(step_file(tmp_path, 2))


def test_one_that_cannot_begin_is_never_ready(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fcsim.running.beside.writing_process.COMMAND", "raise SystemExit(3)")
    process = WritingProcess()
    assert process._process.wait(60) == 3
    assert not process.ready
    assert not process.ready
    process.end()


SCRIPT = """
import os, signal, sys, time
from pathlib import Path
from fcsim.running import outputs
from fcsim.running.case import load_case
from fcsim.running.run import RunOptions, run_case

def watch(case, step):
    process = begun[0]
    while step.number == 1 and not process.ready:
        time.sleep(0.01)
    if step.number == 5:
        os.kill(process.number, signal.SIGKILL)

begun = []
class Noted(outputs.WritingProcess):
    def __init__(self):
        super().__init__()
        begun.append(self)
outputs.WritingProcess = Noted
options = RunOptions(export_every=1, vtk_every=0, checkpoint_every=2)
given = {"steps": "12"}
run_case(load_case(Path(sys.argv[1])), given, sys.argv[2], options, resume=len(sys.argv) > 3, watch=None if len(sys.argv) > 3 else watch)
"""


def test_a_run_whose_writer_is_killed_says_so_and_goes_on_with_resume(tmp_path: Path) -> None:
    case, out = Path(__file__).resolve().parents[3] / "cases" / "two_cubes", tmp_path / "run"
    environment = os.environ | {"FCSIM_THREADS": "2"}

    def run(*more: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-c", SCRIPT, str(case), str(out), *more]
        return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=100, check=False)

    ended = run()
    assert ended.returncode != 0
    assert "the process that writes FCLIB files has ended (SIGKILL)" in ended.stderr
    files = sorted((out / "fclib" / "global").iterdir(), key=lambda path: path.name[-10:])
    assert [path.name[-10:] for path in files[:4]] == [f"{step:05d}.hdf5" for step in range(1, 5)]
    assert len(files) <= 6
    for path in files:
        read_fclib(path)  # all whole
    resumed = run("--resume")
    assert resumed.returncode == 0, resumed.stderr
    assert len(list((out / "fclib" / "global").iterdir())) == 12
    assert len((out / "steps.csv").read_text().splitlines()) == 13
