"""Turning bodies and contacts in one loop: the elastic term follows the iterates of nonsmooth Newton.

The sequence of `solve_equation` solves a friction problem, linearises the elastic term at its answer, see `linearisation`, and solves
again. W is the same for all of these problems, and q differs by little. So Newton's method goes on where it is, with the q of the latest
linearisation: u = W r + q(r), where q(r) takes two solutions with A. An r counts as the answer where its error is below the tolerance
with the q that belongs to it, and the term has settled as in the sequence.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.problem import Answer, Followed, GlobalProblem, LocalProblem, natural_map_residual
from fcsim.problem.judge import relative
from fcsim.problem.reduction import Reduction
from fcsim.solvers import Memory, Result, method, solve
from fcsim.solvers.automatic.pause import passed_over
from fcsim.solvers.automatic.stages import AutomaticOptions
from fcsim.timestep.chain import ONE_LOOP, Chain, SolverSettings
from fcsim.timestep.step_equation.equation import Equation
from fcsim.timestep.step_equation.linearisation import Linearisation

ROUNDS = 6
"""How often the term is looked at under reactions that are held, until it has settled."""


class FollowedLoad(Followed):
    """The problem of a step whose load follows its solution.

    problem, reduction: of the last linearisation; load (n_dofs,) its right side; settled: whether the last answer's term has settled
    """

    def __init__(self, equation: Equation, problem: GlobalProblem, reduction: Reduction, load: FloatArray) -> None:
        self._equation, self._first, self.problem = equation, reduction, problem
        self.reduction, self.load, self.settled = reduction, load, False
        local = reduction.local
        self._compliance = replace(equation.compliance, summed=local.W)
        self._pushed: tuple[FloatArray, FloatArray] | None = None
        self._answered: tuple[FloatArray, Answer] | None = None

    @property
    def q(self) -> FloatArray:
        return self._first.q

    @property
    def mu(self) -> FloatArray:
        return self._first.mu

    @property
    def dimension(self) -> int:
        return self._first.dimension

    @property
    def compliance(self) -> FloatArray:
        return self._first.compliance

    @property
    def local(self) -> LocalProblem:
        return self._first.local

    def free(self, r: FloatArray) -> FloatArray:
        """q (m,) linearised at what r (m,) gives with the last linearisation."""
        self._linearised(self._velocity(r)[0])
        return self.reduction.q

    def answer(self, r: FloatArray) -> Answer:
        """What follows from r (m,) once the term has settled."""
        if self._answered is None or not np.array_equal(self._answered[0], r):
            self.settled = False
            v, multiplier = self._velocity(r)
            for _ in range(ROUNDS):
                self.settled = self._linearised(v)
                if self.settled:
                    break
                v, multiplier = self._velocity(r)
            problem = self.problem
            momentum = self.reduction.momentum_residual(r, v, multiplier)
            self._answered = r.copy(), Answer(problem.H.T @ v + problem.w, v, multiplier, momentum)
        return self._answered[1]

    def _velocity(self, r: FloatArray) -> tuple[FloatArray, FloatArray | None]:
        """v (n,) and l (p,), None without links, from r (m,) and the last linearisation: v = M^-1 f + M^-1 H r."""
        if self._pushed is None or not np.array_equal(self._pushed[0], r):
            self._pushed = r.copy(), self.reduction.pushed(r)
        return self.reduction.split(self.reduction.unloaded + self._pushed[1])

    def _linearised(self, of_problem: FloatArray) -> bool:
        """Linearise at v (n,); whether that changes no body's term by what counts: then nothing is changed, nor where an iterate that
        diverges has no load of finite numbers."""
        equation, elastic = self._equation, self._equation.elastic
        v = equation.velocity(of_problem)
        push = elastic.push(v)
        load = equation.rest - elastic.term(v) + push
        change = elastic.norms(load - self.load) / elastic.allowed(equation.rest, equation.rest - self.load, push)
        if np.all(change <= 1):
            return True
        if not np.all(np.isfinite(load)):
            return False
        self.load, self.problem = load, self.problem.with_load(equation.right_side(load))
        self.reduction = Reduction(self.problem, self._compliance)
        return False


def follows(settings: SolverSettings, elastic: Linearisation) -> bool:
    """Whether bodies turn, the settings ask for one loop and their solver works on problems whose load follows.

    Not in statics where mass may be all that holds a body: under reactions that are held it would fly away."""
    if elastic.rotation is None or elastic.held_by_mass or settings.loop == "sequence":
        return False
    return method(settings.name).run_followed is not None and settings.options.get("linear") != "kkt"


def solve_followed(
    problem: FollowedLoad, chain: Chain, r: FloatArray, allowed: Callable[[Reduction], float], kept: Memory | None
) -> tuple[Result | None, Memory | None]:
    """As `Chain.solve` by the settings' solver alone, in one loop: None also where the term has not settled, or where the error is above
    what is `allowed` for the last linearisation: the first, far from the motion, may have a q of another size."""
    settings = chain.settings
    if isinstance(method(settings.name).options, AutomaticOptions) and (rest := passed_over(kept)) is not None:
        return None, rest
    solved: Callable[..., Result] = solve  # which checks the options
    tol = allowed(problem.reduction)
    result = solved(problem, settings.name, r, tol=tol, floor=settings.least_motion, memory=kept, **settings.options)
    if result.solved:
        residual = natural_map_residual(result.r, result.u, problem.mu, problem.dimension, problem.compliance)
        error = relative(residual, max(float(np.linalg.norm(problem.reduction.q)), settings.least_motion))
        tol = allowed(problem.reduction)
        result = replace(result, error=error, scaled_error=error)
    within = result.solved and problem.settled and result.error <= tol
    status = result.status.value if within or not result.solved else "did not settle"
    if result.solved or result.iterations:  # `auto` that would not begin with Newton has done nothing
        start = ONE_LOOP if settings.loop == "auto" else "previous steps"
        chain.note(settings.name, start, result, tol, status=status)
    return (replace(result, memory=None) if within else None), result.memory
