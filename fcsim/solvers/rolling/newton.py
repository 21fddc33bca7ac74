"""ROLLING-NSN and ROLLING-PROX: nonsmooth Newton on the equations of Alart and Curnier with a disk for each of sliding, rolling and
spinning, alone and inside the proximal point algorithm (`fcsim.solvers.proximal.steps`).

Sources: Alart, Curnier, Comput. Methods Appl. Mech. Eng. 92, 1991, extended from one disk to three; Rockafellar, SIAM J. Control Optim.
14, 1976.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.problem import Delassus
from fcsim.problem.rolling import LocalRollingProblem
from fcsim.solvers.base import Iterate, Monitor
from fcsim.solvers.newton.formulations import Formulation, Linearisation
from fcsim.solvers.newton.iterations import newton_iterations
from fcsim.solvers.newton.options import NewtonOptions
from fcsim.solvers.newton.spaces import LocalSpace
from fcsim.solvers.newton.systems.choice import newton_system
from fcsim.solvers.newton.systems.interface import NewtonSystem
from fcsim.solvers.proximal.options import ProximalOptions
from fcsim.solvers.proximal.steps import proximal_turns
from fcsim.solvers.rolling._equation_kernels import equations
from fcsim.solvers.turns import Turns, to_the_end


def _formulation(problem: LocalRollingProblem) -> Formulation:
    """F, A, B of (u, r, mu, rho) with the problem's three coefficients a contact."""
    coefficients = np.stack([problem.mu, problem.mu_r, problem.spinning], axis=1)

    def formulation(u: FloatArray, r: FloatArray, mu: FloatArray, rho: FloatArray) -> Linearisation:
        linearised: Linearisation = equations(np.ascontiguousarray(u), np.ascontiguousarray(r), coefficients, rho)
        return linearised

    return formulation


class RollingNewton:
    """Newton's method on (W + diag(shift), q), see `fcsim.solvers.proximal.inner.Inside`."""

    def __init__(self, problem: LocalRollingProblem, options: NewtonOptions) -> None:
        self._problem, self._options, self._formulation = problem, options, _formulation(problem)
        self._system: NewtonSystem | None = None

    def __call__(self, shift: FloatArray, q: FloatArray, r: FloatArray, watch: Monitor, most: int) -> Iterate:
        if self._system is None:
            self._system = _system(self._problem.delassus.shifted(shift))
        else:
            self._system = self._system.shifted(shift)
        options = replace(self._options, max_iterations=min(self._options.max_iterations, most))
        blocks = self._system.operator.diagonal_blocks
        return newton_iterations(LocalSpace(self._system, q, r), r, blocks, self._problem.mu, watch, options, self._formulation)


def _system(operator: Delassus) -> NewtonSystem:
    return newton_system(operator, condensing=False, once=True)


def rolling_newton(problem: LocalRollingProblem, r: FloatArray, monitor: Monitor, options: NewtonOptions) -> Iterate:
    """ROLLING-NSN from r (m,)."""
    blocks = np.ascontiguousarray(problem.delassus.diagonal_blocks)
    space = LocalSpace(_system(problem.delassus), problem.q, r)
    return newton_iterations(space, r, blocks, problem.mu, monitor, options, _formulation(problem))


def rolling_proximal(problem: LocalRollingProblem, r: FloatArray, monitor: Monitor, options: ProximalOptions) -> Iterate:
    """ROLLING-PROX from r (m,)."""
    return to_the_end(rolling_proximal_turns(problem, r, monitor, options))


def rolling_proximal_turns(problem: LocalRollingProblem, r: FloatArray, monitor: Monitor, options: ProximalOptions) -> Turns:
    """The same by turns of one inner problem each."""
    inside = RollingNewton(problem, NewtonOptions(rho="adaptive", max_iterations=15))
    return proximal_turns(problem, r, monitor, options, inside)
