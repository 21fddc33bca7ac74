"""ROLLING-FP, ROLLING-EG and ROLLING-ADMM: projections on the cone of five or six dimensions, alone and after a linear step.

Sources: Acary, Bourrier, "Coulomb friction with rolling resistance as a cone complementarity problem", European Journal of Mechanics
A/Solids 85, 2021, for sliding and rolling; spinning is one disk more. Boyd et al., Found. Trends Mach. Learn. 3, 2011 (ADMM, see
`fcsim.solvers.variational.admm`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.problem.rolling import LocalRollingProblem, modified_velocity
from fcsim.solvers.base import Iterate, Monitor
from fcsim.solvers.variational.admm import AdmmOptions, split
from fcsim.solvers.variational.convex_sets import RollingCone
from fcsim.solvers.variational.inequality import Inequality
from fcsim.solvers.variational.projection import ProjectionOptions, project
from fcsim.solvers.variational.watches import ProblemWatch


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

    def term(self, u: FloatArray) -> FloatArray:
        """g(u) (m,)."""
        return self.map(u) - u


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


def rolling_admm(problem: LocalRollingProblem, r: FloatArray, monitor: Monitor, options: AdmmOptions) -> Iterate:
    """ROLLING-ADMM: r <- (W + rho I)^-1 (rho (z - zeta) - q - g), z <- P_K(r + zeta), zeta <- zeta + r - z, g from u = -rho zeta - g."""
    for name, usual in (("linear", "auto"), ("rescaling", "none"), ("symmetry", "check")):
        if getattr(options, name) != usual:  # of Coulomb's cone alone
            raise InputError(f"option {name}: expected {usual!r} with rolling friction, got {getattr(options, name)!r}")
    inequality = _inequality(problem)
    return split(inequality, r, ProblemWatch(inequality.velocity, monitor, options.max_iterations), options)
