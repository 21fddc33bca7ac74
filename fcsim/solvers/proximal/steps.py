"""The proximal point algorithm: a sequence of problems with W + alpha D, each solved by another method of the table.

With the centre r_k, solve W r + q + alpha D (r - r_k) = u, K* ∋ u + g(u) ⊥ r ∈ K for r_k+1, that is the problem (W + alpha D,
q - alpha D r_k). A fixed point solves the problem itself, whatever alpha; alpha D makes rank-deficient (hyperstatic) W regular and pulls
Newton into its basin. alpha falls while the inner problems are easy and grows where they fail. An inner problem that was not solved still
gives a step if that brings the error down.

The lines of the solver table are options: Siconos' PROX is alpha I with NSN-AC or Gauss-Seidel inside, PROX-NEWTON has the metric of the
contacts' own compliances.

Sources: Rockafellar, SIAM J. Control Optim. 14, 1976; Acary, Brémond, Huber 2018 (PPA); options of Siconos' PROX. The metric of the
compliances and the steps from inner problems that were not solved are our own.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.problem import LocalProblem
from fcsim.problem.rolling import LocalRollingProblem
from fcsim.solvers.base import Iterate, Monitor, Status
from fcsim.solvers.proximal.inner import InnerProblems, Inside
from fcsim.solvers.proximal.options import ProximalOptions, Regularisation
from fcsim.solvers.turns import Turns, to_the_end

INEXACT, SUFFICIENT = 0.5, 0.9
"""Reduction of the inner residual and of the error at which an inner problem that was not solved still gives a step."""
LEAST_GAIN = 0.99
"""Factor that a better error takes off the best one, or it counts as waiting."""
RUNAWAY = 1e4
"""Growth of the error over the best one at which the best iterate is taken up again. Bodies that slide on more points than they need have
iterates that no short way improves: the proximal steps lead on through errors some hundred times as large. Who goes back at 100 stays."""
MOST_ALPHA = 1e6
"""Regularisation beyond which a step is no step."""
MOST = 10**9
"""Internal iterations where steps are counted: the internal method has its own limit."""


def proximal_point(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: ProximalOptions) -> Iterate:
    """The proximal point algorithm from the starting point r (m,)."""
    return to_the_end(proximal_turns(problem, r, monitor, options))


def proximal_turns(
    problem: LocalProblem | LocalRollingProblem, r: FloatArray, monitor: Monitor, options: ProximalOptions, inside: Inside | None = None
) -> Turns:
    """The same by turns of one inner problem each; inside: as in `InnerProblems`."""
    inner, by_steps, moving = InnerProblems(problem, monitor, options, inside), options.counts == "steps", options.strategy == "prox"
    W, q, origin = problem.delassus, problem.q, np.zeros_like(r)
    error = monitor.record(r, W @ r + q)
    regularisation = Regularisation.first(error, options)
    best, least, waited = r, error, 0
    while not error <= monitor.tol:
        status = _why_stop(error, waited, monitor, options)
        if status is not None:
            return Iterate(best, status)
        target = max(monitor.tol, min(error, 1.0)) / options.internal_error_ratio
        most = MOST if by_steps else options.max_iterations - monitor.iterations
        found, watch = inner.solve(r, r if moving else origin, regularisation.alpha, target, most)
        monitor.iterations += 1 if by_steps else max(watch.iterations, 1)
        solved, reached = found.status is Status.SOLVED, watch.best * watch.scale / monitor.scale
        new = r + options.relaxation * (found.r - r)
        new_error = monitor.record(new, W @ new + q) if solved or reached <= error else np.inf
        waited = 0 if new_error < LEAST_GAIN * least else waited + 1
        good = solved or new_error <= monitor.tol or (new_error < SUFFICIENT * error and reached <= INEXACT * error)
        if good or new_error < error:
            r, error = new, new_error
            if error < least:
                best, least = r, error
        if found.status is Status.TIME_LIMIT:
            continue
        if not moving:
            regularisation = regularisation.fallen(options)
            if not solved or regularisation.alpha < options.alpha_least:
                return Iterate(best, Status.SOLVED if error <= monitor.tol else Status.STAGNATED if solved else found.status)
        elif good and error <= RUNAWAY * least:
            regularisation = regularisation.after_success(error, watch.iterations, options) if solved else regularisation
        else:
            if error > RUNAWAY * least:
                r, error = best, least
            regularisation = regularisation.after_failure(options)
            if regularisation.alpha > MOST_ALPHA:
                return Iterate(best, Status.STAGNATED)
        yield
    return Iterate(r, Status.SOLVED)


def _why_stop(error: float, waited: int, monitor: Monitor, options: ProximalOptions) -> Status | None:
    """Why to stop before the next step, None to go on."""
    if (stopped := monitor.stopped(error, options.max_iterations)) is not None:
        return stopped
    return Status.STAGNATED if waited >= options.patience else None
