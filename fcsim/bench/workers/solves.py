"""Timed solves by this package's methods, in children that are warm and can be killed."""

from __future__ import annotations

import statistics
import time
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from fcsim.arrays import Matrix
from fcsim.bench.fclib_problem import FclibProblem
from fcsim.bench.results import SLACK
from fcsim.bench.workers.compiling import compiled_so_far, watch
from fcsim.bench.workers.killable import FINISHED, Row, Task, run_killable
from fcsim.linear.joints import FRONTS_FROM, JOINT
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.solvers import method, solve

WARM_UP = 2.0
"""[s] What a warm-up may take, beyond what is compiled in it: its runs stop at the first look at the clock after so long."""
ROUNDS = 20
"""Warm-ups at most: each but the last compiles something."""
HANGS = 15.0
"""[s] after which a method that neither compiles nor ends on a few contacts is taken to hang: its limit is WARM_UP."""
REPEAT_AT_MOST = 7
GRACE = 3.0
"""[s] A method tests its time limit between iterations; so much later it is killed."""


def runs(
    problem: GlobalProblem | LocalProblem, method: str, tolerances: Sequence[float], time_limit: float, repeat_within: float
) -> Iterator[Row]:
    """Solve to each tolerance in turn, from r = 0 and with nothing kept from run to run; medians where a run is short."""
    for _ in warm_up(problem, method, min(tolerances), time_limit):
        pass
    for tol in tolerances:
        yield run(problem, method, tol, time_limit, repeat_within)


def warm_up(problem: GlobalProblem | LocalProblem, method: str, tol: float, time_limit: float) -> Iterator[None]:
    """An unmeasured run in the process that measures, WARM_UP s of it at most, whose answer is thrown away; another one after each in which
    something was compiled (numba's cache is cold, or the machine another one), since the clock stopped that before what comes after it.

    What numba has compiled is loaded in it, modules that are imported late, and the memory that a forked child shares with its parent until
    one of them writes becomes the child's own: up to 0.4 s on a solve of 0.2 s, of which no other run of a process has anything. Measured
    runs start from r = 0 and a problem of which nothing is known all the same.
    """
    for _ in range(ROUNDS):
        before = compiled_so_far()
        solve(replace(problem), method, tol=tol, error="published", time_limit=min(WARM_UP, time_limit))
        yield
        if compiled_so_far() == before:
            return


def run(problem: GlobalProblem | LocalProblem, method: str, tol: float, time_limit: float, repeat_within: float) -> Row:
    """Solve from r = 0, with nothing kept from before; medians of several solves where they are short."""
    measured: list[dict[str, float]] = []
    while not measured or (sum(run["seconds"] for run in measured) < repeat_within and len(measured) < REPEAT_AT_MOST):
        fresh = replace(problem)
        wall, cpu = time.perf_counter(), time.process_time()
        result = solve(fresh, method, tol=tol, error="published", time_limit=time_limit)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        measured.append({"seconds": wall, "cpu_seconds": cpu, "reduction": result.seconds["reduction"]})
    medians = {key: statistics.median(run[key] for run in measured) for key in measured[0]}
    return {"tol": tol, "status": result.status.name, "iterations": result.iterations, "r": result.r, "repeats": len(measured), **medians}


def measure(
    problem: FclibProblem, methods: Iterable[str], tolerances: Sequence[float], time_limit: float, jobs: int = 1, repeat_within: float = 0.0
) -> Iterator[tuple[str, list[Row]]]:
    """Yield, method by method, a row for each tolerance; the error is the judge's, `solved` says whether it meets tol.

    Tolerances go from loose to tight; after one that a method did not meet within the time limit the tighter ones are not tried.
    """
    ordered = sorted(tolerances, reverse=True)

    def task(method: str) -> Task[str, Row]:
        def items() -> Iterator[Row]:
            for row in runs(problem.problem, method, ordered, time_limit, repeat_within):
                yield row
                if row["status"] == "TIME_LIMIT":
                    return

        return Task(method, items, 2 * WARM_UP + time_limit + max(GRACE, 0.5 * time_limit), watch=watch)

    for ended in run_killable(map(task, methods), jobs):
        rows = []
        for tol, item in zip(ordered, [*ended.items, *([None] * len(ordered))], strict=False):
            row: Row = {"method": ended.key, "tol": tol, "seconds": None, "cpu_seconds": None, "reduction": None, "iterations": None}
            if item is not None:
                row |= {key: value for key, value in item.items() if key != "r"}
                row["error"] = problem.error(item["r"])
            else:
                failed = ended.how if ended.how != FINISHED else f"not tried: {ordered[len(ended.items) - 1]:g} not met in time"
                row |= {"status": failed, "error": None}
            row["solved"] = row["error"] is not None and row["error"] <= tol * SLACK
            rows.append(row)
        yield ended.key, rows


