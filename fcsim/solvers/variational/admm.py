"""ADMM: alternating direction method of multipliers, in local and in global form, one factorisation for each rho.

Local form: min 0.5 x.W x + (q + g).x + I_K(z), x = z; global form: min 0.5 v.M v - f.v + I_K*(z), x = H^T v + w + g, x = z. Both read,
with the scaled multiplier zeta (the local form's -zeta rho is the velocity u + g, the global form's is the reaction r):

    1. x = linear step of z - zeta           (W + rho I or M + rho H H^T is factored once), local form: with 0.5 eta ||x - x_before||^2
    2. x <- alpha x + (1 - alpha) z          (over-relaxation)
    3. z = P(x + zeta), zeta <- zeta + x - z
    4. g = (mu ||u_T||, 0, 0) from the present tangential velocity: Coulomb's law instead of the convex relaxation

Sources: Boyd et al., Found. Trends Mach. Learn. 3, 2011 (ADMM, over-relaxation, residual balancing); Wohlberg, arXiv:1704.06209, 2017
(scaled residuals); Goldstein, O'Donoghue, Setzer, Baraniuk, SIAM J. Imaging Sci. 7, 2014 (acceleration with restart); Ghadimi et al.,
IEEE Trans. Automat. Control 60, 2015 (rho from the eigenvalues); Kanno 2021 and Siconos 4.4 (friction); Carpentier, Le Lidec, Montaut,
"From compliant to rigid contact simulation", Robotics: Science and Systems 2024 (spectral update of rho, proximal term eta). Their
compliance R of the contacts, u = (W + R) r + q, is part of the problem's W here, as `Compliant` and joints with springs put it there, so
that every method takes it; the eta of theirs is what keeps W + R + (rho + eta) I regular where rho falls.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, Matrix
from fcsim.errors import InputError
from fcsim.linear.factors import SingularMatrix
from fcsim.problem import Delassus, LocalProblem
from fcsim.problem.delassus import power_norm
from fcsim.problem.reduction import Reduction
from fcsim.solvers.base import Iterate, Monitor, Options, Status, choice
from fcsim.solvers.turns import Turns, to_the_end
from fcsim.solvers.variational._set_kernels import splitting_residuals
from fcsim.solvers.variational.inequality import Inequality, coulomb_term
from fcsim.solvers.variational.splittings import GlobalSplitting, LocalSplitting, forget_factor
from fcsim.solvers.variational.watches import LightCriterion, ProblemWatch, Watch

INITIAL_RHO = ("given", "norm", "eigenvalues")
RHO_UPDATES = ("constant", "residual balancing", "scaled residual balancing", "spectral")
ACCELERATIONS = ("none", "accelerated", "accelerated with restart")
SYMMETRIES = ("check", "assume", "symmetrise", "unsymmetric")
RESCALINGS = ("none", "scalar", "contacts")


@dataclass(frozen=True, kw_only=True)
class AdmmOptions(Options):
    """initial_rho: "given" (`rho`), "norm" (rho ||W||), "eigenvalues" (rho sqrt(lambda_min lambda_max) of W); of M, H in global form
    the same for W = H^T M^-1 H. rho_update: constant, or times / over `balancing_factor` where primal and dual residual differ by more
    than `balancing_ratio`, at most every `balancing_interval` iterations, an interval that doubles with each change; "spectral": with the
    factor (lambda_max / lambda_min)^spectral_power of W, so that 1 / spectral_power changes lead from one eigenvalue to the other, and an
    interval that stays (W alone, not with linear="kkt"). proximal: eta over ||W||, x is held to the last x by 0.5 eta ||x - x_before||^2
    (W alone); where rho is updated spectrally, eta is also the least that lambda_min counts.
    relaxation: alpha in (0, 2); acceleration, `restart_eta`: its factor of decrease. symmetry: check whether W is symmetric, assume
    it, replace W by its symmetric part, or treat it as unsymmetric. rescaling of r and u: none, by one number, by one for each contact.
    linear: "kkt" works on the global form without W.
    """

    max_iterations: int = 20_000
    initial_rho: str = "eigenvalues"
    rho: float = 1.0
    rho_update: str = "scaled residual balancing"
    balancing_factor: float = 5.0
    balancing_ratio: float = 5.0
    balancing_interval: int = 20
    spectral_power: float = 0.05
    proximal: float = 0.0
    relaxation: float = 1.0
    acceleration: str = "accelerated with restart"
    restart_eta: float = 0.999
    symmetry: str = "check"
    rescaling: str = "none"
    linear: str = "auto"

    def __post_init__(self) -> None:
        super().__post_init__()
        choice("initial_rho", self.initial_rho, INITIAL_RHO)
        choice("rho_update", self.rho_update, RHO_UPDATES)
        choice("acceleration", self.acceleration, ACCELERATIONS)
        choice("symmetry", self.symmetry, SYMMETRIES)
        choice("rescaling", self.rescaling, RESCALINGS)
        choice("linear", self.linear, ("auto", "kkt"))
        if not 0 < self.rho < float("inf"):
            raise InputError(f"option rho: expected a number > 0, got {self.rho}")
        if not 0 < self.relaxation < 2:
            raise InputError(f"option relaxation: expected a number between 0 and 2, got {self.relaxation}")
        for name in ("restart_eta", "spectral_power"):
            if not 0 < getattr(self, name) < 1:
                raise InputError(f"option {name}: expected a number between 0 and 1, got {getattr(self, name)}")
        self.numbers_above(balancing_factor=1, balancing_ratio=1)
        if not 0 <= self.proximal < float("inf"):
            raise InputError(f"option proximal: expected a number >= 0, got {self.proximal}")
        self.integers_from(balancing_interval=1)


def admm(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: AdmmOptions) -> Iterate:
    """ADMM on the local form."""
    if options.rescaling != "none" or options.symmetry not in ("check", "assume"):
        problem = problem.whole
    vi = Inequality.coulomb(problem)
    iterated = split(vi, r, ProblemWatch(vi.velocity, monitor, options.max_iterations), options, monitor)
    if not iterated.status.solved:
        forget_factor(monitor)  # the next attempt begins with a factor of its own
    return iterated


def admm_global(reduction: Reduction, r: FloatArray, monitor: Monitor, options: AdmmOptions) -> Iterate:
    """ADMM on the global form: W is not formed."""
    if options.rescaling != "none":
        raise InputError(f"option rescaling: expected 'none' with linear='kkt', got {options.rescaling!r}")
    if options.rho_update == "spectral":
        raise InputError("option rho_update: expected one that does without the eigenvalues of W with linear='kkt', got 'spectral'")
    if options.proximal:
        raise InputError(f"option proximal: expected 0 with linear='kkt', got {options.proximal}")
    p = reduction.problem
    HT = sp.csr_array(p.H.T)

    def velocity(r: FloatArray) -> FloatArray:
        return HT @ reduction.velocity(r)[0] + p.w

    splitting = GlobalSplitting(reduction)
    try:
        splitting.set_rho(options.rho * _global_scale(reduction, options.initial_rho))
    except SingularMatrix:
        return Iterate(r, Status.SINGULAR)

    def term(u: FloatArray) -> FloatArray:
        return coulomb_term(u, p.mu, p.dimension)

    return to_the_end(iterate(splitting, term, r, ProblemWatch(velocity, monitor, options.max_iterations), options))


def _global_scale(reduction: Reduction, initial_rho: str) -> float:
    """What the option rho is multiplied by: 1, ||M|| / ||H||^2, or 30 / ||W|| as W's least eigenvalue is not at hand."""
    p = reduction.problem
    if initial_rho == "given":
        return 1.0
    H, HT = sp.csr_array(p.H), sp.csr_array(p.H.T)
    if initial_rho == "norm":
        return power_norm(lambda v: p.M @ v, p.n) / (power_norm(lambda v: H @ (HT @ v), p.n) or 1.0)
    free = reduction.velocity(np.zeros(p.m))[0]
    return 30 / (power_norm(lambda r: HT @ (reduction.velocity(r)[0] - free), p.m) or 1.0)


