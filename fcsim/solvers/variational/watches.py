"""Who decides when an iteration ends, and when an error is worth computing."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.solvers.base import Monitor, Status
from fcsim.solvers.variational.inequality import Inequality


class Watch(Protocol):
    """Who decides when an iteration ends: for the whole problem the monitor's error, for a sub-problem its natural residual.

    `target` is the natural residual ||s (r - P_C(r - F(r) / s))|| to reach, s = `compliance` (nc,) that of the monitor's error. ADMM
    tells what its multiplier says of ||u + g(u)|| as `speed`, infinite where nobody does.
    """

    target: float
    compliance: FloatArray
    speed: float

    def visit(self, r: FloatArray, u: FloatArray | None, due: bool) -> Status | None:
        """See the iterate r with u = W r + q (None: computed where needed) and say how to stop, None to go on.

        The residual is computed where it is `due`: where a cheap bound or measure does not exclude that it is small enough.
        """

    def tick(self) -> None:
        """Count an iteration."""


class ProblemWatch:
    """Stops a method on the problem itself: the full error is computed where due, and every `period` iterations."""

    def __init__(self, velocity: Callable[[FloatArray], FloatArray], monitor: Monitor, max_iterations: int, period: int = 100) -> None:
        self._velocity, self._monitor, self._limit, self._period = velocity, monitor, max_iterations, period
        self.target, self.compliance = monitor.tol * monitor.scale, monitor.compliance
        self.speed = float("inf")
        self._next = monitor.iterations

    def visit(self, r: FloatArray, u: FloatArray | None, due: bool) -> Status | None:
        monitor = self._monitor
        last = monitor.iterations >= self._limit
        late = monitor.out_of_time()
        if due or last or late or monitor.iterations >= self._next:
            self._next = monitor.iterations + self._period
            error = monitor.record(r, self._velocity(r) if u is None else u)
            if error <= monitor.tol:
                return Status.SOLVED
            if not np.isfinite(error):
                return Status.DIVERGED
        if last:
            return Status.MAX_ITERATIONS
        return Status.TIME_LIMIT if late else None

    def tick(self) -> None:
        self._monitor.iterations += 1


class SubproblemWatch:
    """Stops the solution of a sub-problem at its natural residual `target`; its iterations are its own."""

    def __init__(self, inequality: Inequality, monitor: Monitor, target: float, max_iterations: int) -> None:
        self._vi, self._monitor, self._limit = inequality, monitor, max_iterations
        self.target, self.compliance = target, monitor.compliance
        self.speed = float("inf")
        self.iterations = 0

    def visit(self, r: FloatArray, u: FloatArray | None, due: bool) -> Status | None:
        if due:
            residual = self._vi.residual(r, self._vi.velocity(r) if u is None else u, self.compliance)
            if residual <= self.target:
                return Status.SOLVED
            if not np.isfinite(residual):
                return Status.DIVERGED
        if self.iterations >= self._limit:
            return Status.MAX_ITERATIONS
        return Status.TIME_LIMIT if self._monitor.out_of_time() else None

    def tick(self) -> None:
        self.iterations += 1


def least_residual(watch: Watch, rho: float, change: float) -> float:
    """What the natural residual is at least where a step r -> P_C(r - rho F(r)) changes r by `change` (of the Euclidean norm).

    ||r - P_C(r - rho F)|| grows with rho and falls when divided by it, so that with 1 / s in the place of rho it is at least
    min(1, 1 / (rho s)) times this, contact by contact.
    """
    return min(float(watch.compliance.min(initial=np.inf)), 1.0 / rho if rho > 0 else math.inf) * change


class LightCriterion:
    """When a cheap estimate of the residual says that the true one is worth computing: each time it fell by half (compare eq. 14)."""

    def __init__(self, start: float) -> None:
        self._threshold = start

    def due(self, estimate: float) -> bool:
        if estimate <= self._threshold or not np.isfinite(estimate):
            self._threshold = 0.5 * estimate
            return True
        return False
