"""Projection methods for the variational inequality: find r in C with F(r) . (s - r) >= 0 for all s in C.

Sources: De Saxcé, Feng, Math. Comput. Modelling 28, 1998 (fixed point on Coulomb's law); Korpelevich 1976 (extragradient); Konnov 1993
and Solodov, Svaiter, SIAM J. Control Optim. 37, 1999 (hyperplane projection); Khobotov, USSR Comput. Math. Math. Phys. 27, 1987, and
Solodov, Tseng, SIAM J. Control Optim. 34, 1996 (step sizes); Acary, Brémond, Huber 2018 for all of them on Coulomb's law. Defaults are
those documented by Siconos 4.4, except that a step size not given starts from the Lipschitz constant, in the unit of r / u.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.problem import LocalProblem
from fcsim.solvers.base import Iterate, Monitor, Options, Status, choice
from fcsim.solvers.variational.inequality import Inequality
from fcsim.solvers.variational.watches import ProblemWatch, Watch, least_residual


def khobotov_ratio(rho: float, dr: FloatArray, dF: FloatArray, change: float) -> float:
    """rho ||F(r) - F(rbar)|| / ||r - rbar|| (UPK)."""
    return rho * float(np.linalg.norm(dF)) / change


def solodov_tseng_ratio(rho: float, dr: FloatArray, dF: FloatArray, change: float) -> float:
    """rho (r - rbar) . (F(r) - F(rbar)) / ||r - rbar||^2 (UTK): never above Khobotov's, so it allows longer steps."""
    return rho * float(dr @ dF) / change**2


Ratio = Callable[[float, FloatArray, FloatArray, float], float]
RATIOS: dict[str, Ratio | None] = {"constant": None, "Khobotov": khobotov_ratio, "Solodov-Tseng": solodov_tseng_ratio}


@dataclass(frozen=True, kw_only=True)
class ProjectionOptions(Options):
    """rho: first (or constant) step size, None for 1 / Lipschitz constant of F.
    step_rule: "constant", or rho adapted so that the ratio stays below `L` (rho <- tau rho) and grows below `L_min` (rho <- rho / tau).
    """

    max_iterations: int = 20_000
    rho: float | None = None
    step_rule: str = "constant"
    tau: float = 2 / 3
    L: float = 0.9
    L_min: float = 0.3

    def __post_init__(self) -> None:
        super().__post_init__()
        choice("step_rule", self.step_rule, RATIOS)
        _step_size(self.rho)
        if not 0 < self.tau < 1:
            raise InputError(f"option tau: expected a number between 0 and 1, got {self.tau}")
        if not 0 < self.L_min < self.L < 1:
            raise InputError(f"options L_min and L: expected 0 < L_min < L < 1, got {self.L_min} and {self.L}")


@dataclass(frozen=True, kw_only=True)
class HyperplaneOptions(Options):
    """rho: step size, None for 1 / Lipschitz constant of F; tau: reduction of the line search; sigma: its required share of descent;
    search_iterations: its cap.
    """

    max_iterations: int = 20_000
    rho: float | None = None
    tau: float = 2 / 3
    sigma: float = 0.8
    search_iterations: int = 50

    def __post_init__(self) -> None:
        super().__post_init__()
        _step_size(self.rho)
        for name, value in (("tau", self.tau), ("sigma", self.sigma)):
            if not 0 < value < 1:
                raise InputError(f"option {name}: expected a number between 0 and 1, got {value}")
        self.integers_from(search_iterations=1)


def _step_size(rho: float | None) -> None:
    if rho is not None and not (0 < rho < float("inf")):
        raise InputError(f"option rho: expected a number > 0 or None, got {rho}")


def fixed_point(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: ProjectionOptions) -> Iterate:
    """FP-DS, FP, FP-VI-UPK, FP-VI-UTK: r <- P_K(r - rho (u + g(u)))."""
    inequality = Inequality.coulomb(problem)
    return project(inequality, r, ProblemWatch(inequality.velocity, monitor, options.max_iterations), options, corrector=False)


def extragradient(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: ProjectionOptions) -> Iterate:
    """EG, EG-VI-UPK, EG-VI-UTK: rbar = P_K(r - rho F(r)), r <- P_K(r - rho F(rbar))."""
    inequality = Inequality.coulomb(problem)
    return project(inequality, r, ProblemWatch(inequality.velocity, monitor, options.max_iterations), options, corrector=True)


def hyperplane(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: HyperplaneOptions) -> Iterate:
    """HP: project on the hyperplane that separates r from the solutions, then on K."""
    inequality = Inequality.coulomb(problem)
    return project_on_hyperplanes(inequality, r, ProblemWatch(inequality.velocity, monitor, options.max_iterations), options)


