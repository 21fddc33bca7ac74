"""Coulomb's law as a fixed point over convex programs: TRESCA, CYLINDER-QP, FP-VI-CYL, PANA, ACLM, IPM and the relaxation SOCLCP.

Sources: Haslinger, Math. Methods Appl. Sci. 5, 1983 (Tresca's threshold); Panagiotopoulos, Ing.-Arch. 44, 1975 (alternation); Acary,
Cadoux, Lemaréchal, Malick, ZAMM 91, 2011 (ACLM); Acary, Brémond, Huber 2018. Defaults are those documented by Siconos 4.4.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator

from fcsim.arrays import FloatArray
from fcsim.problem import Delassus, LocalProblem
from fcsim.problem.reduction import Reduction
from fcsim.solvers.base import Iterate, Monitor, Options, Status, choice
from fcsim.solvers.variational.conic import clarabel_global
from fcsim.solvers.variational.convex import ENGINES, polished
from fcsim.solvers.variational.convex_sets import Cone, Cylinder, Disk
from fcsim.solvers.variational.inequality import Factors, Inequality, coulomb_term
from fcsim.solvers.variational.watches import SubproblemWatch, Watch


@dataclass(frozen=True, kw_only=True)
class FixedPointOptions(Options):
    """max_iterations: of the fixed point; internal: engine of the convex programs (`convex.ENGINES`), internal_iterations its cap.

    internal_tolerance_rule "adaptive": the programs are solved to the present error over internal_error_ratio; "given": to
    internal_tolerance, relative to ||q||. stagnation: fixed-point iterations without the error falling by a tenth before giving up.
    """

    max_iterations: int = 1000
    internal: str = "NSGS"
    internal_iterations: int = 10_000
    internal_tolerance_rule: str = "adaptive"
    internal_tolerance: float = 1e-10
    internal_error_ratio: float = 10.0
    stagnation: int = 200

    def __post_init__(self) -> None:
        super().__post_init__()
        choice("internal", self.internal, ENGINES)
        choice("internal_tolerance_rule", self.internal_tolerance_rule, ("adaptive", "given"))
        self.integers_from(internal_iterations=1)
        self.numbers_above(internal_tolerance=0)
        self.numbers_from(internal_error_ratio=1)
        self.integers_from(stagnation=1)


@dataclass(frozen=True, kw_only=True)
class AlternationOptions(FixedPointOptions):
    """internal_normal: the engine of the normal problem, an LCP (NSGS is projected Gauss-Seidel); internal: of the tangential one."""

    internal: str = "FP-VI-UPK"
    internal_normal: str = "NSGS"

    def __post_init__(self) -> None:
        super().__post_init__()
        choice("internal_normal", self.internal_normal, ENGINES)


@dataclass(frozen=True, kw_only=True)
class ConeProgramOptions(FixedPointOptions):
    """linear: "kkt" solves the programs in global form, in the velocities v, by Clarabel whatever `internal` says."""

    internal: str = "accelerated projected gradient"
    linear: str = "auto"

    def __post_init__(self) -> None:
        super().__post_init__()
        choice("linear", self.linear, ("auto", "kkt"))


Update = Callable[[FloatArray, FloatArray, float], FloatArray]
"""(r, u, natural residual to reach) -> the next r."""


def tresca(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: FixedPointOptions) -> Iterate:
    """TRESCA, CYLINDER-QP, FP-VI-CYL: the QP over half-cylinders of radius mu r_N, r_N from the last one."""
    operator, factors = problem.delassus, Factors()
    engine = ENGINES[options.internal]

    def update(r: FloatArray, u: FloatArray, target: float) -> FloatArray:
        radius = problem.mu * np.maximum(r[:: problem.dimension], 0)
        program = Inequality(operator, problem.q, Cylinder(radius), factors=factors)
        return engine(program, r, SubproblemWatch(program, monitor, target, options.internal_iterations)).r

    return _fixed_point(lambda r: problem.W @ r + problem.q, update, r, monitor, options)


def aclm(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: ConeProgramOptions) -> Iterate:
    """ACLM, IPM: the QP over second-order cones with the sliding velocity ||u_T|| of the last one in De Saxcé's term."""
    operator, factors = problem.delassus, Factors()
    engine = ENGINES[options.internal]

    def update(r: FloatArray, u: FloatArray, target: float) -> FloatArray:
        program = Inequality(operator, problem.q + coulomb_term(u, problem.mu, problem.dimension), Cone(problem.mu), factors=factors)
        return engine(program, r, SubproblemWatch(program, monitor, target, options.internal_iterations)).r

    return _fixed_point(lambda r: problem.W @ r + problem.q, update, r, monitor, options)