class _Rescaled:
    """A watch that sees the scaled unknowns x = r / scale in their own unit."""

    def __init__(self, watch: Watch, scale: FloatArray) -> None:
        self._watch, self._scale = watch, scale
        self.target = watch.target * float(scale.min(initial=np.inf) if len(scale) else 1.0)  # of u scale, which is that much smaller
        self.compliance, self.speed = watch.compliance, watch.speed

    def visit(self, r: FloatArray, u: FloatArray | None, due: bool) -> Status | None:
        return self._watch.visit(self._scale * r, None if u is None else u / self._scale, due)

    def tick(self) -> None:
        self._watch.tick()


def split(vi: Inequality, r: FloatArray, watch: Watch, options: AdmmOptions, monitor: Monitor | None = None) -> Iterate:
    """ADMM on a variational inequality in local form; monitor: whose memory keeps the factor for the next problem."""
    return to_the_end(split_turns(vi, r, watch, options, monitor))


def split_turns(vi: Inequality, r: FloatArray, watch: Watch, options: AdmmOptions, monitor: Monitor | None = None) -> Turns:
    """The same by turns of one iteration each."""
    operator = vi.operator
    if options.symmetry == "symmetrise":
        operator = operator.symmetric_part
    if options.rescaling != "none":
        scale = _scales(operator, options.rescaling)
        W: Matrix
        if operator.is_sparse:
            W = sp.csr_array(sp.diags_array(scale) @ operator.matrix @ sp.diags_array(scale))
        else:
            W = scale[:, None] * operator.matrix * scale
        scaled = Inequality(Delassus(W, operator.dimension), scale * vi.q, vi.convex_set, vi.mu)
        iterated = yield from split_turns(scaled, r / scale, _Rescaled(watch, scale), replace(options, rescaling="none"))
        return Iterate(scale * iterated.r, iterated.status)
    if operator is not vi.operator:
        vi = Inequality(operator, vi.q, vi.convex_set, vi.mu)
    symmetric = options.symmetry in ("assume", "symmetrise") or (options.symmetry == "check" and operator.symmetric)
    splitting = LocalSplitting(vi, symmetric, monitor, options.proximal * operator.norm if options.proximal else 0.0)
    try:
        rho = options.rho * _local_scale(operator, options.initial_rho)
        if not splitting.resume(rho):
            splitting.set_rho(rho)
    except SingularMatrix:
        return Iterate(r, Status.SINGULAR)
    return (yield from iterate(splitting, None if vi.mu is None else vi.term, r, watch, options))


