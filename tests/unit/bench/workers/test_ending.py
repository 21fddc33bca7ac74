"""A worker of a bench that is told to end does, wherever it hears it, and leaves nothing behind."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest

from fcsim.bench.workers.launch import WorkerProcess
from fcsim.bench.workers.worker import Request, Settings
from fcsim.export_fclib import write_fclib
from fcsim.problem import LocalProblem

TOLD_WHILE_IT_FORKS = """
import os, signal, time
import numpy as np
from fcsim.solvers import SOLVERS
from fcsim.solvers.base import Iterate, Method, Options, Status

WORKER, told = os.getpid(), []

def tell():
    if not told:
        told.append(True)
        os.kill(WORKER, signal.SIGTERM)

os.register_at_fork(after_in_parent=tell)  # Python forgets what is raised in here

def solve(problem, r, monitor, options):
    if os.getpid() != WORKER:
        time.sleep(60)
    return Iterate(r, Status.STAGNATED)

SOLVERS["SLEEPS"] = Method(solve, Options(), "test", "this file")
"""


def test_a_worker_told_to_end_while_it_forks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (temporary := tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    (plugin := tmp_path / "sleeps.py").write_text(TOLD_WHILE_IT_FORKS, encoding="utf-8")
    write_fclib(problem := tmp_path / "one.hdf5", LocalProblem(np.eye(3), np.array([-1.0, 0.5, 0.0]), np.array([0.3])))
    worker = WorkerProcess(Settings(plugins=[str(plugin)]), ())
    request = Request(str(problem), "one", "local", 3, 1, 3, "SLEEPS", 1e-4, 60.0, None)
    said: list[str] = []
    asking = threading.Thread(target=lambda: said.append(worker.measure(request).status))
    asking.start()
    asking.join(30)
    left = list(temporary.glob("fcsim-*"))
    worker.end()
    asking.join()
    worker.close()
    assert "exit code 143" in said[0] and not left
