"""Newton's method on a step with nonlinear bodies: a sequence of friction problems, each a real one.

With the inner forces F of nonlinear bodies, weighted by w, and b - B v for all that is linear, the step's equation is

    R(v, r) = B v - b + w (F(x(v)) - P(x(v))) - H r = 0,  with the laws of contact between u = H^T v + w_N and r                        (1)

At the iterate v_i with S_i = w dF/dv the problem A_i v = H r + f_i, A_i = B + S_i, f_i = b - w F(x(v_i)) + S_i v_i, with the laws of
contact is a global problem like any other step's: the solver begins where it ended for v_i-1. Its answer (v, r) is where (1) is
measured and linearised next, until R is below the tolerance and contact is where it was meant: quadratic where S_i is exact. Where R
grows, or a body has no admissible state, (v, r) is gone only part of the way. In quasi-statics contacts are found anew at every iterate,
with gaps brought back to the beginning of the step, so that u remains the increment over all of it, and A_i has their geometric stiffness
-d(H r)/dv (`contact_tangent`); where bodies pass others on the way to (v, r) the problem is solved again with these contacts (`passed`),
and part of the way is gone where contacts of the step's beginning would be lost in the other body (`lost`). In dynamics contacts are
those of the step.

Pressures P that follow the bodies give A_i the symmetric part of their tangent, and in quasi-statics the rest of it too, with that of
forces that follow (`beside`).

A_i must be positive definite, see `positive_factor`. Bodies keep their tangent and factor while that differs by less than a share.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.assembly.body_factors import Indefinite
from fcsim.assembly.compliance import SystemFactor
from fcsim.contact_detection.contacts import Contacts
from fcsim.problem import GlobalProblem
from fcsim.problem.reduction import Reduction
from fcsim.solvers import Result
from fcsim.timestep.chain import Attempt, Chain, Lead, SolverSettings
from fcsim.timestep.encounter import Encounter, Redetection
from fcsim.timestep.reactions.reactions import carried, carried_in_space
from fcsim.timestep.reactions.warm_start import warm_start
from fcsim.timestep.step import Linearised
from fcsim.timestep.step_equation.equation import Answer, Equation, Past, StepSolver
from fcsim.timestep.step_equation.inner_term import InnerTerm
from fcsim.timestep.step_equation.linearisation import TOLERANCE as LINEAR_TOLERANCE
from fcsim.timestep.step_equation.loops.going_round import goes_round
from fcsim.timestep.step_equation.loops.iterate import Iterate, KeptFactor, Posed
from fcsim.timestep.step_equation.loops.lost_contacts import lost
from fcsim.timestep.step_equation.loops.meant_contacts import passed, settled
from fcsim.timestep.step_equation.loops.natural_monotonicity import jams, leads_on
from fcsim.timestep.step_equation.loops.newton_loop import contacts_once, looped, looped_attempt
from fcsim.timestep.step_equation.loops.positive_definite import further_share, positive_factor
from fcsim.timestep.step_equation.sequence import ROUND, longest_flight
from fcsim.timestep.step_equation.tangent import made_positive, tangent_by_differences, tangent_by_formulas

TOLERANCE = 1e-9
"""Of a body's residual, relative to the forces on it."""

STANDS = 50.0
"""Times `TOLERANCE`: what the contacts of the last problem, found where it began, may leave at its answer."""

MAX_ITERATIONS = 40
SLOWER = 0.25  # what an iteration with a stiffened body counts: its errors fall by a constant factor only

SLANTED = "NSN-AC"  # solves the problems with E, see `_Newton._ways`

TIGHTER, TIGHTEST = 0.1, 1e-3
"""Of the solver's tolerance: by so much it is taken smaller where the solver takes the last answer for one as it is though the residual is
not met and does not fall, and at the least."""

CLOSER = 0.01  # of the solver's tolerance where a body is stiffened: what it leaves open, times that stiffness, is in the residual

_SHORTEST = 1 / 64


