"""Talks to `siconos_worker.py` in the Python that has Siconos, and tightens Siconos' tolerance until an independent error is met."""

from __future__ import annotations

import json
import math
import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import scipy.sparse as sp

from fcsim.bench.judge import FclibProblem
from fcsim.bench.results import SLACK
from fcsim.problem import GlobalProblem
from fcsim.reduction import eliminate_equalities, reduce

WORKER = Path(__file__).with_name("siconos_worker.py")
TIGHTEST = 1e-16
"""No tolerance below is asked of Siconos."""
UNREACHED = 1e3
"""Factor by which one tightening goes at most, so that the run whose time counts is not much more exact than needed."""


def siconos_version(python: Path) -> str | None:
    """The version of Siconos that this Python has, None where it has none."""
    try:
        check = subprocess.run([python, WORKER, "--check"], capture_output=True, text=True, timeout=60, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return check.stdout.strip() if check.returncode == 0 else None


def write_problem(problem: FclibProblem, path: Path) -> None:
    """Write the file that the worker reads."""
    p = problem.problem
    arrays: dict[str, Any] = {"dimension": p.dimension, "mu": p.mu}
    # equality constraints are eliminated for Siconos, which does not know them
    local = reduce(p).local if isinstance(p, GlobalProblem) else eliminate_equalities(p)
    matrices, arrays["q"] = {"W": local.W}, local.q
    if isinstance(p, GlobalProblem) and p.G is None:
        matrices |= {"M": p.M, "H": p.H}
        arrays |= {"f": p.f, "w": p.w}
    for letter, matrix in matrices.items():
        rows = sp.csr_array(matrix)
        rows.sum_duplicates()
        arrays |= {f"{letter}.{part}": getattr(rows, part) for part in ("data", "indices", "indptr", "shape")}
    np.savez(path, **arrays)


class Siconos:
    """The worker on one problem. `configurations`: pairs of a name and how the matrix is stored."""

    def __init__(self, problem: FclibProblem, process: subprocess.Popen[str]) -> None:
        self.problem, self._process = problem, process
        self.configurations: list[tuple[str, str]] = [(name, storage) for name, storage in json.loads(self._read())]

    def _read(self) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"{WORKER.name} ended with code {self._process.wait()} on {self.problem.name}")
        return line

    def request(self, **request: Any) -> dict[str, Any]:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        reply: dict[str, Any] = json.loads(self._read())
        return reply

    def solve(self, configuration: str, storage: str, tol: float, limit: float, memory: float | None = None) -> dict[str, Any]:
        """Run until the independent error meets `tol`, Siconos' tolerance tightened by powers of ten; each run takes `limit` s at most.

        memory: MiB that a run may add to what the problem takes.

        Returns status, error, solved, siconos_tol, iterations and the seconds of the run that met it (else of the last one).
        """
        own = tol
        while True:
            reply = self.request(configuration=configuration, storage=storage, tol=own, limit=limit, memory=memory)
            row = {"status": reply["status"], "siconos_tol": own, "error": None, "solved": False}
            if "r" not in reply:
                return row
            error = self.problem.error(reply["r"])
            row |= {"error": error, "solved": error <= tol * SLACK}
            row |= {key: reply[key] for key in ("seconds", "cpu_seconds", "iterations")}
            if row["solved"]:
                return row
            row["status"] = f"info {reply['info']}"
            if reply["info"] != 0 or own <= TIGHTEST or not math.isfinite(error):
                return row
            tenths = math.ceil(math.log10(error / tol))
            own = max(own / min(10.0 ** max(tenths, 1), UNREACHED), TIGHTEST)

    def seconds_per_sweep(self, configuration: str, storage: str, sweeps: int, limit: float, clock: str) -> float | None:
        reply = self.request(configuration=configuration, storage=storage, tol=0.0, limit=limit, iterations=sweeps)
        return reply[clock] / reply["iterations"] if reply.get("iterations") else None


@contextmanager
def siconos_on(problem: FclibProblem, python: Path, written: Path | None = None) -> Iterator[Siconos]:
    """Start the worker on the problem, `written` to a file already or not; it ends with the block."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    with TemporaryDirectory() as folder:
        path = written or Path(folder) / "problem.npz"
        if written is None:
            write_problem(problem, path)
        command = [python, WORKER, path]
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environment
        ) as process:
            try:
                yield Siconos(problem, process)
            finally:
                process.kill()
