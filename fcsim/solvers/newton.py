"""Nonsmooth Newton on the local problem: (A W + B) dr = -F with u = W r + q.

Sources: Alart and Curnier, Comput. Methods Appl. Mech. Eng. 92, 1991; Acary, Brémond, Huber 2018 (formulations, rho and line searches).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fcsim.errors import InputError
from fcsim.linear import SingularMatrix
from fcsim.problem import LocalProblem
from fcsim.solvers.base import Iterate, Monitor, Options, Status, choice
from fcsim.solvers.formulations import FORMULATIONS, Formulation
from fcsim.solvers.newton_system import SYSTEMS, NewtonSystem
from fcsim.solvers.scaling import RHO_RULES

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class NewtonOptions(Options):
    """formulation: AC, JM, NM; rho: rule of `scaling`, times rho_factor; line_search: none (NLS), Goldstein-Price, Armijo;
    linear: how (A W + B) dr = -F is solved ("auto" chooses from size and density; "kkt" keeps the global form, see newton_global).
    """

    formulation: str = "AC"
    rho: str = "split spectral norm"
    rho_factor: float = 1.0
    line_search: str = "none"
    linear: str = "auto"

    def __post_init__(self) -> None:
        super().__post_init__()
        choice("formulation", self.formulation, FORMULATIONS)
        choice("rho", self.rho, RHO_RULES)
        choice("line_search", self.line_search, LINE_SEARCHES)
        choice("linear", self.linear, ("auto", "kkt", *SYSTEMS))
        if not self.rho_factor > 0:
            raise InputError(f"option rho_factor: expected a number > 0, got {self.rho_factor}")


Merit = Callable[[float], float]


def no_line_search(merit: Merit, value: float, slope: float) -> float:
    """Full steps (NLS)."""
    return 1.0


def goldstein_price(merit: Merit, value: float, slope: float, m1: float = 0.01, m2: float = 0.99, trials: int = 20) -> float:
    """Goldstein-Price: m2 slope <= (merit(t) - merit(0)) / t <= m1 slope by bracketing and bisection."""
    low, high, t = 0.0, np.inf, 1.0
    for _ in range(trials):
        rate = (merit(t) - value) / t
        if not rate <= m1 * slope:
            high = t
        elif rate < m2 * slope:
            low = t
        else:
            return t
        t = 2 * t if np.isinf(high) else 0.5 * (low + high)
    return t


def armijo(merit: Merit, value: float, slope: float, m1: float = 1e-4, trials: int = 20) -> float:
    """Armijo: halve t until merit(t) <= merit(0) + m1 t slope."""
    t = 1.0
    for _ in range(trials):
        if merit(t) <= value + m1 * t * slope:
            return t
        t *= 0.5
    return t


LINE_SEARCHES: dict[str, Callable[[Merit, float, float], float]] = {
    "none": no_line_search,
    "Goldstein-Price": goldstein_price,
    "Armijo": armijo,
}


def newton(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: NewtonOptions) -> Iterate:
    """Nonsmooth Newton from the starting point r (m,)."""
    rho = RHO_RULES[options.rho](problem.diagonal_blocks) * options.rho_factor
    formulation = FORMULATIONS[options.formulation]
    system: NewtonSystem = SYSTEMS[_linear(problem, options)](problem.W, problem.dimension)
    line_search = LINE_SEARCHES[options.line_search]
    shape = (problem.nc, problem.dimension)
    Wr = problem.W @ r
    while True:
        u = Wr + problem.q
        error = monitor.record(r, u)
        if error <= monitor.tol:
            return Iterate(r, Status.SOLVED)
        if not np.isfinite(error):
            return Iterate(r, Status.DIVERGED)
        if monitor.iterations >= options.max_iterations:
            return Iterate(r, Status.MAX_ITERATIONS)
        if monitor.out_of_time():
            return Iterate(r, Status.TIME_LIMIT)
        F, A, B = formulation(u.reshape(shape), r.reshape(shape), problem.mu, rho)
        try:
            dr = system.solve(A, B, -F)
        except SingularMatrix:
            return Iterate(r, Status.SINGULAR)
        Wdr = problem.W @ dr
        t = 1.0
        if options.line_search != "none":
            merit = _merit(formulation, u, Wdr, r, dr, problem.mu, rho)
            value = 0.5 * float(np.sum(F * F))
            t = line_search(merit, value, -2 * value)  # along the Newton direction the slope of 0.5 ||F||^2 is -||F||^2
        r = r + t * dr
        # W r is recomputed now and then only: the update is exact up to round-off, which the final error would show
        Wr = problem.W @ r if monitor.iterations % 8 == 7 else Wr + t * Wdr
        monitor.iterations += 1


def _merit(
    formulation: Formulation, u: FloatArray, Wdr: FloatArray, r: FloatArray, dr: FloatArray, mu: FloatArray, rho: FloatArray
) -> Merit:
    shape = rho.shape

    def merit(t: float) -> float:
        F = formulation((u + t * Wdr).reshape(shape), (r + t * dr).reshape(shape), mu, rho)[0]
        return 0.5 * float(np.sum(F * F))

    return merit


def _linear(problem: LocalProblem, options: NewtonOptions) -> str:
    """The linear algebra behind "auto": condensed elimination for AC and JM on a dense W, dense LU otherwise, sparse for sparse W."""
    if options.linear not in ("auto", "kkt"):
        return options.linear
    if not isinstance(problem.W, np.ndarray):
        return "sparse"
    return "dense" if options.formulation == "NM" else "condensed"
