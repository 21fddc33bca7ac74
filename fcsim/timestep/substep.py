"""The parts of a step, each from what strikes at its beginning, by its contacts and its equation, to its end.

A step that is not cut is one part. What a run's parts have in common, the factors of its bodies among it, is computed once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray
from fcsim.assembly.compliance import SystemFactor
from fcsim.assembly.model import Model
from fcsim.contact_detection import Detection, Detector, Everything, innermost, left_out
from fcsim.contact_law.areas.within_faces import with_points_within_faces
from fcsim.contact_law.proportions import Proportions, proportions
from fcsim.errors import InputError, Penetration
from fcsim.linkage import Linkage
from fcsim.ranks import held_in_common
from fcsim.solvers import Memory
from fcsim.timestep.beginning.first_half import passes, refuse_going_through
from fcsim.timestep.beginning.impact import struck
from fcsim.timestep.chain import Attempt, Clock, SolverSettings, settings_of_model
from fcsim.timestep.encounter import Encounter, LawInput, Redetection, encounter, met_on_the_way
from fcsim.timestep.energy import Energy
from fcsim.timestep.links.linked import linked
from fcsim.timestep.links.mechanisms import unstable
from fcsim.timestep.reactions.drift import drift_of
from fcsim.timestep.reactions.warm_start import MEMORY
from fcsim.timestep.scheme import Scheme, StepSetup
from fcsim.timestep.state import State, updated
from fcsim.timestep.step import Moment, Step
from fcsim.timestep.step_equation.closing import Closing, closing
from fcsim.timestep.step_equation.end_velocity import turning_impulse
from fcsim.timestep.step_equation.equation import Answer, Equation, Past, StepSolver
from fcsim.timestep.step_equation.linearisation import TOLERANCE, Linearisation, joined_nodes
from fcsim.timestep.step_equation.look_ahead.ahead import ROUNDS, borne_at_first, looked_ahead
from fcsim.timestep.step_equation.look_ahead.driven_turns import turns_too_far
from fcsim.timestep.step_equation.look_ahead.passed import passed
from fcsim.timestep.step_equation.loops.proximal_mass import with_proximal_mass
from fcsim.timestep.step_equation.penetration import AtEnd, at_end
from fcsim.timestep.step_equation.sequence import FREE_MOTION, LOOSE, solve_equation
from fcsim.timestep.step_equation.settling import solve_settled
from fcsim.witness.skin import Skins, skins_of


@dataclass(frozen=True, eq=False)
class Substeps:
    """What computes the parts of a run's steps; its fields are those of `Simulation`, scheme: of whole steps."""

    model: Model
    detector: Detection
    scheme: Scheme
    solver: SolverSettings
    cuttings: int
    linkage: Linkage | None

    @cached_property
    def nodes(self) -> NDArray[np.int64]:
        """Nodes that contacts and links can touch, and in statics those that the tangent of loads that follow joins."""
        nodes = self.detector.nodes if self.linkage is None else np.union1d(self.detector.nodes, self.linkage.nodes)
        return joined_nodes(nodes, self.scheme, self.model)

    @cached_property
    def extent(self) -> float:
        """Size [m] of the model along the axes; turned, it is up to sqrt(d) times as large: tolerances alone are relative to it."""
        return float(np.ptp(self.model.reference, axis=0).max())

    @cached_property
    def proportions(self) -> Proportions:
        """Sizes of the bodies, to which lengths of contact are relative."""
        return proportions(self.model, isinstance(innermost(self.detector), Everything))

    def keep_in_common(self) -> None:
        """Have ranks of one machine keep what detection and the bodies' proportions are made of once. All ranks must ask."""
        vars(self)["proportions"] = replace(self.proportions, facets=held_in_common(self.proportions.facets))
        if isinstance(within := innermost(self.detector), Detector):
            within.keep_in_common()

    @cached_property
    def detection(self) -> Detection:
        """The detector, with the points that springs per area need within flat faces."""
        return with_points_within_faces(self.detector, self.scheme.law, self.proportions)

    @cached_property
    def skins(self) -> Skins | None:
        """Those of all bodies, by which what goes through another one is seen; None where some of them face inwards."""
        without = left_out(self.detector)
        try:
            return skins_of(self.model)[0]._replace(without=without[:, 0] * len(self.model.bodies) + without[:, 1])
        except InputError:
            return None

    @cached_property
    def _systems(self) -> dict[tuple[float, float], SystemFactor]:
        return {}

    def system(self, scheme: Scheme) -> SystemFactor:
        """The factor of a scheme's system matrix: made once for all parts of its length."""
        factors = scheme.factors(self.model)
        if factors not in self._systems:
            self._systems[factors] = SystemFactor(self.model, *factors, self.nodes)
        return self._systems[factors]

    def settings(self, t: float, nc: int = 1) -> SolverSettings:
        """Those of the solver for nc contacts in the part of a step that begins at t [s]."""
        return settings_of_model(self.solver, self.model.size_and_reach, self.scheme.timing, self.model.gravity_at(t + self.scheme.h), nc)

    def support_impulse(self, scheme: Scheme, answer: Answer, impulse: FloatArray, rigid_mass: FloatArray, after: State) -> FloatArray:
        """The supports' impulses (n_dofs,), from what is left of A v - f - H r."""
        residual = answer.factor.apply(answer.v) - answer.load - impulse
        if self.model.nonlinear:
            residual = self.model.driven_share(residual)  # the rest is what Newton's method has left
        support = scheme.support_impulse(self.model, residual, impulse, answer.v, rigid_mass)
        return support + turning_impulse(self.model, answer.v, rigid_mass, after) if scheme.timing.moving else support


