"""`solve_rolling`: a problem with rolling friction, a method's name, an answer that was checked."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.problem import Checks
from fcsim.problem.judge import relative
from fcsim.problem.rolling import (
    GlobalRollingProblem,
    RollingReduction,
    modified_velocity,
    natural_residual,
    reduce_rolling,
)
from fcsim.solvers.base import ERRORS, Criterion, Monitor, Result, Status, checked_limits, choice, override
from fcsim.solvers.plugins import kept_apart
from fcsim.solvers.run_method import run_method
from fcsim.solvers.table import SOLVERS, method


class RollingMonitor(Monitor):
    """Computes the error on the cone of rolling and spinning friction; iterates are in the reduction's scaled variables r', u'.

    published: the natural map in the units of the file, as programs print it; else in r', z = s r' with the contacts' compliances s.
    """

    def __init__(self, reduction: RollingReduction, criterion: Criterion, start: float, q: FloatArray | None = None) -> None:
        """q (m,): other velocities than the reduction's, in its scaled variables; start: when the solve began, by `time.perf_counter`."""
        local = reduction.local
        self._reduction, self._criterion, self._published = reduction, criterion, criterion.error == "published"
        free = local.q if q is None else q
        super().__init__(
            *(free / reduction.scale if self._published else free, local.mu, local.dimension, criterion.tol),
            compliance=None if self._published else local.delassus.compliance,
            floor=criterion.floor,
            time_limit=criterion.time_limit,
            start=start,
        )

    def inner(self, q: FloatArray, tol: float, floor: float = 0.0) -> Monitor:
        return RollingMonitor(self._reduction, replace(self._criterion, tol=tol, floor=floor), self.start, q)

    def error(self, r: FloatArray, u: FloatArray) -> float:
        given, scale = self._reduction, self._reduction.scale
        if self._published:
            residual = natural_residual(scale * r, u / scale, self.mu, given.problem.mu_r, self.compliance, given.problem.mu_s, False)
        else:
            residual = natural_residual(r, u, self.mu, given.local.mu_r, self.compliance, given.local.mu_s)
        return relative(residual, self.scale)


def solve_rolling(
    problem: GlobalRollingProblem | RollingReduction,
    solver: str,
    r: FloatArray | None = None,
    *,
    tol: float = 1e-8,
    error: str = "scaled",
    floor: float = 0.0,
    time_limit: float = float("inf"),
    **overrides: object,
) -> Result:
    """Solve a problem with rolling friction, or its reduction where that is known; arguments, errors and result as `solve`.
    "auto" is ROLLING-AUTO.

    The scaled error is taken on r', u' (see `RollingReduction`), and so are the checks; the published one, by the formula of eq. 13 on the
    cone of five or six dimensions, in the problem's own units.
    """
    name = "ROLLING-AUTO" if solver == "auto" else solver
    chosen = method(name)
    if 5 not in chosen.dimensions:
        known = [name for name, other in SOLVERS.items() if 5 in other.dimensions]
        raise InputError(f"solver {solver!r}: has no cone of rolling friction, expected auto or one of {', '.join(known)}")
    options = override(chosen.options, overrides)
    choice("error", error, ERRORS)
    checked_limits(tol, floor, time_limit)
    m = (problem.problem if isinstance(problem, RollingReduction) else problem).m
    begin = np.zeros(m) if r is None else np.array(r, dtype=np.float64)
    if begin.shape != (m,) or not np.all(np.isfinite(begin)):
        raise InputError(f"r: expected a starting point of {m} finite numbers, got shape {begin.shape}")
    start = time.perf_counter()
    given = problem if isinstance(problem, RollingReduction) else reduce_rolling(problem)
    local, scale = given.local, given.scale
    monitors = {name: RollingMonitor(given, Criterion(tol, name, floor, time_limit), start) for name in ERRORS}
    monitor = monitors[error]
    reduction = time.perf_counter()
    with np.errstate(over="ignore", invalid="ignore"):  # a diverging method meets infinity: its status says so
        iterate = run_method(chosen.run, kept_apart(local, chosen.run, solver), local.q, begin / scale, monitor, options)
        r, status = scale * iterate.r, iterate.status
        answer = given.answer(r)
        errors = {name: other.error(iterate.r, scale * answer.u) for name, other in monitors.items()}
    if (errors[error] <= tol) != status.solved:
        status = Status.SOLVED if errors[error] <= tol else Status.STAGNATED
    return Result(
        r=r,
        u=answer.u,
        v=answer.v,
        multiplier=answer.multiplier,
        status=status,
        error=errors[error],
        scaled_error=errors["scaled"],
        published_error=errors["published"],
        checks=_check(given, iterate.r, scale * answer.u, answer.momentum),
        iterations=monitor.iterations,
        history=monitor.history,
        seconds={"reduction": reduction - start, "solve": time.perf_counter() - reduction},
        method=name,
        message=iterate.message,
    )


def rolling_errors(problem: GlobalRollingProblem, r: FloatArray) -> tuple[float, float]:
    """The scaled and the published error of reactions r (m,), as `solve_rolling` states them; `SingularMatrix` where M is singular."""
    given = reduce_rolling(problem)
    u = given.scale * given.answer(r).u
    scaled, published = (RollingMonitor(given, Criterion(1e-8, name), start=0.0).error(r / given.scale, u) for name in ERRORS)
    return scaled, published


def _check(given: RollingReduction, r: FloatArray, u: FloatArray, momentum: float | None) -> Checks:
    """The unit-true checks (see `Checks`) of r', u' (m,), for all disks of the cone."""
    local = given.local
    if not given.problem.nc:
        return Checks(0.0, 0.0, 0.0, 0.0, momentum)
    r2, u2 = r.reshape(-1, local.dimension), u.reshape(-1, local.dimension)
    sliding = np.hypot(r2[:, 1], r2[:, 2]) - local.mu * r2[:, 0]
    turning = np.hypot(r2[:, 3], r2[:, 4]) - local.mu_r * r2[:, 0]
    spinning = np.abs(r2[:, 5]) - local.spinning * r2[:, 0] if local.mu_s is not None else np.zeros(1)
    modified = modified_velocity(u2, local.mu, local.mu_r, local.mu_s)
    opening = max(float(np.abs(u).max()), float(np.abs(local.q).max())) or 1.0
    size = float(np.linalg.norm(r)) * max(float(np.linalg.norm(u)), float(np.linalg.norm(local.q)))
    return Checks(
        cone=max(0.0, float(sliding.max()), float(turning.max()), float(spinning.max())) / (float(np.abs(r).max()) or 1.0),
        dual_cone=max(0.0, float(-u2[:, 0].min())) / opening,
        complementarity=abs(float(r @ modified.ravel())) / (size or 1.0),
        penetration=max(0.0, float(-u2[:, 0].min())),
        momentum=momentum,
    )
