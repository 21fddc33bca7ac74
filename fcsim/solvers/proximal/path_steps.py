"""The proximal point algorithm whose inner problems are solved along paths where Newton's method does not find their solution.

Rigid bodies that slide on more points than they need have solutions to which proximal steps do not contract as long as alpha is above some
modes of friction (r_k+1 of alpha / (alpha - lambda), lambda > 0), while with alpha below them Newton's method cycles. So alpha falls
tenfold at every step, and where Newton's method does not arrive, the solution is followed from one status to the next (`path`); only where
that is lost too alpha rises.

Sources: as in `path` and `steps`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.problem import LocalProblem
from fcsim.solvers.base import Iterate, Monitor, Options, Status
from fcsim.solvers.proximal import _path_kernels as kernels
from fcsim.solvers.proximal.options import PROXIMAL_NEWTON
from fcsim.solvers.proximal.path import Regularised
from fcsim.solvers.proximal.pieces import pieces_of
from fcsim.solvers.proximal.steps import proximal_turns
from fcsim.solvers.turns import Turns, to_the_end


@dataclass(frozen=True, kw_only=True)
class PathOptions(Options):
    """max_iterations counts eliminations: Newton's iterations and pieces of paths alike.

    before        iterations of PROX-NEWTON before the first path
    newton        Newton's iterations before a path is followed
    newton_along  the same after a step that took a path
    pieces        pieces after which a path is given up, but where it is on its way: then after `longest`
    alpha         first regularisation over the error of the start, at most alpha_most; D is the contacts' compliances
    alpha_least   regularisation that it does not fall below
    fall, rise    by which alpha is divided after a step, multiplied where a path was lost
    along         by which it is divided after a step that took a path
    regained      by which it is divided after a step by Newton's method alone, since a path was lost and until one arrives
    patience      steps and lost paths without a better error before giving up
    """

    max_iterations: int = 10_000
    before: int = 60
    newton: int = 10
    newton_along: int = 10
    pieces: int = 200
    longest: int = 1600
    alpha: float = 1.0
    alpha_least: float = 1e-8
    alpha_most: float = 1e-2
    fall: float = 10.0
    rise: float = 30.0
    along: float = 10.0
    regained: float = 10.0
    patience: int = 150

    def __post_init__(self) -> None:
        super().__post_init__()
        self.numbers_above(alpha=0, alpha_least=0, alpha_most=0, fall=1, rise=1, along=1, regained=1)
        self.integers_from(before=0, newton=1, newton_along=0, pieces=0, longest=0, patience=1)


ROOT = 0.1
"""PROX-NEWTON's first alpha over the root of the error."""
INNER, NEAREST = 0.1, 1e-4
"""Residual of an inner problem over the best error, and at most."""
MOST_ALPHA = 1e6
"""Regularisation beyond which a step is no step."""
LEAST_GAIN = 0.99
"""Factor that a better error takes off the best one, or it counts as waiting."""


def proximal_path(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: PathOptions) -> Iterate:
    """PROX-NEWTON for `before` iterations from r (m,), then proximal steps along paths."""
    error = monitor.record(r, problem.W @ r + problem.q)
    if options.before and error > monitor.tol and np.isfinite(error):
        alpha, most = min(PROXIMAL_NEWTON.alpha, ROOT * float(np.sqrt(error))), min(options.before, options.max_iterations)
        iterate = to_the_end(proximal_turns(problem, r, monitor, replace(PROXIMAL_NEWTON, alpha=alpha, max_iterations=most)))
        if iterate.status in (Status.SOLVED, Status.TIME_LIMIT):
            return iterate
        r = iterate.r if monitor.best_r is None else monitor.best_r
    return to_the_end(path_turns(problem, r, monitor, options))


def path_turns(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: PathOptions) -> Turns:
    """Proximal steps along paths from r (m,), by turns of one step each."""
    shape = problem.nc, problem.dimension
    q, mu, operator = problem.q.reshape(shape), problem.mu, problem.delassus
    u = operator @ r + problem.q
    error = monitor.record(r, u)
    alpha, pieces = min(options.alpha * error, options.alpha_most), pieces_of(operator)
    best, least, waited, lost, newton = r, error, 0, False, options.newton
    while not error <= monitor.tol:
        status = monitor.stopped(error, options.max_iterations)
        if status is None and (waited >= options.patience or alpha > MOST_ALPHA):
            status = Status.STAGNATED
        if status is not None:
            return Iterate(best, status)
        alpha = max(alpha, options.alpha_least)
        inner = Regularised(pieces, q, mu, 1.0 / (alpha * operator.compliance), monitor)
        target = max(INNER * monitor.tol, min(INNER * least, NEAREST))
        found, along = _solved(inner, r.reshape(shape), u.reshape(shape), target, newton, options)
        waited += 1
        newton = options.newton_along if along and found is not None else options.newton
        if found is None:
            alpha, lost = alpha * options.rise, True
        else:
            lost = lost and not along
            alpha /= options.along if along else options.regained if lost else options.fall
            r = found.ravel()
            u = operator @ r + problem.q
            error = monitor.record(r, u)
            if error < LEAST_GAIN * least:
                waited = 0
            if error < least:
                best, least = r, error
        yield
    return Iterate(r, Status.SOLVED)


def _solved(
    inner: Regularised, r: FloatArray, u: FloatArray, target: float, newton: int, options: PathOptions
) -> tuple[FloatArray | None, bool]:
    """The reactions (nc, d) of the inner problem around r, u the velocities there, None where its solution was not found; and whether a
    path was followed, as where so many of Newton's iterations do not arrive."""
    z, status = kernels.beginning(r, u, inner.mu, inner.rho)
    centre, _ = kernels.law(z, inner.mu, inner.rho, status)
    free = centre - inner.rho[:, None] * (inner.pieces.product(centre) + inner.q)
    budget = options.max_iterations - inner.monitor.iterations
    found = inner.newton(free, centre, target, min(newton, budget))
    budget = options.max_iterations - inner.monitor.iterations
    along = found is None and options.pieces > 0
    if along:
        found = inner.end(z, status, target, options.newton, options.pieces, options.longest, budget)
    return found, along
