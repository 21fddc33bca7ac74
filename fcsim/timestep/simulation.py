"""The simulation: an iterator of steps. Exporters, views, progress bars and checkpoints are consumers of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.arrays import FloatArray, is_number
from fcsim.assembly.compliance import SystemFactor
from fcsim.assembly.kinematics.deformation import DeformationMeasure
from fcsim.assembly.locking import locking_parts
from fcsim.assembly.model import Model
from fcsim.brief import brief, by_fields, shown
from fcsim.contact_detection import Detection, Everything, innermost, left_out
from fcsim.contact_law.proportions import Proportions, proportions
from fcsim.errors import InputError, Penetration
from fcsim.linkage import Linkage
from fcsim.runtime import limited_threads
from fcsim.solvers import Memory
from fcsim.timestep.beginning.first_half import passes, refuse_going_through
from fcsim.timestep.beginning.impact import remark, struck
from fcsim.timestep.chain import Attempt, Clock, SolverSettings, given_up, not_converged, settings_of_model
from fcsim.timestep.creation import REST, energy_at_rest, refuse_creation
from fcsim.timestep.encounter import Anew, Encounter, Told, encounter, met_on_the_way
from fcsim.timestep.energy import Energy
from fcsim.timestep.limits import NAMED_STRAIN, Limits, refuse_beyond
from fcsim.timestep.links.linked import linked, refuse_linkage, refuse_unseen_cables
from fcsim.timestep.reactions.warm_start import MEMORY
from fcsim.timestep.regularisation.doubts import doubts
from fcsim.timestep.remarks.arguments import refuse_arguments, whole_number
from fcsim.timestep.remarks.of_steps import StepRemarks
from fcsim.timestep.remarks.opening import opening_remarks
from fcsim.timestep.remarks.same_on_all_ranks import same_on_all_ranks
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State, at_rest, refuse_misplaced, updated
from fcsim.timestep.step import Moment, Step
from fcsim.timestep.step_equation.closing import Closing
from fcsim.timestep.step_equation.end_velocity import turning_impulse
from fcsim.timestep.step_equation.equation import Answer, Equation, Past
from fcsim.timestep.step_equation.linearisation import Linearisation, joined_nodes
from fcsim.timestep.step_equation.look_ahead.ahead import ROUNDS, borne_at_first, looked_ahead
from fcsim.timestep.step_equation.penetration import at_end
from fcsim.timestep.step_equation.sequence import solve_equation
from fcsim.timestep.step_equation.settling import solve_settled
from fcsim.witness import Watch, Witness, begin, penetration_seen


@dataclass(frozen=True, eq=False)
class Simulation:
    """A model, where it may touch itself, and how it moves in time; iterate over it for its steps.

    The factors of deformable bodies and their compliances are computed on the first step and kept: only the small blocks of rotating
    rigid bodies change. What changes little from step to step, the factors of the solver's own linear systems, serves up to `keep` steps
    as an approximation; it is forgotten after the steps whose numbers are multiples of `keep`, the anchors, from which a resumed run
    rebuilds it.

    A step that does not converge is halved, and halved again up to `cuttings` times (0: never), one in which bodies sink into each other
    up to three times, see `at_end`; sub-steps are doubled again where a longer one would end. Only on the grid of h is something yielded.
    created: contacts that create more than this share of the energy that the run began with and that loads and supports have supplied
    raise EnergyCreated (inf: never); see `Ledger`. Not in quasi-statics, where joints that begin under pressure are meant.
    limits: bodies beyond them raise KinematicsLeft after the step that is yielded last, see `Limits`; what comes near them is said once,
    in the remarks of a step.
    linkage: the links that hold bodies together, equality constraints of every step, see `Closing`.

    The witness measures the bodies' overlap before the first step, every few steps and after the last, and refuses or stops what is
    beyond its tolerance: InputError before the first step, Penetration after the step that is yielded last. None: nobody looks.
    """

    model: Model
    detector: Detection
    scheme: Scheme
    steps: int
    solver: SolverSettings = field(default_factory=SolverSettings)
    initial: State | None = None
    keep: int = 25
    cuttings: int = 5
    created: float = 0.05
    limits: Limits = field(default_factory=Limits)
    linkage: Linkage | None = None
    witness: Witness | None = field(default_factory=Witness)

    __repr__, __reduce__ = brief, by_fields

    def __post_init__(self) -> None:
        refuse_arguments(self, self.model, self.detector, self.scheme)
        for name, largest in (("keep", np.inf), ("steps", np.inf), ("cuttings", 20)):
            object.__setattr__(self, name, whole_number(name, getattr(self, name), largest))
        if not (is_number(self.created, infinite=True) and self.created > 0):
            raise InputError(f"created: expected a share of the energy > 0 (inf: never stop), got {shown(self.created)}")
        object.__setattr__(self, "model", self.model.moving(self.scheme.kinematics))
        self.scheme.refuse(self.model)  # before anything runs
        refuse_linkage(self.linkage, self.model)
        if self.initial is not None:
            refuse_misplaced(self.model, self.initial)
        refuse_unseen_cables(self.linkage, self.model, self.detector, self.initial)

    def __iter__(self) -> Iterator[Step]:
        return self.run()

    @cached_property
    def contact_nodes(self) -> NDArray[np.int64]:
        """Nodes that contacts and links can touch, and in statics those that the tangent of loads that follow joins."""
        nodes = self.detector.nodes if self.linkage is None else np.union1d(self.detector.nodes, self.linkage.nodes)
        return joined_nodes(nodes, self.scheme, self.model)

    @cached_property
    def factor(self) -> SystemFactor:
        """Of the system matrix in the reference configuration."""
        return self.system(self.scheme)

    @property
    def matrix(self) -> sp.csr_array:
        """The problems' M in the reference configuration; one object for all steps that are not cut unless rigid bodies' inertia turns."""
        return self.factor.matrix()

    @cached_property
    def _systems(self) -> dict[tuple[float, float], SystemFactor]:
        return {}

    def system(self, scheme: Scheme) -> SystemFactor:
        """The factor of a scheme's system matrix: made once for all steps of its length."""
        factors = scheme.factors(self.model)
        if factors not in self._systems:
            self._systems[factors] = SystemFactor(self.model, *factors, self.contact_nodes)
        return self._systems[factors]

    @cached_property
    def _proportions(self) -> Proportions:
        return proportions(self.model, isinstance(innermost(self.detector), Everything))

    @cached_property
    def _rest(self) -> float:  # kinetic energy [J] of what is at rest
        return energy_at_rest(self.model, REST * self._extent / self.scheme.h)

    def _settings(self, t: float, nc: int = 1) -> SolverSettings:
        return settings_of_model(self.solver, self.model.size_and_reach, self.scheme.timing, self.model.gravity_at(t + self.scheme.h), nc)

    @cached_property
    def _measure(self) -> DeformationMeasure:
        return DeformationMeasure(self.model.groups, len(self.model.deformable), min(NAMED_STRAIN, self.limits.strain))

    @cached_property
    def _extent(self) -> float:  # size [m] along the axes, turned up to sqrt(d) times as large: tolerances alone are relative to it
        return float(np.ptp(self.model.reference, axis=0).max())

    @cached_property
    def watch(self) -> Watch | None:
        """The witness at work, from the initial state on; InputError where it refuses that."""
        start = self.initial or at_rest(self.model, h=self.scheme.h)
        return None if self.witness is None else begin(self.witness, self.model, start.x, left_out(self.detector))

    @property
    def notes(self) -> tuple[str, ...]:
        """What the summary of a run says of the scheme and of the witness."""
        return (*self.scheme.notes, *(("overlap of bodies is not witnessed",) if self.watch is None else self.watch.notes))

    def _witnessed(self, step: Step) -> Step:
        """The step with its overlap, where it is one that is measured."""
        if self.watch is None or (step.number % self.watch.witness.every and step.number != self.steps):
            return step
        return replace(step, overlap=self.watch.look(step.state.x))

    def _opening(self, state: State) -> tuple[str, ...]:
        """Remarks as a run begins."""
        own = opening_remarks(self.model, self.detector, self.scheme, state, self.steps, self.linkage, self.solver, self._settings(state.t))
        return (*locking_parts(self.model), *own)

    def run(self, after: Moment | None = None, anchor: Moment | None = None) -> Iterator[Step]:
        """Yield the steps after a moment (default: the initial state).

        With that moment's `anchor` the steps between the two are computed again first, and what follows is bit by bit what the whole
        run gives; without it, up to the solver's tolerance.
        """
        watch = self.watch  # refuses before anything is computed
        after = after or Moment(0, self.initial or at_rest(self.model, h=self.scheme.h))
        moment = anchor = after if anchor is None or not self.keep or after.number % self.keep == 0 else anchor
        kept: dict[int, Memory] | None = {} if self.keep else None
        said, remarks = frozenset[str](), StepRemarks(self.detector, self.steps)
        opening = () if after.number else self._opening(after.state)
        while moment.number < self.steps:
            step = self._witnessed(same_on_all_ranks(self.step(moment, kept, anchor)))
            moment, when = step.moment, f"step {step.number}, t = {step.state.t:.6g} s"
            new = remarks(step, deformation := self._measure(step.state.x), when, said)
            if step.number > after.number:
                opening = (*opening, *remark(step.struck)) if step.number == 1 else opening
                yield step.handed_out((*opening, *new.values()))
                opening = ()
            said |= new.keys()
            refuse_beyond(self.limits, self.model, deformation, when)
            if watch is not None and watch.witness.stop and step.overlap is not None and step.overlap.beyond:
                soft = step.encounter.terms.compliance is not None
                raise Penetration(penetration_seen(step.number, step.state.t, step.overlap, watch.witness.tolerance, soft))
            del step  # its W is not kept while the next one is made
            if self.keep and moment.number % self.keep == 0:
                kept, anchor = {}, moment

    @limited_threads()
    def step(self, after: Moment, kept: dict[int, Memory] | None = None, anchor: Moment | None = None) -> Step:
        """Compute the step after a moment, cut where it must be; raises NotConverged when the solver chain fails on the shortest part.

        kept: what serves the next problems (see `fcsim.solvers.memory`), by the number of cuts; this step's takes its place there.
        """
        clock, attempts = Clock(), list[Attempt]()
        cuts, position, end = after.cuts, 0, 2**self.cuttings
        moment, before, substeps, impact = replace(after, number=after.number + 1), None, 0, None
        while True:
            part = self._part(moment, cuts, kept, anchor or after, clock, attempts)
            if part is None:
                if cuts == self.cuttings or given_up(attempts):
                    t, h = after.state.t, self.scheme.h
                    times, until = (t, t + h, moment.state.t), t + (self.steps - after.number) * h
                    why = tuple(doubts(self.model, self.scheme, self.linkage, times, attempts, moment.state, until))
                    why += self._opening(after.state) if moment.number == 1 else ()
                    raise not_converged(self.solver, moment.number, times, cuts, attempts, why)
                cuts += 1
                continue
            last = part.last_energy()
            part.previous.forget()
            part = replace(part, last=last, ledger=moment.ledger.after(last))
            if self.scheme.timing.moving:
                refuse_creation(part, self.created, self._rest, self._extent)
            position, substeps, impact = position + (end >> cuts), substeps + 1, impact or part.struck
            if cuts and position % (end >> (cuts - 1)) == 0:
                cuts -= 1
            if position == end:
                done = replace(part, state=part.state.at(after.state.t + self.scheme.h), seconds=clock.seconds, struck=impact)
                return replace(done, attempts=tuple(attempts), substeps=substeps, before=before, cuts=cuts)
            before = last if before is None else before.then(last)
            moment = part.moment

    def _begun(self, scheme: Scheme, start: Moment, cuts: int, attempts: list[Attempt]) -> tuple[Moment, Energy | None] | None:
        """The moment after what strikes at the beginning of the step, and the balance of that impact; None where bodies would pass each
        other before contacts are looked for: it is to be cut, or refused by InputError. See `beginning`."""
        if scheme.h <= start.seen:
            return start, None
        if passes(self.model, self.detector, scheme, start, self._proportions, cuts == self.cuttings):
            return None

        def solve(equation: Equation, past: Past) -> tuple[Answer | None, Past]:
            return solve_equation(equation, self._settings(start.state.t), self._extent, past, attempts, Clock())

        made = struck(self.model, self.detector, scheme, start, self._proportions, self.linkage, self.system, solve)
        return (start, None) if made is None else (replace(start, state=made.state), made.energy)

    def _met(self, scheme: Scheme, start: Moment, cuts: int, clock: Clock) -> Encounter | None:
        """The contacts of the step; None where bodies would pass each other in it: it is to be cut, or refused by InputError."""
        met = encounter(self.model, self.detector, scheme, start.state, self._proportions, start.variables)
        clock.lap("detection")
        if met.passing is not None and cuts == self.cuttings:
            refuse_going_through(self.model, scheme, met.passing, f"step {start.number}, t = {start.state.t:.6g} s")
        return met if met.passing is None else None

    def support_impulse(self, scheme: Scheme, answer: Answer, impulse: FloatArray, rigid_mass: FloatArray, after: State) -> FloatArray:
        """The supports' impulses (n_dofs,), from what is left of A v - f - H r."""
        residual = answer.factor.apply(answer.v) - answer.load - impulse
        if self.model.nonlinear:
            residual = self.model.driven_share(residual)  # the rest is what Newton's method has left
        support = scheme.support_impulse(self.model, residual, impulse, answer.v, rigid_mass)
        return support + turning_impulse(self.model, answer.v, rigid_mass, after) if scheme.timing.moving else support

    def _anew(self, start: Moment, equation: Equation) -> Anew | None:
        """What finds contacts at the iterates of a step of statics; None in dynamics."""
        if equation.scheme.timing.moving:
            return None
        model, scheme, state = self.model, equation.scheme, start.state
        told = Told(self._proportions, start.variables, trial=equation.met.meeting.trial)
        return Anew(lambda by, v, more: met_on_the_way(model, by, scheme, state, v, more, told), self.detector, model)

    def _part(
        self, start: Moment, cuts: int, kept: dict[int, Memory] | None, anchor: Moment, clock: Clock, attempts: list[Attempt]
    ) -> Step | None:
        """The step, or its next part of the length h / 2^cuts; None where it has no answer. What was tried goes into `attempts`;
        long because it is one step from its contacts to its end."""
        model, scheme = self.model, self.scheme.cut(2**cuts) if cuts else self.scheme
        if (begun := self._begun(scheme, start, cuts, attempts)) is None:
            return None
        start, impact = begun
        state, began = start.state, self._met(scheme, start, cuts, clock)
        if began is None:
            return None
        rest = scheme.right_hand_side(model, state)
        rigid_mass = scheme.rigid_mass(model, state, rest)
        whole_per_part = scheme.force_per_reaction / self.scheme.force_per_reaction
        memory = start.memory if whole_per_part == 1 else tuple(replace(old, r=old.r / whole_per_part) for old in start.memory)
        identity = began.contacts.identity
        past = Past(memory, start.lead, None if kept is None else kept.pop(cuts, Memory.of(identity)).follow(identity))
        elastic = Linearisation(scheme, model, state, past.serving)
        factor = self.system(scheme).with_rigid_mass(rigid_mass).turned(elastic.rotation)
        met, looks, driven, links = began, 0, scheme.driven(model, state), Closing(linked(self.linkage, model, scheme, state), self._extent)
        borne, settings = borne_at_first(model, self.detector, scheme, met), self._settings(start.state.t, len(met.contacts))
        while True:
            equation = Equation(scheme, model, state, met, factor, rest, driven, elastic, 0.5**cuts, links.rows, borne=borne)
            answer, past = solve_settled(equation, settings, self._extent, past, attempts, clock, partial(self._anew, start))
            if kept is not None and past.serving is not None:
                kept[cuts] = past.serving
            if answer is None:
                return None
            result, v, met = answer.result, answer.v, answer.met
            impulse = met.impulse(result.r) + links.impulse(result.multiplier)
            after = updated(model, state, scheme.advance(model, state, v, impulse, rigid_mass))
            if not links.keep(model, scheme, v, result.multiplier, (state, after), attempts, 0.5**cuts):
                if links.given_up:
                    return None
                past = past.of_the_same_step(met.contacts, met.contacts, result.r)
                continue
            ahead = looked_ahead(model, self.detector, scheme, state, met, v, after) if looks < ROUNDS else None
            clock.lap("detection")
            if ahead is None and not borne:
                break
            seen, met, looks = met, ahead or met, looks + (ahead is not None)
            past = past.of_the_same_step(seen.contacts, met.contacts, result.r)
            borne = borne_at_first(model, self.detector, scheme, met, seen) if borne and looks < ROUNDS else 0.0
        met.refuse_driven(model, v, f"step {start.number}, t = {after.t:.6g} s")
        end = at_end(model, self.detector, scheme, began, met, after, state, looks < ROUNDS)
        if end.too_long(cuts, self.cuttings, attempts, self.solver.tol):
            return None
        support = self.support_impulse(scheme, answer, impulse, rigid_mass, after)
        clock.lap("assembly")
        return Step(
            number=start.number,
            model=model,
            scheme=scheme,
            previous=state,
            state=after,
            contacts=met.contacts,
            H=met.handed_out,
            problem=answer.problem,
            result=result,
            reduction=answer.reduction,
            start=answer.start,
            earlier=tuple(start.memory[: MEMORY - 1]),
            anchor=anchor,
            support_impulse=support,
            attempts=tuple(attempts),
            seconds=clock.seconds,
            whole_per_part=whole_per_part,
            encounter=met,
            variables=met.remember(scheme.law, result.u, result.r, v),
            lead=past.lead,
            linearised=answer.linearised,
            linked=links.rows,
            linkage=self.linkage,
            penetration=end.penetration,
            struck=impact,
        )
