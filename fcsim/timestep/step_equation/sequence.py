"""A step's equation solved: one friction problem, with turning bodies a sequence of them or one loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.whole.vectors import sum_by_ranks
from fcsim.errors import Unphysical
from fcsim.problem import GlobalProblem
from fcsim.problem.reduction import Reduction
from fcsim.problem.rolling import GlobalRollingProblem, RollingReduction
from fcsim.solvers import Memory, Method, method
from fcsim.solvers.automatic.pause import newton_goes_on
from fcsim.solvers.automatic.stages import AutomaticOptions
from fcsim.solvers.newton.options import NewtonOptions
from fcsim.timestep.chain import MET, Attempt
from fcsim.timestep.encounter import Encounter
from fcsim.timestep.reactions.expected_motion import with_motion
from fcsim.timestep.reactions.reactions import Reactions
from fcsim.timestep.reactions.unanswered import unanswered
from fcsim.timestep.reactions.warm_start import nearest_start, warm_start
from fcsim.timestep.step_equation.compliance import StepCompliance
from fcsim.timestep.step_equation.equation import Answer, Equation, Past, StepSolver
from fcsim.timestep.step_equation.linearisation import TOLERANCE, Linearisation
from fcsim.timestep.step_equation.linked_compliance import LinkedCompliance
from fcsim.timestep.step_equation.loops.mixing import Mixing
from fcsim.timestep.step_equation.loops.one_loop import FollowedLoad, follows, solve_followed


def solve_equation(equation: Equation, solver: StepSolver, past: Past) -> tuple[Answer | None, Past]:
    """Return the answer, None where the solver chain fails or the elastic term does not settle, and the past of the next step.

    What is tried goes into the solver's attempts. With turning bodies each problem differs from the last by its right side; W and all
    factors are the same.
    """
    answer, past = _solved(equation, solver, past)
    elastic = equation.elastic
    if answer is not None and past.serving is not None and elastic.rotation is not None:
        serving = with_motion(past.serving, equation.state, equation.scheme.h, elastic.moved(answer.v))
        past = replace(past, serving=serving)
    return answer, past


def _solved(equation: Equation, solver: StepSolver, past: Past) -> tuple[Answer | None, Past]:
    """`solve_equation` without what it keeps of the motion."""
    settings, attempts, clock = solver.settings, solver.attempts, solver.clock
    elastic, lead, chain = equation.elastic, past.lead, solver.chain(equation)
    newton = _newton_begins(lead.solver if lead.steps else settings.name, past.serving)
    compliance = _beginning(equation, method(settings.name), first=not lead.steps, late=newton)
    term, mixing, start, r = _first_term(elastic), Mixing(), None, np.empty(0)
    for _ in range(elastic.iterations):
        load, term = _load(equation, term)
        problem = equation.problem(load)
        reduction = Reduction(problem, compliance)
        rolling = RollingReduction(problem, reduction) if isinstance(problem, GlobalRollingProblem) else None
        tol = max(_tolerance(settings.tol, reduction, solver.extent, equation), _rough(equation, reduction, settings.least_motion))
        first = len(attempts)
        if start is None:
            enough = tol * max(float(np.linalg.norm(reduction.q)), settings.least_motion)
            start = r = _start(reduction, rolling, equation.met, past.reactions, enough, newton)
            clock.lap("assembly")  # W, which may have been summed beside what a start needs
            if isinstance(problem, GlobalProblem) and not lead.steps and follows(settings, elastic):
                answer, past = _in_one_loop(equation, FollowedLoad(equation, problem, reduction, load), start, solver, past)
                if answer is not None:
                    return answer, past
        if problem.nc:
            compliance = replace(compliance, summed=reduction.local.W if rolling is None else rolling.W)
        clock.lap("assembly")
        if rolling is None:
            result, serving = chain.solve(reduction, r, tol, past.serving, lead)
        else:
            result, serving = chain.solve_rolling(rolling, r, tol), past.serving
        clock.lap("solve")
        past = replace(past, serving=serving)
        if result is None:
            _explain(attempts, equation, problem, reduction)
            return None, past
        if not mixing.points and rolling is None:  # a step teaches once, whatever its linearisations
            past = replace(past, lead=lead.after(attempts[first].solver, attempts[-1].solver))
        v, r = equation.velocity(result.v), result.r  # type: ignore[arg-type] # of a global problem
        answer = Answer(problem, reduction, result, v, load, start, equation.factor, equation.met)
        if elastic.rotation is None:
            return answer, past
        push = elastic.push(v)
        now, allowed = elastic.term(v) - push, elastic.allowed(equation.rest, term, push)
        change = elastic.norms(now - term) / allowed
        if np.all(change <= 1):
            return answer, past
        if not np.all(np.isfinite(change)):
            break
        mixing = mixing.then(term, now)
        term = mixing.next_point(elastic.of_dofs(allowed))
        clock.lap("assembly")
    apart, why = TOLERANCE * float(change.max()), "" if equation.scheme.timing.moving else LOOSE
    attempts.append(Attempt("turning bodies", FREE_MOTION, "did not settle", apart, elastic.iterations, equation.share, TOLERANCE, why=why))
    return None, past


def _in_one_loop(
    equation: Equation, followed: FollowedLoad, start: FloatArray, solver: StepSolver, past: Past
) -> tuple[Answer | None, Past]:
    """The answer by one loop from start (m,), None where it does not arrive, and the past of what is solved next."""
    settings = solver.settings
    asked = partial(_tolerance, settings.tol, extent=solver.extent, equation=equation)
    result, serving = solve_followed(followed, solver.chain(equation), start, asked, past.serving)
    solver.clock.lap("solve")
    past = replace(past, serving=serving)
    if result is None:
        return None, past
    v = equation.velocity(result.v)  # type: ignore[arg-type] # of a global problem
    answer = Answer(followed.problem, followed.reduction, result, v, followed.load, start, equation.factor, equation.met)
    return answer, replace(past, lead=past.lead.after(settings.name, settings.name))


def _first_term(elastic: Linearisation) -> FloatArray:
    """The elastic term (n_dofs,) at the first iterate, without a pass over it where no loads follow."""
    first = elastic.first
    term, push = elastic.term(first), elastic.push(first)
    return term - push if isinstance(push, np.ndarray) else term


def _load(equation: Equation, term: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The right side (n_dofs,) with an elastic term (n_dofs,), and this where it is asked for once more: of turning bodies; else none."""
    return sum_by_ranks(1.0, equation.rest, -1.0, term), term if equation.elastic.rotation is not None else np.empty(0)


