"""Newton on regularised problems (W + alpha D, q - alpha D r_k) of one W, alpha and r_k changing all the time."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.problem import LocalProblem
from fcsim.solvers.base import Iterate, Monitor
from fcsim.solvers.newton.iterations import newton_iterations
from fcsim.solvers.newton.options import NewtonOptions
from fcsim.solvers.newton.spaces import LocalSpace
from fcsim.solvers.newton.systems.choice import newton_system
from fcsim.solvers.newton.systems.interface import NewtonSystem, Shifted
from fcsim.solvers.scaling import contact_compliance

ADAPTED = {"AC": "adaptive", "NM": "spectral norm"}
"""The rule for rho by formulation where a constant one has failed."""
INNER_ITERATIONS = 15
"""Newton iterations after which a regularised problem counts as too hard."""
RHO_FACTOR = 10.0
"""Times the contact's own stiffness: through the other contacts of its bodies a contact of a pile is stiffer than by itself (measured)."""


class RegularisedNewton:
    """Solves the problems (W + alpha D, q - alpha D r_k), D the contacts' own compliances tr(W_aa) / d, by nonsmooth Newton.

    D makes the step of a heavy body's contact as long as that of a light one's; it is one number a contact, since another metric would
    turn the cone. Compliances that are not positive (both bodies held) are replaced by the mean of the others.
    """

    def __init__(self, problem: LocalProblem) -> None:
        self._problem = problem
        self._D = contact_compliance(problem)
        self._norm = float(np.linalg.norm(problem.q))
        self._systems: dict[bool, NewtonSystem] = {}  # by whether the formulation lets contacts be held

    def solve(
        self,
        r: FloatArray,
        alpha: float,
        tol: float,
        formulation: str,
        outer: Monitor,
        adaptive: bool = False,
        most: int = INNER_ITERATIONS,
    ) -> tuple[Iterate, Monitor]:
        """Return Newton's iterate from the centre r and its monitor, whose errors are relative to ||q|| of the problem itself.

        most: iterations that are left; adaptive: rho is found out on the way; slower than what suits most contacts, but with that one
        single contacts may cycle.
        """
        problem, shift, d = self._problem, alpha * self._D, self._problem.dimension
        q = problem.q - np.repeat(shift, d) * r
        watch = outer.inner(q, tol, floor=self._norm)
        rho = {"rho": ADAPTED[formulation]} if adaptive else {"rho_factor": RHO_FACTOR}
        options = NewtonOptions(formulation=formulation, max_iterations=min(most, INNER_ITERATIONS), **rho)
        condensing = formulation in ("AC", "JM")
        if condensing in self._systems:
            system = self._systems[condensing].shifted(shift)
        else:
            motion = None if problem.motion is None else problem.motion.of(problem.W)
            system = newton_system(Shifted(problem.W, d, shift, motion), condensing=condensing, once=True)
        self._systems[condensing] = system
        return newton_iterations(LocalSpace(system, q, r), r, system.operator.diagonal_blocks, problem.mu, watch, options), watch
