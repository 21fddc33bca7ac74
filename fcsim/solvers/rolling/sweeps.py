"""ROLLING-NSGS: Gauss-Seidel over contacts with rolling and spinning friction.

Source: Acary, Bourrier, "Coulomb friction with rolling resistance as a cone complementarity problem", European Journal of Mechanics
A/Solids 85, 2021, for sliding and rolling; spinning is one disk more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.problem.delassus import Delassus
from fcsim.problem.rolling import LocalRollingProblem
from fcsim.solvers.base import Iterate, Monitor, Options, Status
from fcsim.solvers.rolling._sweep_kernels import sweep
from fcsim.solvers.turns import Turns, to_the_end


@dataclass(frozen=True, kw_only=True)
class RollingSweepOptions(Options):
    """local_iterations: projections a contact and sweep, at most."""

    max_iterations: int = 20_000
    local_iterations: int = 50

    def __post_init__(self) -> None:
        super().__post_init__()
        self.integers_from(local_iterations=1)


def rolling_sweeps(problem: LocalRollingProblem, r: FloatArray, monitor: Monitor, options: RollingSweepOptions) -> Iterate:
    """ROLLING-NSGS: contact after contact is solved by projections on its cone, with the other reactions as they are."""
    return to_the_end(rolling_sweep_turns(problem, r, monitor, options))


def rolling_sweep_turns(problem: LocalRollingProblem, r: FloatArray, monitor: Monitor, options: RollingSweepOptions) -> Turns:
    """The same by turns of one sweep each."""
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
        yield


def _velocity(operator: Delassus, r: FloatArray, q: FloatArray) -> FloatArray:
    return operator.affine(r.ravel(), q)


def _step_sizes(own: FloatArray, c: FloatArray) -> FloatArray:
    """1 / an upper bound of the Lipschitz constant of each contact's F (nc,), 0 where its bodies are held; c (nc,): that of its g."""
    norm = np.sqrt(np.einsum("aij,aij->a", own, own))  # Frobenius: no less than the spectral norm
    lipschitz = norm * 0.5 * (c + np.sqrt(c * c + 4))
    return np.divide(1.0, lipschitz, out=np.zeros_like(lipschitz), where=lipschitz > 0)
