"""`solve`: a problem, a method's name, an answer that was checked."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.problem import GlobalProblem, LocalProblem, check
from fcsim.problem.reduction import Elimination, Reduction, reduce
from fcsim.solvers.base import Monitor, Result, Status, override
from fcsim.solvers.memory import Memory
from fcsim.solvers.table import method


def solve(
    problem: GlobalProblem | LocalProblem | Reduction,
    solver: str = "NSN-AC",
    r: FloatArray | None = None,
    *,
    tol: float = 1e-8,
    floor: float = 0.0,
    time_limit: float = float("inf"),
    memory: Memory | None = None,
    **overrides: Any,
) -> Result:
    """Solve a frictional contact problem by the named method and check the answer.

    problem    in global or local form, or a `Reduction` whose factor of M is known already (a simulation's)
    r          (m,) starting point, default 0
    tol        on the one error of `fcsim.problem.error`; `floor` [unit of q] as there
    time_limit [s], tested between iterations
    memory     what a solve of a nearly equal problem left (`Result.memory`); None: nothing is kept. It shortens the way, never the check
    overrides  options of the method by name

    A global problem is reduced and a mixed local one's multiplier eliminated first (timed as "reduction"), unless the method works on
    it as it is (linear="kkt").
    Raises InputError for an unknown method or option and for arguments of a wrong shape.
    """
    chosen = method(solver)
    options = override(chosen.options, overrides)
    if not tol > 0:
        raise InputError(f"tol: expected a number > 0, got {tol}")
    start = time.perf_counter()
    given: LocalProblem | Reduction | Elimination
    if isinstance(problem, GlobalProblem):
        given = reduce(problem)
    elif isinstance(problem, LocalProblem):
        given = problem if problem.V is None else Elimination(problem)
    elif isinstance(problem, Reduction):
        given = problem
    else:
        raise InputError(f"problem: expected a GlobalProblem, a LocalProblem or a Reduction, got {type(problem).__name__}")
    as_it_is = chosen.run_mixed if isinstance(given, Elimination) else None if isinstance(given, LocalProblem) else chosen.run_global
    if getattr(options, "linear", "") != "kkt":
        as_it_is = None
    local = given if isinstance(given, LocalProblem) else given.local if as_it_is is None else None
    whole = given if isinstance(given, LocalProblem) else given.problem
    q, mu, dimension = given.q, whole.mu, whole.dimension
    if dimension not in chosen.dimensions:
        raise InputError(f"solver {solver!r}: works in {' and '.join(f'{d}D' for d in chosen.dimensions)}, the problem has {dimension}D")
    r = np.zeros(len(q)) if r is None else np.array(r, dtype=np.float64)
    if r.shape != q.shape:
        raise InputError(f"r: expected a starting point of shape {q.shape}, got {r.shape}")
    if not np.all(np.isfinite(r)):
        raise InputError("r: expected a starting point of finite numbers, got NaN or infinity")
    if memory is not None and len(memory.identity) != len(mu):
        raise InputError(f"memory: expected one of the problem's {len(mu)} contacts, got one of {len(memory.identity)} (see Memory.follow)")
    reduced = time.perf_counter()
    monitor = Monitor(q, mu, dimension, tol, floor=floor, time_limit=time_limit, start=start, memory=memory)
    with np.errstate(over="ignore", invalid="ignore"):  # a diverging method meets infinity: its status says so
        run = chosen.run if as_it_is is None else as_it_is
        r, status = _run(run, given if local is None else local, q, r, monitor, options)
    v, multiplier, momentum = None, None, None
    if isinstance(given, Reduction):
        v, multiplier = given.velocity(r)
        momentum = given.momentum_residual(r, v, multiplier)
        u = given.problem.H.T @ v + given.problem.w
    elif isinstance(given, Elimination):
        multiplier = given.multiplier(r)
        u = given.velocity(r)
    else:
        u = given.W @ r + given.q
    error = monitor.error(r, u)
    if status is Status.SOLVED and not error <= tol:  # NaN included: the independent residual has the last word
        status = Status.STAGNATED
    end = time.perf_counter()
    return Result(
        r=r,
        u=u,
        v=v,
        status=status,
        error=error,
        iterations=monitor.iterations,
        seconds={"reduction": reduced - start, "solve": end - reduced},
        history=monitor.history,
        checks=check(r, u, mu, dimension, momentum, q),
        method=solver,
        multiplier=multiplier,
        memory=monitor.memory,
    )


def _run(run: Any, problem: Any, q: FloatArray, r: FloatArray, monitor: Monitor, options: Any) -> tuple[FloatArray, Status]:
    """Run the method; where it stops unsolved, hand back the best iterate seen."""
    zero = np.zeros_like(r)
    # r = 0 answers a problem without contacts, and one at rest up to round-off (see `floor`)
    if monitor.error(zero, q) <= monitor.tol:
        return zero, Status.SOLVED
    iterate = run(problem, r, monitor, options)
    if not iterate.status.solved and monitor.best_r is not None:
        return monitor.best_r, iterate.status
    return iterate.r, iterate.status
