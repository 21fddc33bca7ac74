"""`solve`: a problem, a method's name, an answer that was checked."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.problem import Answer, Followed, GlobalProblem, LocalProblem, Reduced, check, natural_map_residual
from fcsim.problem.distributed import DistributedDelassus
from fcsim.problem.elimination import Elimination
from fcsim.problem.judge import blurred, indefinite, outweighed, relative
from fcsim.problem.reduction import Reduction, reduced
from fcsim.problem.rolling import GlobalRollingProblem
from fcsim.runtime import limited_threads
from fcsim.solvers.base import ERRORS, Criterion, Iterate, Method, Monitor, Options, Result, Run, Status, checked_limits, choice, override
from fcsim.solvers.memory import Memory
from fcsim.solvers.plugins import kept_apart
from fcsim.solvers.run_method import run_method
from fcsim.solvers.small.door import CONTACTS, LEAST_LIMIT, Left, small
from fcsim.solvers.solve_rolling import solve_rolling
from fcsim.solvers.table import method


def solve(
    problem: GlobalProblem | LocalProblem | Reduction | Followed | GlobalRollingProblem,
    solver: str = "auto",
    r: FloatArray | None = None,
    *,
    tol: float = 1e-8,
    error: str = "scaled",
    floor: float = 0.0,
    time_limit: float = float("inf"),
    memory: Memory | None = None,
    **overrides: object,
) -> Result:
    """Solve a frictional contact problem by the named method and check the answer.

    problem    in global or local form, or a `Reduction` whose factor of M is known already (a simulation's); with rolling friction in
               global form, by the methods of dimension 5 or "auto" (see `solve_rolling`; it keeps no memory); one whose q follows its
               solution (`fcsim.problem.Followed`) by the nonsmooth Newton methods and "auto"
    solver     a name of `SOLVERS`; the default chooses and chains methods by the problem (docs/auto.md)
    r          (m,) starting point, default 0
    tol        on the error that decides; `floor` [unit of q] as in `fcsim.problem.error`
    error      "scaled", which does not depend on the units (`fcsim.problem.scaled_error`), or "published" (`fcsim.problem.error`)
    time_limit [s], tested between iterations
    memory     what a solve of a nearly equal problem left (`Result.memory`); None: nothing is kept. It shortens the way, never the check
    overrides  options of the method by name

    A global problem is reduced and a mixed local one's multiplier eliminated first (timed as "reduction"), unless the method works on
    it as it is (linear="kkt").
    Raises InputError for an unknown method or option and for arguments of a wrong shape.
    """
    chosen = method(solver)
    choice("error", error, ERRORS)
    checked_limits(tol, floor, time_limit)
    left = None
    if memory is None and time_limit >= LEAST_LIMIT:
        answered = small(problem, chosen, bool(overrides), solver, r, tol, error, floor)
        if isinstance(answered, Result):
            return answered
        left = answered
    criterion = Criterion(tol, error, floor, time_limit)
    return solve_by(chosen, problem, solver, r, criterion, memory=memory, overrides=overrides, left=left)


@limited_threads()
def solve_by(
    chosen: Method,
    problem: GlobalProblem | LocalProblem | Reduction | Followed | GlobalRollingProblem,
    solver: str,
    r: FloatArray | None,
    criterion: Criterion,
    *,
    memory: Memory | None = None,
    overrides: Mapping[str, object] | None = None,
    left: Left | None = None,
) -> Result:
    """`solve` by a method that need not be in the table, under the name `solver`; its arguments are not checked again. left: what the small
    front door has found already."""
    if isinstance(problem, GlobalRollingProblem):
        tol, error, floor, time_limit = criterion.tol, criterion.error, criterion.floor, criterion.time_limit
        return solve_rolling(problem, solver, r, tol=tol, error=error, floor=floor, time_limit=time_limit, **(overrides or {}))
    options = override(chosen.options, overrides or {})
    start = time.perf_counter()
    given = reduced(problem)  # M^-1 or R^-1
    run, form = _way(chosen, solver, options, given)  # the local form, or the problem as it is
    r = _starting_point(r, given, memory)
    answers = _Answers(given)
    monitor = Monitor(
        *(given.q, kept_apart(given.mu, run, solver), given.dimension, criterion.tol),
        compliance=kept_apart(given.compliance, run, solver) if criterion.error == "scaled" else None,
        floor=criterion.floor,
        time_limit=criterion.time_limit,
        start=start,
        velocity=answers.velocity,
        memory=memory,
    )
    prepared = time.perf_counter()
    with np.errstate(over="ignore", invalid="ignore"):  # a diverging method meets infinity: its status says so
        plain = memory is None and not overrides and criterion.time_limit >= LEAST_LIMIT
        if left is not None:
            left.noted(monitor, answers.velocity(left.r))
        iterate = _by_the_door(chosen, given, r, monitor, answers, criterion.error) if plain else None
        iterate = iterate or run_method(run, kept_apart(form, run, solver), given.q, r, monitor, options)
        return _judged(iterate, given, answers.of(iterate.r), monitor, criterion.error, solver, (start, prepared))


def _by_the_door(chosen: Method, given: Reduced, r: FloatArray, monitor: Monitor, answers: _Answers, error: str) -> Iterate | None:
    """What the small front door makes of the local form of a global or mixed problem of few contacts: None where it is not open or its
    answer is none by the problem's own equations. The monitor has its iterations and history, be it without an answer."""
    if (
        not isinstance(given, Reduction | Elimination)
        or not 0 < len(given.mu) <= CONTACTS
        or isinstance(given.local.W, DistributedDelassus)
    ):
        return None
    found = small(given.local, chosen, False, "", r, monitor.tol, error, monitor.floor)
    if isinstance(found, Left):
        found.noted(monitor, answers.velocity(found.r))
    if not isinstance(found, Result) or (found.status.solved and not monitor.error(found.r, answers.velocity(found.r)) <= monitor.tol):
        return None
    monitor.iterations, monitor.history = found.iterations, found.history
    return Iterate(found.r, found.status, "" if found.certificate is None else found.message, found.certificate)


def _judged(
    iterate: Iterate, given: Reduced, answer: Answer, monitor: Monitor, error: str, solver: str, clock: tuple[float, float]
) -> Result:
    """What the method left with what follows from r by the equations alone (u, v, l): what a method carried along does not count.

    clock: when the solve began and when its method did.
    """
    r, status = iterate.r, iterate.status
    with np.errstate(over="ignore"):
        within = np.isfinite(answer.u @ answer.u)  # or the residual's own squares are beyond the largest number
    residuals = [natural_map_residual(r, answer.u, given.mu, given.dimension, s) for s in (given.compliance, None)]
    errors = [relative(residual, monitor.scale) for residual in residuals]
    errors = errors if within else [float("nan")] * 2
    deciding = errors[ERRORS.index(error)]
    if (deciding <= monitor.tol) != status.solved:  # NaN is no solution
        status = Status.SOLVED if deciding <= monitor.tol else Status.STAGNATED
    size = r, answer.u, given.q, given.dimension
    remark = outweighed(*size, residuals[ERRORS.index(error)], monitor.scale, monitor.floor, monitor.tol) if status.solved else ""
    z = float(np.linalg.norm(np.repeat(given.compliance, given.dimension) * r)) if status.solved else 0.0
    known = blurred(z, _parts_of_q(given), monitor.scale, monitor.tol, float(given.mu[r[:: given.dimension] > 0].max(initial=0.0)))
    return Result(
        r=r,
        u=answer.u,
        v=answer.v,
        multiplier=answer.multiplier,
        status=status,
        error=deciding,
        scaled_error=errors[0],
        published_error=errors[1],
        checks=check(r, answer.u, given.mu, given.dimension, answer.momentum, given.q),
        iterations=monitor.iterations,
        history=monitor.history,
        seconds={"reduction": clock[1] - clock[0], "solve": time.perf_counter() - clock[1]},
        method=solver,
        message="; ".join(filter(None, (iterate.message, remark, known, _wrong_sign(status, given, r, answer.u)))),
        memory=monitor.memory,
        certificate=iterate.certificate if status is Status.INFEASIBLE else None,
    )


def _wrong_sign(status: Status, given: Reduced, r: FloatArray, u: FloatArray) -> str:
    """What `indefinite` says of a problem that was not solved; nothing of one whose q follows u."""
    if status in (Status.SOLVED, Status.INFEASIBLE) or not isinstance(given, LocalProblem | Reduction | Elimination):
        return ""
    return indefinite(given.diagonal_blocks, r, u - given.q)


def _parts_of_q(given: Reduced) -> float:
    """||w|| + ||H^T M^-1 f|| of a global problem, ||q|| + ||V R^-1 s|| of a mixed one: what its q is a sum of; 0 where q is given."""
    if not isinstance(given, Reduction | Elimination):
        return 0.0
    first = given.problem.w if isinstance(given, Reduction) else given.problem.q
    return float(np.linalg.norm(first)) + float(np.linalg.norm(given.q - first))


def _way(chosen: Method, solver: str, options: Options, given: Reduced) -> tuple[Run, LocalProblem | Reduced]:
    """The method's run function and the form of the problem that it takes: local, or as it is where linear="kkt" asks for that or q
    follows."""
    if given.dimension not in chosen.dimensions:
        known = "problems with rolling friction" if 5 in chosen.dimensions else " and ".join(f"{d}D" for d in chosen.dimensions)
        raise InputError(f"solver {solver!r}: works in {known}, the problem has {given.dimension}D")
    if isinstance(given, Followed):
        if chosen.run_followed is None:
            raise InputError(f"solver {solver!r}: expected a nonsmooth Newton method for a problem whose q follows its solution")
        return chosen.run_followed, given
    if getattr(options, "linear", "") != "kkt":
        return chosen.run, given.local if chosen.over_ranks else given.local.whole
    run = {Reduction: chosen.run_global, Elimination: chosen.run_mixed}.get(type(given))
    if run is None:
        form = {Reduction: "a global problem", Elimination: "a mixed local problem"}.get(type(given), "a local problem without constraints")
        ways = [name for name, way in (("global", chosen.run_global), ("mixed local", chosen.run_mixed)) if way is not None]
        if not ways:
            raise InputError(f"option linear: expected 'auto' for {solver!r}, which works on the local form alone, got 'kkt'")
        raise InputError(f"option linear: expected 'kkt' with a {' or '.join(ways)} problem for {solver!r}, got it with {form}")
    return run, given


def _starting_point(r: FloatArray | None, given: Reduced, memory: Memory | None) -> FloatArray:
    """r (m,) as floats of one's own, 0 where none is given; InputError where it or the memory do not fit the problem."""
    if memory is not None and len(memory.identity) != len(given.mu):
        expected = f"expected one of the problem's {len(given.mu)} contacts"
        raise InputError(f"memory: {expected}, got one of {len(memory.identity)} (see Memory.follow)")
    if r is None:
        return np.zeros(len(given.q))
    r = np.array(r, dtype=np.float64)
    if r.shape != given.q.shape:
        raise InputError(f"r: expected a starting point of shape {given.q.shape}, got {r.shape}")
    if not np.all(np.isfinite(r)):
        raise InputError("r: expected a starting point of finite numbers, got NaN or infinity")
    return r


class _Answers:
    """The problem's answers; the last is remembered, since the iterate that ends a method is the one that is handed back."""

    def __init__(self, given: Reduced) -> None:
        self._given = given
        self._last: tuple[FloatArray, Answer] | None = None

    def of(self, r: FloatArray) -> Answer:
        """What follows from r (m,)."""
        if self._last is None or not np.array_equal(self._last[0], r):
            self._last = r.copy(), self._given.answer(r)
        return self._last[1]

    def velocity(self, r: FloatArray) -> FloatArray:
        """u (m,) from r (m,)."""
        return self.of(r).u
