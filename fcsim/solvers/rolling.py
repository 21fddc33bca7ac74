"""Methods for contact with rolling and spinning friction: Gauss-Seidel and projections on the cone of five or six dimensions.

Source: Acary, Bourrier, "Coulomb friction with rolling resistance as a cone complementarity problem", European Journal of Mechanics
A/Solids 85, 2021, where both families are extended from Coulomb's cone to sliding and rolling; spinning is one disk more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.problem.delassus import Delassus
from fcsim.problem.rolling import LocalRollingProblem, modified_velocity
from fcsim.solvers._rolling_kernels import sweep
from fcsim.solvers.base import Iterate, Monitor, Options, Status
from fcsim.solvers.variational.convex_sets import RollingCone
from fcsim.solvers.variational.inequality import Inequality
from fcsim.solvers.variational.projection import ProjectionOptions, project
from fcsim.solvers.variational.watches import ProblemWatch


@dataclass(frozen=True, kw_only=True)
class RollingSweepOptions(Options):
    """local_iterations: projections a contact and sweep, at most."""

    max_iterations: int = 20_000
    local_iterations: int = 50

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.local_iterations < 1:
            raise InputError(f"option local_iterations: expected an integer >= 1, got {self.local_iterations}")


@dataclass(frozen=True, eq=False)
class RollingInequality(Inequality):
    """Find r in K with F(r) . (s - r) >= 0 for all s in K, F(r) = u + g(u) with the g of rolling and spinning friction."""

    mu_r: FloatArray | None = None
    mu_s: FloatArray | None = None

    @property
    def lipschitz(self) -> float:
        """||W|| times the largest singular value of [[1, c], [0, 1]], c^2 = mu^2 + mu_r^2 + mu_s^2 (g is Lipschitz with c)."""
        assert self.mu is not None and self.mu_r is not None
        c = float(np.hypot(np.hypot(self.mu, self.mu_r), 0.0 if self.mu_s is None else self.mu_s).max(initial=0.0))
        return self.operator.norm * 0.5 * (c + np.sqrt(c * c + 4))

    def map(self, u: FloatArray) -> FloatArray:
        """F (m,) where u = W r + q is known."""
        assert self.mu is not None and self.mu_r is not None
        return modified_velocity(self._rows(u), self.mu, self.mu_r, self.mu_s).ravel()


def _inequality(problem: LocalRollingProblem) -> RollingInequality:
    p = problem
    return RollingInequality(p.delassus, p.q, RollingCone(p.mu, p.mu_r, p.spinning), p.mu, mu_r=p.mu_r, mu_s=p.mu_s)


def rolling_fixed_point(problem: LocalRollingProblem, r: FloatArray, monitor: Monitor, options: ProjectionOptions) -> Iterate:
    """ROLLING-FP: r <- P_K(r - rho (u + g(u)))."""
    inequality = _inequality(problem)
    return project(inequality, r, ProblemWatch(inequality.velocity, monitor, options.max_iterations), options, corrector=False)


def rolling_extragradient(problem: LocalRollingProblem, r: FloatArray, monitor: Monitor, options: ProjectionOptions) -> Iterate:
    """ROLLING-EG: rbar = P_K(r - rho F(r)), r <- P_K(r - rho F(rbar))."""
    inequality = _inequality(problem)
    return project(inequality, r, ProblemWatch(inequality.velocity, monitor, options.max_iterations), options, corrector=True)


def rolling_sweeps(problem: LocalRollingProblem, r: FloatArray, monitor: Monitor, options: RollingSweepOptions) -> Iterate:
    """ROLLING-NSGS: contact after contact is solved by projections on its cone, with the other reactions as they are."""
    p, operator = problem, problem.delassus
    rows, own = operator.blocks, np.ascontiguousarray(operator.diagonal_blocks)
    spinning, d = p.spinning, p.dimension
    rho = _step_sizes(own, np.sqrt(p.mu**2 + p.mu_r**2 + spinning**2))
    r = r.reshape(-1, d).copy()
    q = p.q.reshape(-1, d)
    while True:
        error = monitor.record(r.ravel(), _velocity(operator, r, p.q))
        if error <= monitor.tol:
            return Iterate(r.ravel(), Status.SOLVED)
        if (stopped := monitor.stopped(error, options.max_iterations)) is not None:
            return Iterate(r.ravel(), stopped)
        before = r.copy()
        sweep(rows, own, q, p.mu, p.mu_r, spinning, r, rho, options.local_iterations)
        monitor.iterations += 1
        if np.array_equal(before, r):  # a fixed point in floating point, with an error above the tolerance
            return Iterate(r.ravel(), Status.STAGNATED)


def _velocity(operator: Delassus, r: FloatArray, q: FloatArray) -> FloatArray:
    return operator.affine(r.ravel(), q)


def _step_sizes(own: FloatArray, c: FloatArray) -> FloatArray:
    """1 / an upper bound of the Lipschitz constant of each contact's F (nc,), 0 where its bodies are held; c (nc,): that of its g."""
    norm = np.sqrt(np.einsum("aij,aij->a", own, own))  # Frobenius: no less than the spectral norm
    lipschitz = norm * 0.5 * (c + np.sqrt(c * c + 4))
    return np.divide(1.0, lipschitz, out=np.zeros_like(lipschitz), where=lipschitz > 0)