def project(vi: Inequality, r: FloatArray, watch: Watch, options: ProjectionOptions, corrector: bool) -> Iterate:
    """The fixed-point projection (corrector: the extragradient) method, with constant or self-adaptive step size.

    The change e_rho = ||r - P_C(r - rho F(r))|| comes with each step and tells for free when the error need not be computed
    (`least_residual`).
    """
    ratio = RATIOS[options.step_rule]
    safe = 0.5 * options.L / vi.lipschitz  # here a larger ratio is nothing but round-off
    rho = options.rho or (0.9 if corrector else 1.0) / vi.lipschitz
    u = vi.velocity(r)
    F = vi.map(u)
    while True:
        predicted, change = vi.step(r, F, rho)  # step 1: rbar = P_C(r - rho F(r))
        status = watch.visit(r, u, least_residual(watch, rho, change) <= watch.target or not np.isfinite(change))
        if status is not None:
            return Iterate(r, status)
        if change == 0:  # a fixed point in floating point, with an error above the tolerance
            return Iterate(r, Status.STAGNATED)
        u_predicted = vi.velocity(predicted)
        F_predicted = vi.map(u_predicted)
        value = ratio(rho, r - predicted, F - F_predicted, change) if ratio else options.L
        if value > options.L and rho > safe:  # step 2: shorten the step until the ratio is at most L
            rho *= options.tau
            watch.tick()
            continue
        if corrector:  # step 3: r = P_C(r - rho F(rbar)) or rbar
            r, _ = vi.step(r, F_predicted, rho)
            u = vi.velocity(r)
            F = vi.map(u)
        else:
            r, u, F = predicted, u_predicted, F_predicted
        if value < options.L_min:  # step 4: lengthen it for the next iteration
            rho /= options.tau
        watch.tick()


def project_on_hyperplanes(vi: Inequality, r: FloatArray, watch: Watch, options: HyperplaneOptions) -> Iterate:
    """The hyperplane projection method; u being affine in r, its line search costs no product with W."""
    rho = options.rho or 1.0 / vi.lipschitz
    shift, t = rho, 1.0
    u = vi.velocity(r)
    F = vi.map(u)
    while True:
        predicted, change = vi.step(r, F, rho)  # step 1: rbar = P_C(r - rho F(r))
        status = watch.visit(r, u, least_residual(watch, rho, change) <= watch.target or not np.isfinite(change))
        if status is not None:
            return Iterate(r, status)
        if change == 0:
            return Iterate(r, Status.STAGNATED)
        direction, du = predicted - r, vi.velocity(predicted) - u
        required, last, t = options.sigma / rho * change**2, t, 1.0
        for _ in range(options.search_iterations):  # step 2: y = r + t (rbar - r), F(y) . (r - rbar) >= sigma / rho ||r - rbar||^2
            F_y = vi.map(u + t * du)
            descent = -float(F_y @ direction)
            noise = 1e-14 * float(np.linalg.norm(F_y) * np.linalg.norm(r))
            if descent >= required or (t == last and required <= noise):  # below round-off the last search counts
                break
            t = last if required <= noise else t * options.tau
        if not descent > -noise:  # F is not monotone here
            return Iterate(r, Status.STAGNATED)
        r, shift = _project_on_half_space(vi, r, r + t * direction, F_y, shift, noise)  # step 3
        u = vi.velocity(r)
        F = vi.map(u)
        watch.tick()


def _project_on_half_space(
    vi: Inequality, r: FloatArray, y: FloatArray, F_y: FloatArray, shift: float, noise: float
) -> tuple[FloatArray, float]:
    """The projection of r on C and {s : F(y) . (s - y) <= 0}: P_C(r - shift F(y)) with the shift >= 0 that reaches the hyperplane.

    The excess F(y) . (P_C(r - shift F(y)) - y) falls with the shift; it is brought to a tenth of its first value by the secant method
    within a bracket, from the last iteration's shift, which stays where the excess is below the `noise` of its round-off. The published
    shift F(y) . (r - y) / ||F(y)||^2 is a lower bound, too short for fast convergence where F does not vanish at the solution.
    """
    low, excess_low = 0.0, float(F_y @ (r - y))
    high, excess_high = np.inf, 0.0
    enough = max(0.1 * excess_low, 10 * noise)
    for _ in range(60):
        trial, _ = vi.step(r, F_y, shift)
        excess = float(F_y @ (trial - y))
        if abs(excess) <= enough:
            break
        if excess > 0:
            low, excess_low = shift, excess
        else:
            high, excess_high = shift, excess
        if np.isinf(high):
            shift *= 2
        else:
            secant = low + (high - low) * excess_low / (excess_low - excess_high)
            shift = min(max(secant, low + 0.1 * (high - low)), high - 0.1 * (high - low))
    return trial, shift