def _explain(attempts: list[Attempt], equation: Equation, problem: GlobalProblem | GlobalRollingProblem, reduction: Reduction) -> None:
    """Say of the last attempt why the step's problem has no answer, where that is known."""
    if isinstance(problem, GlobalProblem):
        driven = bool(np.any(equation.driven))
        attempts[-1] = replace(attempts[-1], why=unanswered(reduction.local, equation.met.contacts, equation.model, driven))


def _newton_begins(name: str, serving: Memory | None) -> bool:
    """Whether the method that begins is Newton's, be it by name or as the stage of `auto` that answered the problem before."""
    options = method(name).options
    return isinstance(options, NewtonOptions) or (isinstance(options, AutomaticOptions) and newton_goes_on(serving))


def _beginning(equation: Equation, chosen: Method, *, first: bool, late: bool) -> StepCompliance | LinkedCompliance:
    """The equation's compliance, which begins to sum W as the chosen method takes it; first: whether that is the one that begins; late:
    whether that is Newton's, which reads entries seldom."""
    compliance = equation.compliance
    if not isinstance(compliance, StepCompliance) or equation.met.moments is not None or not len(equation.met.contacts):
        return compliance
    together = chosen.over_ranks_from if chosen.over_ranks and first else np.inf
    taken = replace(compliance, over_ranks_from=together, over_ranks_elastic=chosen.over_ranks_elastic, late=late)
    return taken.beginning(equation.H, equation.model.dimension)


def _start(
    reduction: Reduction, rolling: RollingReduction | None, met: Encounter, reactions: Sequence[Reactions], enough: float, newton: bool
) -> FloatArray:
    """Where a step's first solve begins (m,); enough: residual in the unit of q with which an answer is one; newton: whether
    Newton's method begins."""
    if not len(met.contacts):
        return np.empty(0)
    if rolling is None:
        return (nearest_start if newton else warm_start)(reduction, met.contacts, reactions, enough)
    return reactions[0].transfer(met.contacts, met.rows) if reactions else np.zeros(rolling.problem.m)


FREE_MOTION = "the free motion"
LOOSE = (
    "statics of turning bodies of linear material have no stiffness by the stress in them, so that what supports and links leave free to "
    "turn does not settle: hold it, take a larger eta in more steps, or follow it in dynamics"
)
ROUND = float(np.finfo(np.float64).eps)
"""Tolerances below it are met by nothing."""
ROUGHEST_ASKED = 1e-6
"""The largest tolerance that a message advises instead of one that a step's free motion leaves no numbers for."""


def _tolerance(tol: float, reduction: Reduction, extent: float, equation: Equation) -> float:
    """Of the step's problem for that of the settings; Unphysical where no numbers meet it."""
    timing = equation.met.meeting.timing
    flight = longest_flight(reduction, extent, timing.force_per_reaction)
    if tol * flight < ROUND:
        least = max(flight, 1e-300)
        mend = "a shorter step" if timing.moving else f"a larger eta (about {MET / (tol * least):.0e} times)"
        if tol < MET / least <= ROUGHEST_ASKED:
            mend += f", or a larger tolerance, {MET / least:.0e} instead of {tol:.0e}"
        raise Unphysical(
            f"t = {equation.state.t:.6g} s: without contact bodies would move by {1 / least:.3g} times the model's size, {extent:.3g} m, "
            f"in one step; beside that round-off hides penetration. What helps: loads and accelerations in the model's units, {mend}"
        )
    return tol * min(1.0, flight)


ROUGHEST = 1e-2
"""The largest tolerance of an answer after which the step is solved again."""


def _rough(equation: Equation, reduction: Reduction, floor: float) -> float:
    """The tolerance of an answer after which the step is solved again, 0 where it may be the last; links are to be closed by each."""
    if not equation.borne or equation.linked is not None:
        return 0.0
    size = max(float(np.linalg.norm(reduction.q)), floor)
    return min(ROUGHEST, equation.borne * float(np.sqrt(reduction.problem.nc)) / (size or 1.0))


def longest_flight(reduction: Reduction, extent: float, force_per_reaction: float) -> float:
    """How far the bodies may fly freely in one step, the size of the model, relative to how far they do; infinity where they rest.

    Bodies that only contact holds move freely by f / (eta M / h^2) in q, which may be kilometres: an error relative to that would
    take metres of penetration for converged, so that free motion counts up to the size of the model only.
    """
    free = float(np.linalg.norm(reduction.q))
    return extent * force_per_reaction * float(np.sqrt(reduction.problem.nc)) / free if free else np.inf
