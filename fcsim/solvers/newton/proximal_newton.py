"""Proximal Newton: the proximal point algorithm in the metric of the contacts' own compliances, nonsmooth Newton inside.

With the centre r_k solve W r + q + alpha D (r - r_k) = u, K* ∋ u + g(u) ⊥ r ∈ K for r_k+1, D = tr(W_aa) / d of each contact, so that
contacts of light and of heavy bodies make equal steps. alpha D makes a rank-deficient W regular and pulls Newton into its basin; alpha
falls while the inner problems are easy and grows where they fail, and the formulation changes there. A fixed point solves the problem
itself, whatever alpha. An inner problem that was not solved still gives a step if that brings the error down.

Sources: R. T. Rockafellar, SIAM J. Control Optim. 14, 1976; Acary, Brémond, Huber 2018, section on PPA-NSN. The metric and the schedule
of alpha are our own; `fcsim.solvers.proximal` has the published ones (alpha I, rules by error or constant) with any inner method.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.problem import LocalProblem
from fcsim.solvers.base import Iterate, Monitor, Options, Status
from fcsim.solvers.newton.regularised import RegularisedNewton
from fcsim.solvers.turns import Turns, to_the_end

NEAR_ENOUGH = 1e-3
"""Error below which a rho that adapts is tried where the constant one fails: single contacts may cycle with a constant one."""
RUNAWAY = 100.0
"""Growth of the error over the best one at which the best iterate is taken up again."""
INEXACT = 0.5
"""Reduction of the residual at which an inner problem that was not solved still gives a step, if the error falls too."""
LARGEST_ALPHA = 1e8
"""Regularisation beyond which a step is no step."""


@dataclass(frozen=True, kw_only=True)
class ProximalNewtonOptions(Options):
    """max_iterations counts Newton's iterations.

    alpha     first regularisation, relative to each contact's own compliance
    accuracy  of the inner problems, relative to the error
    rise      factor of alpha where one fails
    patience  outer iterations without a better iterate before giving up
    retries   inner problems, from errors below `NEAR_ENOUGH`, that an adapting rho may fail to solve as well before it is given up
    """

    max_iterations: int = 10_000
    alpha: float = 1e-2
    accuracy: float = 0.1
    rise: float = 3.0
    patience: int = 300
    retries: int = 2

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("alpha", "accuracy"):
            if not getattr(self, name) > 0:
                raise InputError(f"option {name}: expected a number > 0, got {getattr(self, name)}")
        if not self.rise > 1:
            raise InputError(f"option rise: expected a number > 1, got {self.rise}")
        for name in ("patience", "retries"):
            if getattr(self, name) < 0:
                raise InputError(f"option {name}: expected an integer >= 0, got {getattr(self, name)}")


def proximal_newton(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: ProximalNewtonOptions) -> Iterate:
    """Proximal Newton from the starting point r (m,)."""
    return to_the_end(proximal_newton_turns(problem, r, monitor, options))


def proximal_newton_turns(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: ProximalNewtonOptions) -> Turns:
    """The same by turns of one inner problem each (63 lines: one loop whose branches share its state)."""
    W = problem.W
    inner = RegularisedNewton(problem)
    alpha, formulation, floor = options.alpha, "AC", 0.0
    error = least = monitor.record(r, W @ r + problem.q)
    best, waited, failed = r, 0, 0
    if error <= monitor.tol:
        return Iterate(r, Status.SOLVED)
    while waited < options.patience:
        if monitor.out_of_time():
            return Iterate(best, Status.TIME_LIMIT)
        if monitor.iterations >= options.max_iterations:
            return Iterate(best, Status.MAX_ITERATIONS)
        target = options.accuracy * max(monitor.tol, min(error, 1.0))
        most = options.max_iterations - monitor.iterations
        found, watch = inner.solve(r, alpha, target, formulation, monitor, most=most)
        monitor.iterations += max(watch.iterations, 1)
        if found.status is not Status.SOLVED and error <= NEAR_ENOUGH and failed < options.retries and most > max(watch.iterations, 1):
            again, second = inner.solve(r, alpha, target, formulation, monitor, adaptive=True, most=most - max(watch.iterations, 1))
            monitor.iterations += max(second.iterations, 1)
            if again.status is Status.SOLVED:
                found, watch = again, second
            else:
                failed += 1
        waited += 1
        solved = found.status is Status.SOLVED
        new = found.r if solved or watch.best_r is None else watch.best_r
        new_error = monitor.record(new, W @ new + problem.q) if solved or watch.best <= INEXACT * error else np.inf
        if new_error <= monitor.tol:
            return Iterate(new, Status.SOLVED)
        if solved or new_error < 0.9 * error:
            r, error = new, new_error
            if error < least:
                best, least, waited = r, error, 0
            if error <= RUNAWAY * least:
                if solved:
                    alpha = max(floor, alpha * (0.3 if watch.iterations <= 4 else 0.6 if watch.iterations <= 8 else 1.0))
                floor *= 0.7
                yield
                continue
            r, error = best, least
            alpha *= options.rise
        # what failed is left behind: well above it for a while, with the other formulation
        alpha *= options.rise
        floor = alpha
        formulation = "NM" if formulation == "AC" else "AC"
        if alpha > LARGEST_ALPHA:
            break
        yield
    return Iterate(best, Status.STAGNATED)