def solve_nonlinear(equation: Equation, solver: StepSolver, past: Past, anew: Redetection | None) -> tuple[Answer | None, Past]:
    """Return the answer, None where it is not found, and the past of the next step; as `solve_equation`, for models with nonlinear bodies.

    anew: the contacts at an iterate, None where those of the step stay (dynamics).
    """
    newton = _Newton(equation, solver, anew)
    answer, after = newton.solve(past)
    if answer is None and anew is not None and newton.done:
        return _Newton(equation, solver, anew.in_valleys(), in_space=True).solve(past)
    return answer, after


class _Newton:
    """The iterations of one step.

    in_space: whether trials are measured with the contacts of their problem, and reactions go on as vectors in space: at the kink between
    two facets its reaction lies between their normals, and which of them has how much of it may change.
    """

    def __init__(self, equation: Equation, solver: StepSolver, anew: Redetection | None, *, in_space: bool = False) -> None:
        self.equation, self.solver, self.anew, self.in_space = equation, solver, anew, in_space
        self.inner = InnerTerm(equation.scheme, equation.model, equation.state)
        self.done: list[Linearised] = []  # the problems so far
        self.sizes: list[float] = []  # residuals of the bodies at the answers, over what is allowed
        self.start: FloatArray | None = None  # where the first of them began (m,)
        self.passed: Contacts | None = None  # contacts that are met on the way
        self.foreseen = False  # whether the last tangent is of foreseen stresses, see `positive_factor`
        self.ceiling = 0.0  # residual that the iterate after such a tangent may have, see `_way`
        self.tighter = 1.0  # of the solver's tolerance, see `TIGHTER`
        self.least = 0.0  # share of the bodies' first stiffness that is added at least, see `further_share`

    def solve(self, past: Past) -> tuple[Answer | None, Past]:
        """See `solve_nonlinear`."""
        equation, lead = self.equation, past.lead
        first = self.inner.first()
        now = Iterate(first, np.empty(0), self.inner.at(first, tangent=True), np.inf, np.empty(0), equation.elastic.push(first))
        if now.term.inadmissible:
            return self._failed(f"body {now.term.inadmissible!r} has no admissible state where its velocity takes it", past)
        left = float(MAX_ITERATIONS)
        while left > 0:
            try:
                factor, share, past = self._factor(now, past)
            except Indefinite as error:
                name = equation.model.deformable[error.body].name
                return self._failed(f"body {name!r} has lost its stiffness: it buckles, snaps or softens, which dynamics can follow", past)
            left -= SLOWER if share else 1.0
            plain = replace(equation, factor=factor, bent=None, slanted=None)
            # what a solver leaves open is in the next iterate's contacts: they would not settle to less
            tol = self.solver.settings.tol if self.anew is None else min(self.solver.settings.tol, TOLERANCE)
            posed = self._posed(plain, now, past, lead, tol, CLOSER if share else 1.0)
            equation, result, tried = posed.equation, posed.result, posed.tried
            self.start = posed.warm if self.start is None else self.start
            self.solver.attempts.extend(tried)
            self.solver.clock.lap("solve")
            past = replace(past, serving=posed.serving)
            if result is None:
                if posed.least is None:
                    return None, past
                self.least, self.start = posed.least, self.start if self.done else None
                continue
            if not self.done and tried:
                past = replace(past, lead=lead.after(tried[0].solver, tried[-1].solver))
            v = equation.velocity(result.v)  # type: ignore[arg-type] # of a global problem
            if (more := self._more(equation, now, v)) is not None:
                past = past.of_the_same_step(equation.met.contacts, more.contacts, result.r)
                further = replace(equation, met=more)
                began = replace(now, r=np.zeros(more.rows * len(more.contacts)))
                equation, now = further, self._moved(further, equation.met, now)[0] if self.done else began
                continue
            found = self._way(equation, now, v, result, not share)
            if found is None:
                return self._failed("a body has no admissible state on the way to the answer", past)
            new, length, met = found
            self.ceiling = now.residual if self.foreseen else 0.0
            at_rest = self.anew is None or settled(equation.met, met, new.v, result.r)
            self.solver.clock.lap("detection" if self.anew is not None else "assembly")
            fresh = sum(group.fresh for group in factor.nonlinear_groups)
            self.done.append(Linearised(posed.problem, result, posed.warm, TOLERANCE * new.residual, length, fresh, share))
            self.sizes.append(new.residual)
            if posed.problem.nc and not result.iterations and new.residual > max(1.0, 0.5 * self.sizes[-2:][0]) and len(self.sizes) > 1:
                self.tighter = max(TIGHTEST, TIGHTER * self.tighter)
            if self.anew is not None and not self.in_space and goes_round(self.sizes, self.anew, new.v):
                break
            if length == 1 and new.residual <= 1 and at_rest and result.error <= tol and self._stands(equation, new, result):
                if not tried:
                    self.solver.attempts.append(looped_attempt(result, len(self.done), equation.share, tol))
                return self._answer(equation, posed.reduction, new, result), past
            if self.anew is not None:
                past, equation = past.of_the_same_step(equation.met.contacts, met.contacts, result.r), replace(equation, met=met)
            now = new if new.term.blocks else replace(new, term=self.inner.at(new.v, tangent=True))
        return self._failed("did not settle", past)

    def _posed(self, plain: Equation, now: Iterate, past: Past, lead: Lead, tol: float, closer: float) -> Posed:
        """The iterate's problem, posed in one of `_ways` after the other until a solver answers it to `tol`, `closer` by that factor."""
        load = self._load(plain, now)
        result: Result | None = None
        tried, serving, least = list[Attempt](), past.serving, None
        for equation, pushed, settings in self._ways(plain, now):
            posed = equation.problem(load + pushed)
            assert isinstance(posed, GlobalProblem)  # rolling resistance is refused beside nonlinear bodies
            problem = posed
            reduction = Reduction(problem, equation.compliance)
            self.solver.clock.lap("assembly")
            cold = self.start is None and problem.nc > 0
            warm = warm_start(reduction.local, equation.met.contacts, past.reactions) if cold else now.r
            flight = min(1.0, longest_flight(reduction, self.solver.extent, equation.met.meeting.timing.force_per_reaction))
            if flight < 1.0 and equation.slanted is not None:
                continue
            allowed = tol * flight * closer * self.tighter
            flies = allowed < ROUND and self.anew is not None and not equation.elastic.held_by_mass
            least = further_share(self.least) if flies else None
            if least is not None:
                break
            tried, serving = [], past.serving
            once, allowed = looped(settings, equation, len(self.done), allowed)
            if once:
                result = contacts_once(reduction, equation, now.v, warm, settings, allowed)
                break
            result, serving = Chain(settings, equation.share, tried).solve(reduction, warm, allowed, past.serving, lead)
            if result is not None:
                break
        return Posed(equation, problem, reduction, warm, result, tried, serving, least)

    def _factor(self, now: Iterate, past: Past) -> tuple[SystemFactor, float, Past]:
        """The factor of A_i, the share of the first stiffness in it, and the past that keeps it; raises Indefinite."""
        kept = None if past.serving is None else past.serving.earlier(KeptFactor)
        factor, share, self.foreseen = positive_factor(self.equation, self.inner, now, None if kept is None else kept.factor, self.least)
        if past.serving is not None:
            past = replace(past, serving=past.serving.having(KeptFactor(np.empty(0, dtype=np.int64), factor=factor)))
        return factor, share, past

    def _linear(self, v: FloatArray) -> FloatArray:
        """The elastic term of the linear bodies at v (n_dofs,), see `Linearisation`."""
        elastic = self.equation.elastic
        return elastic.term(np.zeros_like(v) if elastic.rotation is None else v)

    def _load(self, equation: Equation, now: Iterate) -> FloatArray:
        return equation.rest - self._linear(now.v) - now.term.force + now.push + equation.factor.apply_tangents(now.v)

    def _ways(self, equation: Equation, now: Iterate) -> Iterator[tuple[Equation, FloatArray | float, SolverSettings]]:
        """The equation with B and E by differences, for one method that is quick to say whether it arrives; then with B by formulas for the
        whole chain; where B costs the matrix its positive definiteness first for the same method, then without B. Of a body that hardly
        anything holds W has rank one but for round-off, and E leaves nothing that has a solution.

        Where mass alone holds bodies the loads that follow them have their tangent only if the contacts that press hold them, g H_a of
        `_bent`: forces that change with a body's shape, and push what next to nothing holds, leave W without monotony."""
        beside = equation.elastic.beside(now.v)
        if beside is not None and equation.elastic.held_by_mass:
            bending, pushed = self._bent(equation, now, beside, differences=False)
            if bending.of_bodies.positive:
                yield bending, pushed, self.solver.settings
            beside = None
        by_differences, pushed = self._bent(equation, now, beside, differences=True)
        if by_differences.slanted is not None:
            yield by_differences, pushed, replace(self.solver.settings, name=SLANTED, options={}, fallback=())
        by_formulas, pushed = self._bent(equation, now, beside, differences=False)
        if by_formulas.bent is not None and not by_formulas.of_bodies.positive:
            yield by_formulas, pushed, replace(self.solver.settings, name=SLANTED, options={}, fallback=())
            by_formulas, pushed = self._bent(equation, now, beside, differences=False, monotone=True)
        yield by_formulas, pushed, self.solver.settings

    def _bent(
        self, equation: Equation, now: Iterate, beside: sp.csr_array | None, *, differences: bool, monotone: bool = False
    ) -> tuple[Equation, FloatArray | float]:
        """The equation with the geometric stiffness B of its contacts under the iterate's reactions, with what pressures have beside the
        factors, and what both add to the right side; in statics only, since contacts stay those of the step in dynamics.

        See `made_positive`; where nothing makes the matrix positive definite, B is left out if it is to be `monotone`."""
        met, pushed = equation.met, 0.0
        if beside is not None:
            equation, pushed = replace(equation, bent=beside), beside @ now.v
        if self.anew is None or not np.any(now.r) or met.compliance is not None or met.adhesive_impulse is not None:
            return equation, pushed
        bent, slanted = (tangent_by_differences if differences else tangent_by_formulas)(equation, self.anew, now.v, now.r)
        if bent is None:
            return equation, pushed
        largest, bent = float(np.abs(bent.data).max()), bent if beside is None else bent + beside
        equation = replace(equation, slanted=slanted)
        if slanted is not None and not self.in_space:  # a method of Newton's asks for no monotony
            return replace(equation, bent=bent), bent @ now.v
        positive = made_positive(equation, bent, now.v, now.r, largest)
        if positive is None and not monotone:
            return replace(equation, bent=bent, slanted=None), bent @ now.v
        return positive or (replace(equation, slanted=None), pushed)

    def residual(self, equation: Equation, at: Iterate) -> FloatArray:
        """R(v, r) (n_dofs,), of the forces G l of links too, zero at driven dofs."""
        factor, met, v = equation.factor, equation.met, at.v
        R = factor.apply(v) - factor.apply_tangents(v) + at.term.force + self._linear(v) - equation.rest - at.push - met.impulse(at.r)
        if equation.linked is not None:
            R = R - equation.linked.G @ at.l
            bending = equation.linked.bending
            R = R if bending is None else R + bending.B @ (v - bending.v)
        return R - equation.model.driven_share(R)

    def _relative(self, equation: Equation, at: Iterate) -> float:
        """Largest residual of a body over what is allowed."""
        elastic = equation.elastic
        allowed = TOLERANCE / LINEAR_TOLERANCE * elastic.allowed(equation.rest, at.term.force, at.push)
        return float((elastic.norms(self.residual(equation, at)) / allowed).max(initial=0.0))

    def _stands(self, equation: Equation, new: Iterate, result: Result) -> bool:
        """Whether the contacts of the last problem, which are those of the step, balance its answer too: they are where it began."""
        return self.anew is None or self._relative(equation, replace(new, r=result.r)) <= STANDS

    def _way(self, equation: Equation, now: Iterate, v: FloatArray, result: Result, own: bool) -> tuple[Iterate, float, Encounter] | None:
        """How far to go from the iterate towards the answer v (n_dofs,), r: all the way where the residual, with contacts as they are
        found there, does not grow, or, where nothing presses, that `leads_on` with the tangent's factor; and these. After an iteration with
        foreseen stresses it may be what it was before that (L. Grippo, F. Lampariello, S. Lucidi, SIAM J. Numer. Anal. 23, 1986): such
        iterations leave less than the next one does."""
        length, least, best = 1.0, np.inf, None
        jammed = bool(np.any(result.r)) and jams([one.length for one in self.done])
        factor, free = equation.factor, own and equation.linked is None and not (np.any(result.r) or np.any(now.r))
        r0 = now.r if now.r.shape == result.r.shape else result.r
        l1 = np.empty(0) if result.multiplier is None else result.multiplier
        l0 = now.l if now.l.shape == l1.shape else l1
        while length >= _SHORTEST:
            w, r, l = v, result.r, l1
            if length < 1:
                w, r, l = now.v + length * (v - now.v), r0 + length * (result.r - r0), l0 + length * (l1 - l0)
            term = self.inner.at(w, tangent=not self.done)  # after the first problem there is a second one
            if not term.inadmissible:
                met = equation.met if self.anew is None else self.anew.met(w, None)
                there = Iterate(w, r, term, np.inf, l, equation.elastic.push(w), None if self.anew is None else now.v)
                new, left = self._moved(replace(equation, met=met), equation.met, there)
                found, size = (new, length, met), new.residual
                if self.in_space:
                    size = self._relative(equation, there)
                elif left.any():  # goes on pressing here: contacts that are passed are seen on the way only
                    size = self._relative(replace(equation, met=met), replace(new, push=there.push + equation.met.impulse(left)))
                gone = self.anew is not None and self._loses(met, w)
                if jammed or (size <= max(1.0, now.residual, self.ceiling) and not gone):
                    return found
                if free and not gone and leads_on(factor, self.residual(equation, there), v - now.v, length):
                    return found
                size = np.finfo(float).max if gone else size  # in equilibrium or not: only where there is nothing else
                best, least = (found, size) if size < least else (best, least)
            length *= 0.5
        return best

    def _loses(self, met: Encounter, v: FloatArray) -> bool:
        """Whether contacts of the step's beginning are lost where `met` ones are found, at v (n_dofs,)."""
        model, x = self.equation.model, self.equation.state.x
        return lost(model, self.equation.met, met.contacts, model.positions(x), model.positions(model.advance(x, v))) is not None

    def _more(self, equation: Equation, now: Iterate, v: FloatArray) -> Encounter | None:
        """The contacts of the iterate with those that the way to the answer v (n_dofs,) passes; None where it passes no others."""
        if self.anew is None:
            return None
        self.passed = passed(equation, self.anew, now.v, v, self.solver.extent, self.passed)
        return None if self.passed is None else self.anew.met(now.v, self.passed)

    def _moved(self, equation: Equation, earlier: Encounter, new: Iterate) -> tuple[Iterate, FloatArray]:
        """The iterate with its reactions at the contacts as they are found there, and the residual with these; what of them has none."""
        carry = carried_in_space if self.in_space else carried
        r, left = (new.r, np.zeros(0)) if equation.met is earlier else carry(earlier.contacts, new.r, equation.met.contacts)
        carried_on = replace(new, r=r)
        return replace(carried_on, residual=self._relative(equation, carried_on)), left

    def _answer(self, equation: Equation, reduction: Reduction, new: Iterate, result: Result) -> Answer:
        """The answer; its right side is that of the nonlinear equation, so that what supports take is what they take of it."""
        exact = equation.rest - self._linear(new.v) - new.term.force + new.push + equation.factor.apply_tangents(new.v)
        assert self.start is not None
        return Answer(
            self.done[-1].problem, reduction, result, new.v, exact, self.done[-1].start, equation.factor, equation.met, tuple(self.done)
        )

    def _failed(self, why: str, past: Past) -> tuple[None, Past]:
        """No answer: why goes into the attempts."""
        apart = self.done[-1].residual if self.done else np.inf
        share, tol = self.equation.share, self.solver.settings.tol
        self.solver.attempts.append(Attempt("Newton", "the last state", why, apart, len(self.done), share, tol))
        return None, past
