"""The proximal point algorithm: a sequence of problems with W + alpha I, each solved by another method of the table.

With the proximal centre r_k, solve W r + q + alpha (r - r_k) = u, K* ∋ u + g(u) ⊥ r ∈ K for r_k+1, that is the problem (W + alpha I,
q - alpha r_k). A fixed point solves the problem itself, whatever alpha; alpha I makes rank-deficient (hyperstatic) W regular.
Sources: Rockafellar, SIAM J. Control Optim. 14, 1976; Acary, Brémond, Huber 2018 (PPA); options of Siconos' PROX.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.problem import LocalProblem
from fcsim.solvers.base import Iterate, Monitor, Options, Status, choice, override


@dataclass(frozen=True, kw_only=True)
class ProximalOptions(Options):
    """max_iterations counts proximal steps; numbers named alpha are relative to the mean of W's diagonal.

    internal             name of the method that solves the regularised problems; internal_options: its options where not the default
    strategy             "prox": the centre moves to each solution; "regularisation": the centre stays 0 and alpha falls by sigma
                         at each step (Tikhonov), which ends where the internal method fails or alpha passes alpha_least
    alpha                first (or constant) regularisation
    alpha_rule           "constant"; "error": sigma error^nu; "adaptive": divided by sigma after a step whose inner problem was easy
                         (within `easy` internal iterations)
    relaxation           omega of r_k+1 = r_k + omega (new - r_k)
    internal_error_ratio inner problems are solved to error / ratio
    patience             proximal steps without a better error before giving up

    Whatever the rule, alpha is raised tenfold where the internal method fails, and stays there but for the adaptive rule.
    """

    max_iterations: int = 1000
    internal: str = "NSN-AC"
    internal_options: Mapping[str, Any] = field(default_factory=dict)
    strategy: str = "prox"
    alpha: float = 1e-4
    alpha_rule: str = "adaptive"
    alpha_least: float = 1e-9
    sigma: float = 5.0
    nu: float = 1.0
    easy: int = 8
    relaxation: float = 1.0
    internal_error_ratio: float = 10.0
    patience: int = 50

    def __post_init__(self) -> None:
        super().__post_init__()
        choice("strategy", self.strategy, ("prox", "regularisation"))
        choice("alpha_rule", self.alpha_rule, ALPHA_RULES)
        for name in ("alpha", "alpha_least", "sigma", "internal_error_ratio"):
            if not getattr(self, name) > 0:
                raise InputError(f"option {name}: expected a number > 0, got {getattr(self, name)}")
        if not self.nu >= 0:
            raise InputError(f"option nu: expected a number >= 0, got {self.nu}")
        if not 0 < self.relaxation < 2:
            raise InputError(f"option relaxation: expected a number in (0, 2), got {self.relaxation}")
        for name in ("easy", "patience"):
            if getattr(self, name) < 1:
                raise InputError(f"option {name}: expected an integer >= 1, got {getattr(self, name)}")


def _constant(alpha: float, error: float, inner_iterations: int, options: ProximalOptions) -> float:
    return options.alpha


def _error(alpha: float, error: float, inner_iterations: int, options: ProximalOptions) -> float:
    return options.sigma * error**options.nu


def _adaptive(alpha: float, error: float, inner_iterations: int, options: ProximalOptions) -> float:
    return alpha / options.sigma if inner_iterations <= options.easy else alpha


ALPHA_RULES: dict[str, Callable[[float, float, int, ProximalOptions], float]] = {
    "constant": _constant,
    "error": _error,
    "adaptive": _adaptive,
}
"""next alpha = rule(alpha, error of the iterate, iterations of the last inner problem, options)."""

MOST_ALPHA = 1e6
"""Regularisation, relative to W's diagonal, beyond which a step is no step."""


def _inner_monitor(inner: LocalProblem, error: float, monitor: Monitor, options: ProximalOptions) -> Monitor:
    """Watch an inner problem until its residual, in the outer problem's unit, is error / ratio."""
    watch = monitor.inner(inner.q, 1.0, floor=monitor.scale)
    watch.tol = monitor.scale / watch.scale * min(max(error, monitor.tol), 1.0) / options.internal_error_ratio
    return watch


def proximal_point(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: ProximalOptions) -> Iterate:
    """Proximal point algorithm from the starting point r (m,)."""
    from fcsim.solvers import method  # the table names this method

    internal = method(options.internal)
    if problem.dimension not in internal.dimensions:
        raise InputError(f"option internal: {options.internal!r} does not work in {problem.dimension}D")
    own = override(internal.options, dict(options.internal_options))
    moving = options.strategy == "prox"
    scale = float(np.abs(problem.delassus.diagonal).mean()) or 1.0
    error = monitor.record(r, problem.W @ r + problem.q)
    alpha = _error(0.0, error, 0, options) if options.alpha_rule == "error" else options.alpha
    alpha_least, least, waited = options.alpha_least, error, 0
    W, shift = problem.W, 0.0
    while not error <= monitor.tol:
        if not np.isfinite(error):
            return Iterate(r, Status.DIVERGED)
        if monitor.iterations >= options.max_iterations:
            return Iterate(r, Status.MAX_ITERATIONS)
        if monitor.out_of_time():
            return Iterate(r, Status.TIME_LIMIT)
        if shift != alpha * scale:
            shift = alpha * scale
            W = problem.delassus.shifted(shift).W
        q = problem.q - shift * r if moving else problem.q
        inner = LocalProblem(W, q, problem.mu, dimension=problem.dimension)
        watch = _inner_monitor(inner, error, monitor, options)
        iterate = internal.run(inner, r, watch, own)
        monitor.iterations += 1
        solved = iterate.status is Status.SOLVED
        found = iterate.r if solved or watch.best_r is None else watch.best_r
        new = r + options.relaxation * (found - r)
        new_error = monitor.record(new, problem.W @ new + problem.q)
        if solved or new_error < error:
            r, error = new, new_error
        waited = 0 if error < 0.99 * least else waited + 1
        least = min(least, error)
        if waited >= options.patience:
            return Iterate(r, Status.STAGNATED)
        if not moving:
            if not solved and iterate.status is not Status.TIME_LIMIT:
                return Iterate(r, iterate.status if error > monitor.tol else Status.SOLVED)
            alpha /= options.sigma
            if alpha < alpha_least:
                return Iterate(r, Status.STAGNATED if error > monitor.tol else Status.SOLVED)
        elif solved:
            alpha = max(ALPHA_RULES[options.alpha_rule](alpha, error, watch.iterations, options), alpha_least)
        elif iterate.status is not Status.TIME_LIMIT:
            alpha *= 10
            if options.alpha_rule != "adaptive":  # which finds its way down again by itself
                alpha_least = alpha
            if alpha > MOST_ALPHA:
                return Iterate(r, Status.STAGNATED if error > monitor.tol else Status.SOLVED)
    return Iterate(r, Status.SOLVED)