@dataclass(frozen=True, eq=False)
class _Opened:
    """A part of a step before it is solved.

    start: the moment that it begins at, after what strikes there; impact: the balance of that, None where nothing did; equation: by the
    contacts that it begins with; rigid_mass: of `Scheme.rigid_mass`; whole_per_part: the whole step's reactions over those of the part
    """

    start: Moment
    impact: Energy | None
    equation: Equation
    past: Past
    links: Closing
    rigid_mass: FloatArray
    whole_per_part: float


@dataclass(frozen=True, eq=False)
class _Solved:
    """Its answer, with the impulse (n_dofs,) of contacts and links and the state at the end; settled: looking ahead came to its end."""

    answer: Answer
    past: Past
    impulse: FloatArray
    after: State
    settled: bool


@dataclass(frozen=True, eq=False)
class Substep:
    """One part of a step of the length h / 2^cuts.

    run: what the parts of a run have in common; scheme: of the part's length; clock, attempts: of the whole step, whose parts add to both
    """

    run: Substeps
    scheme: Scheme
    cuts: int
    clock: Clock
    attempts: list[Attempt]

    @classmethod
    def of(cls, run: Substeps, cuts: int, clock: Clock, attempts: list[Attempt]) -> Substep:
        """The part of a step that is halved so often."""
        return cls(run, run.scheme.cut(2**cuts) if cuts else run.scheme, cuts, clock, attempts)

    @cached_property
    def setup(self) -> StepSetup:
        return StepSetup(self.run.model, self.run.detection, self.scheme, self.run.proportions)

    def after(self, start: Moment, kept: dict[int, Memory] | None, anchor: Moment) -> Step | None:
        """The step from a moment on; None where it has no answer, and is to be cut. kept: see `Simulation.step`."""
        if (opened := self._opened(start, kept)) is None or self._turned_far(opened.equation.met, opened.start.state):
            return None
        if (solved := self._solved(opened, kept)) is None:
            return None
        run, answer, state = self.run, solved.answer, opened.start.state
        when, positions = self._when(opened.start, solved.after.t), partial(run.model.positions, solved.after.x)
        answer.met.refuse_driven(run.model, answer.v, when, lambda: run.detection(positions()))
        began = opened.equation.met
        end = at_end(self.setup, (state, solved.after), began, answer.met, settled=solved.settled)
        if end.too_long(self.cuts, run.cuttings, self.attempts, run.solver.tol) or self._goes_through(answer, state, when):
            return None
        if self._turned_far(answer.met, state):
            return None
        return self._ended(opened, solved, anchor, end)

    def _turned_far(self, met: Encounter, state: State) -> bool:
        """Whether supports turn what touches by so much in statics that the part is to be cut."""
        if self.scheme.timing.moving:
            return False
        return turns_too_far(self.run.model, met.contacts, state.t, self.scheme.h, shortest=self.cuts == self.run.cuttings)

    def _goes_through(self, answer: Answer, state: State, when: str) -> bool:
        """Whether bodies go through each other as the answer leads them: the part is to be cut. Penetration where it is the shortest."""
        run = self.run
        if not self.scheme.timing.moving or (through := passed(self.setup, answer.met, answer.v, state, lambda: run.skins)) is None:
            return False
        if self.cuts == run.cuttings:
            raise Penetration(through.said(run.model, when, self.scheme.h))
        return True

    def _when(self, start: Moment, t: float) -> str:
        return f"step {start.number}, t = {t:.6g} s"

    def _opened(self, start: Moment, kept: dict[int, Memory] | None) -> _Opened | None:
        """What strikes at the beginning, the contacts and the terms of the equation; None where bodies would pass each other: it is to be
        cut, or refused by InputError."""
        if (begun := self._struck(start)) is None:
            return None
        start, impact = begun
        if (met := self._met(start)) is None:
            return None
        run, model, scheme, state = self.run, self.run.model, self.scheme, start.state
        rest = scheme.right_hand_side(model, state)
        rigid_mass = scheme.rigid_mass(model, state, rest)
        whole_per_part = scheme.force_per_reaction / run.scheme.force_per_reaction
        memory = start.memory if whole_per_part == 1 else tuple(replace(old, r=old.r / whole_per_part) for old in start.memory)
        identity = met.contacts.identity
        past = Past(memory, start.lead, None if kept is None else kept.pop(self.cuts, Memory.of(identity)).follow(identity))
        elastic = Linearisation(scheme, model, state, past.serving)
        factor = run.system(scheme).with_rigid_mass(rigid_mass).turned(elastic.rotation)
        driven, links = scheme.driven(model, state), closing(linked(run.linkage, model, scheme, state), model, scheme, state, run.extent)
        borne = borne_at_first(self.setup, met)
        equation = Equation(scheme, model, state, met, factor, rest, driven, elastic, 0.5**self.cuts, links.rows, borne=borne)
        return _Opened(start, impact, equation, past, links, rigid_mass, whole_per_part)

    def _struck(self, start: Moment) -> tuple[Moment, Energy | None] | None:
        """The moment after what strikes at the beginning of the step, and the balance of that impact; None where bodies would pass each
        other before contacts are looked for. See `beginning`."""
        run, scheme = self.run, self.scheme
        if scheme.h <= start.seen:
            return start, None
        if passes(self.setup, start, shortest=self.cuts == run.cuttings):
            return None

        def solve(equation: Equation, past: Past) -> tuple[Answer | None, Past]:
            return solve_equation(equation, StepSolver(run.settings(start.state.t), run.extent, self.attempts, Clock()), past)

        made = struck(self.setup, start, run.linkage, run.system, solve)
        return (start, None) if made is None else (replace(start, state=made.state), made.energy)

    def _met(self, start: Moment) -> Encounter | None:
        """The contacts of the step; None where bodies would pass each other in it."""
        run, last = self.run, start.memory[0] if start.memory else None
        drift = drift_of(self.scheme, run.model, last) if run.linkage is None else None
        told = LawInput(run.proportions, start.variables, linkage=run.linkage, drift=drift)
        met = encounter(run.model, run.detection, self.scheme, start.state, told)
        self.clock.lap("detection")
        if met.passing is not None and self.cuts == run.cuttings:
            refuse_going_through(run.model, self.scheme, met.passing, self._when(start, start.state.t))
        return met if met.passing is None else None

    def _solved(self, opened: _Opened, kept: dict[int, Memory] | None) -> _Solved | None:
        """Solve the equation until links are closed and nothing more is met; None where it has no answer."""
        run, model, scheme, links = self.run, self.run.model, self.scheme, opened.links
        equation = replace(opened.equation)  # a copy of its own, whose W ends with it where the part is solved again
        past, state, looks = opened.past, opened.start.state, 0
        solver = StepSolver(run.settings(state.t, len(equation.met.contacts)), run.extent, self.attempts, self.clock)
        while True:
            answer, past = solve_settled(equation, solver, past, partial(self._anew, opened.start))
            if kept is not None and past.serving is not None:
                kept[self.cuts] = past.serving
            if answer is None and (heavier := with_proximal_mass(equation, run.system)) is not None:
                equation = heavier
                continue
            if answer is None:
                return None
            result, v, met = answer.result, answer.v, answer.met
            impulse = met.impulse(result.r) + links.impulse(result.multiplier)
            after = updated(model, state, scheme.advance(model, state, v, impulse, opened.rigid_mass))
            if not links.keep(v, result.multiplier, after):
                if links.given_up:
                    self.attempts.append(links.attempt(equation.share))
                    return None
                past = past.of_the_same_step(met.contacts, met.contacts, result.r)
                equation = replace(equation, met=met, linked=links.rows)
                continue
            ahead = looked_ahead(self.setup, state, met, v, after, met.reaction(result.r)) if looks < ROUNDS else None
            self.clock.lap("detection")
            if ahead is None and equation.elastic.proximal_mass and self._unstable(equation, answer, after):
                return None
            if ahead is None and not equation.borne:
                return _Solved(answer, past, impulse, after, looks < ROUNDS)
            seen, met, looks = met, ahead or met, looks + (ahead is not None)
            past = past.of_the_same_step(seen.contacts, met.contacts, result.r)
            borne = borne_at_first(self.setup, met, seen) if equation.borne and looks < ROUNDS else 0.0
            equation = replace(equation, met=met, linked=links.rows, borne=borne)

    def _unstable(self, equation: Equation, answer: Answer, after: State) -> bool:
        """Whether the answer of statics that more mass leads to is one from which bodies would fall, which is then said; not asked where
        contacts bear."""
        run, model = self.run, self.run.model
        if run.linkage is None or np.any(answer.result.r):
            return False
        end = model.elastic.at(after.x)
        force = model.elastic.force(end, end, 1.0, None)
        if falls := unstable(model, run.linkage, after, force):
            self.attempts.append(
                Attempt("turning bodies", FREE_MOTION, "balances where it would fall", 1.0, 1, equation.share, TOLERANCE, why=LOOSE)
            )
        return falls

    def _anew(self, start: Moment, equation: Equation) -> Redetection | None:
        """What finds contacts at the iterates of a step of statics; None in dynamics."""
        if equation.scheme.timing.moving:
            return None
        model, scheme, state = self.run.model, equation.scheme, start.state
        told = LawInput(self.run.proportions, start.variables, trial=equation.met.meeting.trial, linkage=self.run.linkage)
        return Redetection(lambda by, v, more: met_on_the_way(model, by, scheme, state, v, more, told), self.run.detection, model)

    def _ended(self, opened: _Opened, solved: _Solved, anchor: Moment, end: AtEnd) -> Step:
        """What a step is made of."""
        start, answer = opened.start, solved.answer
        support = self.run.support_impulse(self.scheme, answer, solved.impulse, opened.rigid_mass, solved.after)
        self.clock.lap("assembly")
        return Step(
            number=start.number,
            model=self.run.model,
            scheme=self.scheme,
            previous=start.state,
            state=solved.after,
            contacts=answer.met.contacts,
            H=answer.met.handed_out,
            problem=answer.problem,
            result=answer.result,
            reduction=answer.reduction,
            start=answer.start,
            earlier=tuple(start.memory[: MEMORY - 1]),
            anchor=anchor,
            support_impulse=support,
            attempts=tuple(self.attempts),
            seconds=self.clock.seconds,
            whole_per_part=opened.whole_per_part,
            encounter=answer.met,
            variables=answer.met.remember(self.scheme.law, answer.result.u, answer.result.r, answer.v),
            lead=solved.past.lead,
            linearised=answer.linearised,
            linked=opened.links.rows,
            linkage=self.run.linkage,
            penetration=end.penetration,
            struck=opened.impact,
        )