def _local_scale(operator: Delassus, initial_rho: str) -> float:
    """What the option rho is multiplied by: 1, ||W|| or sqrt(lambda_min lambda_max) of W."""
    if initial_rho == "given":
        return 1.0
    return operator.norm if initial_rho == "norm" else float(np.sqrt(operator.norm * operator.least_singular_value))


def _scales(operator: Delassus, rescaling: str) -> FloatArray:
    d = operator.dimension
    if rescaling == "scalar":
        return np.full(operator.size, 1 / np.sqrt(operator.norm))
    diagonal = operator.matrix.diagonal().reshape(-1, d).max(axis=1)
    positive = diagonal > 0
    diagonal = np.where(positive, diagonal, diagonal[positive].mean() if positive.any() else 1.0)
    return np.repeat(1 / np.sqrt(diagonal), d)


def _balancing(primal: float, dual: float, sizes: tuple[float, float], factor: float, options: AdmmOptions) -> float:
    """What rho is to be multiplied by, factor or its inverse: the primal residual falls and the dual one grows with rho."""
    if options.rho_update != "residual balancing":
        primal, dual = primal / (sizes[0] or 1.0), dual / (sizes[1] or 1.0)
    if primal > options.balancing_ratio * dual:
        return factor
    return 1 / factor if dual > options.balancing_ratio * primal else 1.0


def _factor(splitting: LocalSplitting | GlobalSplitting, options: AdmmOptions) -> float:
    """By what rho is changed: a constant, or a power of W's condition."""
    if options.rho_update == "spectral" and isinstance(splitting, LocalSplitting):
        return splitting.condition**options.spectral_power
    return options.balancing_factor


def iterate(
    splitting: LocalSplitting | GlobalSplitting,
    term: Callable[[FloatArray], FloatArray | float] | None,
    r: FloatArray,
    watch: Watch,
    options: AdmmOptions,
) -> Turns:
    """The iteration of both forms; z_hat, zeta_hat are the accelerated z, zeta. term: g of u, None where there is none."""
    z, zeta = splitting.start(r)
    z_hat, zeta_hat, momentum, energy = z, zeta, 1.0, np.inf
    g: FloatArray | float = 0.0 if term is None else term(splitting.velocity(z, zeta))
    light = LightCriterion(10 * watch.target)
    since, interval, change = 0, options.balancing_interval, _factor(splitting, options)
    status = watch.visit(splitting.answer(z, zeta), None, True)
    while status is None:
        x = splitting.linear(z_hat - zeta_hat, g)  # step 1
        y = zeta_hat + (x if options.relaxation == 1 else options.relaxation * x + (1 - options.relaxation) * z_hat)  # step 2
        z_last, zeta_last = z, zeta
        z = splitting.project(y)  # step 3
        zeta = y - z
        if term is not None:
            g = term(splitting.velocity(z, zeta))  # step 4
        watch.tick()
        since += 1
        rho = splitting.rho
        sums = splitting_residuals(x, z, zeta, z_hat, zeta_hat)
        primal, dual = math.sqrt(sums[0]), rho * math.sqrt(sums[1]) + splitting.moved
        watch.speed = rho * math.sqrt(float(zeta @ zeta))  # u + g(u) = -rho zeta once it has converged
        status = watch.visit(splitting.answer(z, zeta), None, light.due(splitting.gain * primal + splitting.dual_gain * dual))
        if primal == 0 and dual == 0 and status is None:
            status = Status.STAGNATED
        factor = 1.0
        if options.rho_update != "constant" and since >= interval and status is None:
            factor = _balancing(primal, dual, (float(np.linalg.norm(z)), rho * float(np.linalg.norm(zeta))), change, options)
        if factor != 1:
            try:
                splitting.set_rho(rho * factor)
            except SingularMatrix:
                return Iterate(splitting.answer(z, zeta), Status.SINGULAR)
            zeta = zeta / factor
            z_hat, zeta_hat, momentum, energy = z, zeta, 1.0, np.inf
            since, interval = 0, interval if options.rho_update == "spectral" else 2 * interval
        elif options.acceleration == "none":
            z_hat, zeta_hat = z, zeta
        else:
            last, energy = energy, rho * sums[2] + dual**2 / rho
            if options.acceleration == "accelerated" or energy < options.restart_eta * last:
                beta = momentum - 1
                momentum = 0.5 * (1 + math.sqrt(1 + 4 * momentum**2))
                beta /= momentum
                z_hat, zeta_hat = z + beta * (z - z_last), zeta + beta * (zeta - zeta_last)
            else:
                z_hat, zeta_hat, momentum, energy = z_last, zeta_last, 1.0, last / options.restart_eta
        yield
    return Iterate(splitting.answer(z, zeta), status)
