"""Talks to `siconos_worker.py` in the Python that has Siconos, and tightens Siconos' tolerance until an independent error is met."""

from __future__ import annotations

import json
import math
import os
import statistics
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from fcsim.bench.fclib_problem import FclibProblem
from fcsim.bench.results import SLACK
from fcsim.bench.workers.killable import FINISHED, Row
from fcsim.files import replacing
from fcsim.problem import GlobalProblem
from fcsim.problem.reduction import reduced

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
    arrays: dict[str, ArrayLike] = {"dimension": p.dimension, "mu": p.mu}
    # equality constraints are eliminated for Siconos, which does not know them
    local = reduced(p).local
    matrices, arrays["q"] = {"W": local.W}, local.q
    if isinstance(p, GlobalProblem) and p.G is None:
        matrices |= {"M": p.M, "H": p.H}
        arrays |= {"f": p.f, "w": p.w}
    for letter, matrix in matrices.items():
        rows = sp.csr_array(matrix)
        rows.sum_duplicates()
        arrays |= {f"{letter}.{part}": getattr(rows, part) for part in ("data", "indices", "indptr", "shape")}
    np.savez(path, allow_pickle=False, **arrays)


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

    def request(self, **request: str | float | None) -> Row:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        reply: Row = json.loads(self._read())
        return reply

    def solve(self, configuration: str, storage: str, tol: float, limit: float, memory: float | None = None) -> Row:
        """Run until the independent error meets `tol`, Siconos' tolerance tightened by powers of ten; each run takes `limit` s at most.

        memory: MiB that a run may add to what the problem takes.

        Returns status, error, solved, siconos_tol, iterations and the seconds of the run that met it (else of the last one).
        """
        *_, row = self.runs(configuration, storage, tol, limit, memory)
        return row

    def runs(self, configuration: str, storage: str, tol: float, limit: float, memory: float | None) -> Iterator[Row]:
        """The same, run by run."""
        own = tol
        while True:
            reply = self.request(configuration=configuration, storage=storage, tol=own, limit=limit, memory=memory)
            row = {"status": reply["status"], "siconos_tol": own, "error": None, "solved": False}
            if "r" not in reply:
                yield row
                return
            error = self.problem.error(reply["r"])
            row |= {"error": error, "solved": error <= tol * SLACK, "info": reply["info"]}
            row |= {key: reply[key] for key in ("seconds", "cpu_seconds", "iterations")}
            if not row["solved"]:
                row["status"] = f"info {reply['info']}"
            yield row
            if row["solved"] or reply["info"] != 0 or own <= TIGHTEST or not math.isfinite(error):
                return
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


def write_with_reduction_time(problem: FclibProblem, path: Path) -> None:
    """Write what the worker reads and, beside it, the seconds of our reduction to W and q, which Siconos' local solvers are given."""
    p = problem.problem

    def once() -> tuple[float, float]:
        fresh = replace(p)
        wall, cpu = time.perf_counter(), time.process_time()
        _ = reduced(fresh).local.q
        return time.perf_counter() - wall, time.process_time() - cpu

    once()  # loads compiled code, as before the measured runs of our methods
    seconds = [once()]
    while sum(wall for wall, _ in seconds) < 0.5 and len(seconds) < 7:
        seconds.append(once())
    medians = [statistics.median(column) for column in zip(*seconds, strict=True)]
    path.with_suffix(".json").write_text(json.dumps(medians), encoding="utf-8")
    with replacing(path) as temporary:  # last: the file is there when all is
        write_problem(problem, temporary)


def solve_by_siconos(
    problem: FclibProblem, name: str, tol: float, limit: float, memory: float | None, python: Path, written: Path
) -> Iterator[Row]:
    """Solve by the configuration NAME, or NAME/STORAGE, to the independent error; the last item is the measurement, others mean progress.

    written: where the problem is kept for the worker from call to call.
    Items have `how` (FINISHED or how the run was ended) and if finished status, seconds, cpu_seconds, iterations, error. Without a
    storage, the first of the configuration's that fits the size is taken.
    """
    if not written.exists():
        write_with_reduction_time(problem, written)
    yield {"how": "written"}
    configuration, _, storage = name.partition("/")
    with siconos_on(problem, python, written) as siconos:
        fitting = [s for n, s in siconos.configurations if n == configuration and storage in ("", s)]
        if not fitting:
            yield {"how": f"Siconos' {name} is not for this problem"}
            return
        added = (0.0, 0.0) if fitting[0] == "global" else json.loads(written.with_suffix(".json").read_text(encoding="utf-8"))
        for row in siconos.runs(configuration, fitting[0], tol, limit, memory):
            if "seconds" not in row:
                yield {"how": row["status"]}
                continue
            times = {"seconds": row["seconds"] + added[0], "cpu_seconds": row["cpu_seconds"] + added[1]}
            told = f"info {row['info']} at its tolerance {row['siconos_tol']:g}"
            if row["solved"]:
                status = "SOLVED"
            elif not math.isfinite(row["error"]):
                status = f"DIVERGED: {told}"
            else:  # by its own measure it is solved, or it gave up
                status = f"STAGNATED: {told}" if row["info"] == 0 else f"MAX_ITERATIONS: {told}"
            yield {"how": FINISHED, "status": status, "iterations": row["iterations"], "error": row["error"], **times}