def aclm_global(reduction: Reduction, r: FloatArray, monitor: Monitor, options: ConeProgramOptions) -> Iterate:
    """ACLM, IPM on the global form: the programs in v by Clarabel, W is not formed but applied."""
    p = reduction.problem
    HT = sp.csr_array(p.H.T)
    free = reduction.velocity(np.zeros(p.m))[0]

    def compliance(r: FloatArray) -> FloatArray:
        return HT @ (reduction.velocity(r)[0] - free)

    operator = Delassus(LinearOperator((p.m, p.m), matvec=compliance, rmatvec=compliance, dtype=np.float64), p.dimension)

    def update(r: FloatArray, u: FloatArray, target: float) -> FloatArray:
        g = coulomb_term(u, p.mu, p.dimension)

        def by_clarabel(vi: Inequality, r: FloatArray, watch: Watch) -> Iterate:
            accuracy = float(np.clip(1e-3 * watch.target / monitor.scale, 1e-14, 1e-8))
            answer = vi.project(clarabel_global(p, reduction.velocity(r)[0], g, accuracy, monitor.scale))
            return Iterate(answer, watch.visit(answer, None, True) or Status.STAGNATED)

        program = Inequality(operator, reduction.q + g, Cone(p.mu))
        return polished(by_clarabel)(program, r, SubproblemWatch(program, monitor, target, options.internal_iterations)).r

    return _fixed_point(lambda r: HT @ reduction.velocity(r)[0] + p.w, update, r, monitor, options)


def soclcp(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: FixedPointOptions) -> Iterate:
    """SOCLCP: one program over second-order cones without De Saxcé's term, a convex relaxation of Coulomb's law.

    Contacts that slide open with u_N = mu ||u_T||, so its solution solves the problem only where nothing slides; elsewhere the error
    says so and the status is STAGNATED.
    """
    program = Inequality(problem.delassus, problem.q, Cone(problem.mu))
    target = monitor.tol * monitor.scale
    watch = SubproblemWatch(program, monitor, target, max(options.max_iterations - monitor.iterations, 0))
    iterate = ENGINES[options.internal](program, r, watch)
    monitor.iterations += watch.iterations
    error = monitor.record(iterate.r, program.velocity(iterate.r))
    if error <= monitor.tol:
        return Iterate(iterate.r, Status.SOLVED)
    return Iterate(iterate.r, Status.STAGNATED) if iterate.status.solved else iterate


def panagiotopoulos(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: AlternationOptions) -> Iterate:
    """PANA: the normal problem (an LCP in r_N) with r_T given, then the tangential QP over disks of radius mu r_N."""
    d, W = problem.dimension, problem.W
    normal = np.arange(0, len(problem.q), d)
    tangent = np.setdiff1d(np.arange(len(problem.q)), normal)
    if sp.issparse(W):
        W = sp.csr_array(W)
    W_NN, W_NT, W_TN, W_TT = (W[rows][:, columns] for rows in (normal, tangent) for columns in (normal, tangent))
    normal_operator, tangent_operator = Delassus(W_NN, 1), Delassus(W_TT, d - 1)
    normal_factors, tangent_factors = Factors(), Factors()
    q_N, q_T = problem.q[normal], problem.q[tangent]

    def update(r: FloatArray, u: FloatArray, target: float) -> FloatArray:
        r_N, r_T = r[normal], r[tangent]
        program = Inequality(normal_operator, q_N + W_NT @ r_T, Cylinder(np.zeros(problem.nc)), factors=normal_factors)
        r_N = ENGINES[options.internal_normal](program, r_N, SubproblemWatch(program, monitor, target, options.internal_iterations)).r
        program = Inequality(tangent_operator, q_T + W_TN @ r_N, Disk(problem.mu * r_N), factors=tangent_factors)
        r_T = ENGINES[options.internal](program, r_T, SubproblemWatch(program, monitor, target, options.internal_iterations)).r
        new = np.empty_like(r)
        new[normal], new[tangent] = r_N, r_T
        return new

    return _fixed_point(lambda r: problem.W @ r + problem.q, update, r, monitor, options)


def _fixed_point(
    velocity: Callable[[FloatArray], FloatArray], update: Update, r: FloatArray, monitor: Monitor, options: FixedPointOptions
) -> Iterate:
    """Repeat `update` until solved; the programs are solved the more exactly the smaller the error and the longer it did not fall."""
    u = velocity(r)
    error = monitor.record(r, u)
    least, since, sharpening = error, 0, 1.0
    while not error <= monitor.tol:
        if (stopped := monitor.stopped(error, options.max_iterations)) is not None:
            return Iterate(r, stopped)
        tolerance = options.internal_tolerance
        if options.internal_tolerance_rule == "adaptive":
            tolerance = min(error, 1.0) / options.internal_error_ratio
        new = update(r, u, max(sharpening * tolerance, 1e-15) * monitor.scale)
        monitor.iterations += 1
        if not np.all(np.isfinite(new)):
            return Iterate(r, Status.DIVERGED)
        still = bool(np.array_equal(new, r))
        r = new
        u = velocity(r)
        error = monitor.record(r, u)
        since += 1
        if error < 0.9 * least:
            least, since = error, 0
        if still or since % 10 == 9:
            sharpening *= 0.1
        if since >= options.stagnation or sharpening < 1e-15:
            return Iterate(r, Status.SOLVED if error <= monitor.tol else Status.STAGNATED)
    return Iterate(r, Status.SOLVED)