def small_problem(dimension: int) -> LocalProblem:
    """Two contacts with a random positive definite W, a body pressed on its support."""
    root = np.random.default_rng(0).standard_normal((2 * dimension, 2 * dimension))
    q = np.tile([-1.0, 0.5, 0.2][:dimension], 2)
    return LocalProblem(root @ root.T + np.eye(2 * dimension), q, np.full(2, 0.4), dimension=dimension)


def small_problem_like(problem: GlobalProblem | LocalProblem) -> GlobalProblem | LocalProblem:
    """Two contacts in the form, dimension and storage of `problem`, with one equality constraint where it has some."""
    small = small_problem(problem.dimension)
    return _like(problem, sp.csc_array(np.linalg.inv(small.W)), sp.eye_array(small.m, format="csc"))


def chain_like(problem: GlobalProblem | LocalProblem) -> GlobalProblem | LocalProblem:
    """The same with so many deformable bodies, pressed on each other, that methods treat their joints as those of a large problem."""
    d, joint = problem.dimension, 2 * JOINT
    joints = -(-FRONTS_FROM // (joint * d)) + 1
    root = np.random.default_rng(0).standard_normal((joint * d, joint * d))
    body = sp.csc_array(root @ root.T + joint * d * np.eye(joint * d))
    M = sp.block_diag([body] * (joints + 1), format="csc")
    H = sp.kron(sp.diags_array([-1.0, 1.0], offsets=[0, -1], shape=(joints + 1, joints)), sp.eye_array(joint * d), format="csc")
    return _like(problem, M, H)


def _like(problem: GlobalProblem | LocalProblem, M: sp.csc_array, H: sp.csc_array) -> GlobalProblem | LocalProblem:
    """The problem of bodies of mass M whose contacts close and slide, in the form and storage of `problem`."""
    d, m = problem.dimension, H.shape[1]
    q, mu = np.tile([-1.0, 0.5, 0.2][:d], m // d), np.full(m // d, 0.4)

    def stored(matrix: Matrix, like: Matrix) -> Matrix:
        if not isinstance(like, np.ndarray):
            return type(like)(matrix)
        return matrix if isinstance(matrix, np.ndarray) else matrix.toarray()

    if isinstance(problem, LocalProblem):
        W = stored(sp.csc_array(H.T @ spla.spsolve(M, H)), problem.W)
        if problem.V is None or problem.R is None:
            return LocalProblem(W, q, mu, dimension=d)
        V, R = stored(np.full((m, 1), 0.1), problem.V), stored(-np.eye(1), problem.R)
        return LocalProblem(W, q, mu, V, R, np.zeros(1), dimension=d)
    n = M.shape[0]
    G = None if problem.G is None else stored(np.full((n, 1), 0.1), problem.G)
    M, H = stored(M, problem.M), stored(H, problem.H)
    return GlobalProblem(M, H, np.zeros(n), q, mu, G, None if G is None else np.zeros(1), d)


def warm(methods: Iterable[str]) -> None:
    """Compile what each method needs: first in a child, since it may hang or crash, then here, where later children inherit it."""
    warm_on({(name, d): small_problem(d) for name in methods for d in method(name).dimensions if d < 5})


def warm_on(cases: Mapping[tuple[str, Hashable], GlobalProblem | LocalProblem]) -> None:
    """The same with the problems of `cases`, by (method, anything). One that hangs is ended after HANGS, which compiling does not count."""

    def task(case: tuple[str, Hashable]) -> Task[tuple[str, Hashable], int]:
        return Task(case, lambda: iter([solve(cases[case], case[0], time_limit=WARM_UP).iterations]), HANGS, watch=watch)

    for ended in run_killable(map(task, cases), quiet=True):
        if ended.how == FINISHED:
            solve(cases[ended.key], ended.key[0], time_limit=WARM_UP)
