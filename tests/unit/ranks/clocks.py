"""A solve with a time limit on ranks whose clocks differ: on all but the first a second lasts a hundredth. Writes what each rank has."""

import json
import time
from pathlib import Path
from unittest import mock

import numpy as np

from fcsim.problem import LocalProblem
from fcsim.ranks import alone, sharing
from fcsim.solvers import solve

LIMIT = 0.5


def problem() -> LocalProblem:
    """Squeezed bodies that sweeps never bring to rest: no r has u_N >= 0 at both contacts."""
    W = np.kron([[2.0, -2.0], [-2.0, 2.0]], np.eye(2))
    return LocalProblem(W, -np.ones(4), [0.5, 0.5], dimension=2)


def main(folder: Path) -> None:
    with sharing() as world:
        assert world is not None
        solve(problem(), "NSGS-AC", tol=1e-12, max_iterations=3)  # loads what is compiled
        clock, pace = time.perf_counter, 100 if world.number > 0 else 1
        with mock.patch.object(time, "perf_counter", lambda: pace * clock()):
            together = solve(problem(), "NSGS-AC", tol=1e-12, time_limit=LIMIT, max_iterations=10**9)
            with alone():
                own = solve(problem(), "NSGS-AC", tol=1e-12, time_limit=LIMIT, max_iterations=10**9)
        answer = {"iterations": together.iterations, "status": together.status.name, "alone": own.status.name}
        (folder / f"{world.number}.json").write_text(json.dumps(answer), encoding="utf-8")
