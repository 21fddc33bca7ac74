"""The problems (W + alpha D, q - alpha D r_k) inside the proximal point algorithm, D one number a contact, alpha and r_k changing.

D is diagonal with one number a contact, since another metric would turn the cone. Newton's method takes them without forming W + alpha D:
its linear system of one W is told the shift, and keeps what that leaves alone. Any other method gets a problem of its own.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.problem import LocalProblem
from fcsim.problem.rolling import LocalRollingProblem
from fcsim.solvers.base import Iterate, Method, Monitor, override
from fcsim.solvers.newton.iterations import newton, newton_iterations
from fcsim.solvers.newton.options import NewtonOptions
from fcsim.solvers.newton.spaces import LocalSpace
from fcsim.solvers.newton.systems.choice import newton_system
from fcsim.solvers.newton.systems.interface import NewtonSystem
from fcsim.solvers.proximal.in_velocities import NewtonInVelocities, newton_here
from fcsim.solvers.proximal.options import ProximalOptions


class Inside(Protocol):
    """Runs the internal method on the problem (W + diag(shift), q), shift (nc,), from r (m,) for at most so many iterations."""

    def __call__(self, shift: FloatArray, q: FloatArray, r: FloatArray, watch: Monitor, most: int) -> Iterate: ...


class InnerProblems:
    """The inner problems of one problem, and the internal method that solves them."""

    def __init__(
        self, problem: LocalProblem | LocalRollingProblem, monitor: Monitor, options: ProximalOptions, inside: Inside | None = None
    ) -> None:
        """inside: what solves them, the option's method where not given; InputError where that does not work in the problem's dimension."""
        self._dimension, self._q, self._monitor = problem.dimension, problem.q, monitor
        operator = problem.delassus
        self._metric = np.full(operator.nc, float(np.abs(operator.diagonal).mean()) or 1.0)
        if options.metric == "compliance":
            self._metric = operator.compliance
        if inside is None:
            assert isinstance(problem, LocalProblem)
            inside = _internal(problem, options)
        self._inside = inside

    def solve(self, r: FloatArray, centre: FloatArray, alpha: float, target: float, most: int) -> tuple[Iterate, Monitor]:
        """Solve the problem of this centre from r (m,) until its residual, as the outer problem's error measures it, is the target.

        most: iterations that are left. Returns the iterate, the best one where the problem was not solved, and what watched it.
        """
        shift, outer = alpha * self._metric, self._monitor
        q = self._q - np.repeat(shift, self._dimension) * centre
        watch = outer.inner(q, 1.0, floor=outer.scale)
        watch.tol = outer.scale / watch.scale * target
        found = self._inside(shift, q, r, watch, most)
        return (found if found.status.solved or watch.best_r is None else Iterate(watch.best_r, found.status)), watch


def _internal(problem: LocalProblem, options: ProximalOptions) -> Inside:
    """The method that the options name; InputError where it does not work in the problem's dimension."""
    from fcsim.solvers import method  # the table names the proximal methods too

    internal = method(options.internal)
    if problem.dimension not in internal.dimensions:
        raise InputError(f"option internal: {options.internal!r} does not work in {problem.dimension}D")
    internal = replace(internal, options=override(internal.options, dict(options.internal_options)))
    own = internal.options
    if internal.run is newton and isinstance(own, NewtonOptions):
        return NewtonInVelocities(problem, own) if newton_here(problem, own) else RegularisedNewton(problem, own)
    return AnyMethod(problem, internal)


class AnyMethod:
    """A method of the table on a problem of its own, whose W + diag(shift) is kept as long as the shift stays."""

    def __init__(self, problem: LocalProblem, internal: Method) -> None:
        self._problem, self._internal = problem, internal
        self._shift, self._W = np.empty(0), problem.W

    def __call__(self, shift: FloatArray, q: FloatArray, r: FloatArray, watch: Monitor, most: int) -> Iterate:
        problem, internal = self._problem, self._internal
        if not np.array_equal(shift, self._shift):
            self._shift, self._W = shift, problem.delassus.shifted(shift).matrix
        options = replace(internal.options, max_iterations=min(internal.options.max_iterations, most))
        return internal.run(LocalProblem(self._W, q, problem.mu, dimension=problem.dimension), r, watch, options)


class RegularisedNewton:
    """Nonsmooth Newton; the linear systems of the inner problems share what the shift leaves alone."""

    def __init__(self, problem: LocalProblem, options: NewtonOptions) -> None:
        self._problem, self._options = problem, options
        self._system: NewtonSystem | None = None

    def __call__(self, shift: FloatArray, q: FloatArray, r: FloatArray, watch: Monitor, most: int) -> Iterate:
        problem, options = self._problem, self._options
        if self._system is None:
            linear, condensing = "auto" if options.linear == "kkt" else options.linear, options.formulation in ("AC", "JM")
            self._system = newton_system(problem.delassus.shifted(shift), linear, condensing=condensing, once=True)
        else:
            self._system = self._system.shifted(shift)
        blocks = self._system.operator.diagonal_blocks
        options = replace(options, max_iterations=min(options.max_iterations, most))
        return newton_iterations(LocalSpace(self._system, q, r), r, blocks, problem.mu, watch, options)
