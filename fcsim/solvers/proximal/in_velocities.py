"""Newton on the problems inside the proximal point algorithm in the bodies' velocities, in one compiled call of some iterations.

An iteration of the general way is some forty small steps of Python, a fifth and more of it up to some hundred bodies. What is done here is
done as there, by `newton.iterations` with `newton.systems.velocity`: its twin in the tests.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.problem import LocalProblem
from fcsim.solvers.base import Iterate, Monitor, Status
from fcsim.solvers.newton.options import NewtonOptions
from fcsim.solvers.newton.spaces import RECOMPUTED
from fcsim.solvers.newton.systems.choice import eliminated_in_velocities
from fcsim.solvers.newton.systems.velocity import bodies_of
from fcsim.solvers.proximal._velocity_kernels import ARRIVED, ENDLESS, ON_ITS_WAY, SINGULAR, newton_in_velocities
from fcsim.solvers.scaling import RHO_RULES, adaptive_range

UP_TO = 600
"""Velocities up to which one compiled loop is quicker; with 900 there is no difference any more."""
STATUSES = {SINGULAR: Status.SINGULAR, ENDLESS: Status.DIVERGED}


def newton_here(problem: LocalProblem, options: NewtonOptions) -> bool:
    """Whether the problems (W + diag(shift), q) of positive shifts are solved here: few velocities, PROX-NEWTON's options of the table."""
    operator = problem.delassus
    if not eliminated_in_velocities(operator) or operator.motion is None or operator.motion.M.shape[0] > UP_TO:
        return False
    return options == NewtonOptions(formulation="AC", rho="adaptive", max_iterations=options.max_iterations)


class NewtonInVelocities:
    """The internal method `NSN-AC` of a problem whose bodies have few velocities; see `proximal.inner.Inside`."""

    def __init__(self, problem: LocalProblem, options: NewtonOptions) -> None:
        self._problem, self._options = problem, options
        self._bodies = bodies_of(problem.delassus)
        self._arrays, self._mu = self._bodies.arrays(), problem.mu[self._bodies.order]

    def __call__(self, shift: FloatArray, q: FloatArray, r: FloatArray, watch: Monitor, most: int) -> Iterate:
        operator, most = self._problem.delassus.shifted(shift), min(self._options.max_iterations, most)
        order, shape = self._bodies.order, (operator.nc, operator.dimension)
        first = RHO_RULES["adaptive"](operator.diagonal_blocks)[order]
        own = (self._bodies.own + operator.by_unknown).reshape(shape)[order].ravel()
        rho, weights, target = first.copy(), watch.compliance[order], watch.tol * watch.scale
        while True:
            u = operator.affine(r, q)
            error = watch.record(r, u)
            if error <= watch.tol:
                return Iterate(r, Status.SOLVED)
            if watch.iterations >= most:
                return Iterate(r, Status.MAX_ITERATIONS)
            moving, u = r.reshape(shape)[order].ravel(), u.reshape(shape)[order].ravel()
            count = min(RECOMPUTED, most - watch.iterations)
            ended, done, best, residual = newton_in_velocities(
                *self._arrays, own, *adaptive_range(first), self._mu, weights, moving, u, rho, target, count
            )
            watch.iterations += done
            r = self._given(moving)
            if residual < watch.best * watch.scale:
                watch.best, watch.best_r = residual / watch.scale, self._given(best)
            if ended not in (ON_ITS_WAY, ARRIVED) or (ended == ARRIVED and not done):
                return Iterate(r, STATUSES.get(ended, Status.STAGNATED))

    def _given(self, r: FloatArray) -> FloatArray:
        """r (m,) of contacts in the bodies' order, in the problem's."""
        found = np.empty_like(r).reshape(len(self._mu), -1)
        found[self._bodies.order] = r.reshape(found.shape)
        return found.ravel()
