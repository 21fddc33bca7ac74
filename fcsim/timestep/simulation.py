"""The simulation: an iterator of steps. Exporters, views, progress bars and checkpoints are consumers of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import is_number
from fcsim.assembly.compliance import SystemFactor
from fcsim.assembly.kinematics.deformation import DeformationMeasure
from fcsim.assembly.locking import locking_parts
from fcsim.assembly.model import Model
from fcsim.assembly.whole.kept_once import keep_in_common
from fcsim.brief import brief, by_fields, shown
from fcsim.contact_detection import Detection, left_out
from fcsim.contact_law import Velocity
from fcsim.errors import InputError, Penetration
from fcsim.linkage import Linkage
from fcsim.runtime import limited_threads
from fcsim.solvers import Memory
from fcsim.timestep.beginning.impact import remark
from fcsim.timestep.chain import Attempt, Clock, SolverSettings, StepTimes, given_up, not_converged
from fcsim.timestep.creation import REST, energy_at_rest, refuse_creation
from fcsim.timestep.limits import NAMED_STRAIN, KinematicsLeft, Limits, refuse_beyond
from fcsim.timestep.links.linked import refuse_linkage, refuse_unseen_cables
from fcsim.timestep.links.mechanisms import left
from fcsim.timestep.regularisation.doubts import doubts
from fcsim.timestep.remarks.arguments import refuse_arguments, whole_number
from fcsim.timestep.remarks.of_steps import StepRemarks
from fcsim.timestep.remarks.opening import opening_remarks
from fcsim.timestep.remarks.same_on_all_ranks import same_on_all_ranks
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State, at_rest, refuse_misplaced
from fcsim.timestep.step import Moment, Step
from fcsim.timestep.substep import Substep, Substeps
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

    The witness measures the bodies' overlap before the first step, every few steps (each in which bodies turn fast) and after the last,
    and refuses or stops what is beyond its tolerance: InputError before the first step, Penetration after the step that is yielded last.
    None: nobody looks.
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
    def substeps(self) -> Substeps:
        """What computes the parts of steps."""
        return Substeps(self.model, self.detector, self.scheme, self.solver, self.cuttings, self.linkage)

    @cached_property
    def factor(self) -> SystemFactor:
        """Of the system matrix in the reference configuration."""
        return self.substeps.system(self.scheme)

    @property
    def matrix(self) -> sp.csr_array:
        """The problems' M in the reference configuration; one object for all steps that are not cut unless rigid bodies' inertia turns."""
        return self.factor.matrix()

    @cached_property
    def _energy_at_rest(self) -> float:
        """Kinetic energy [J] of what is at rest."""
        return energy_at_rest(self.model, REST * self.substeps.extent / self.scheme.h)

    @cached_property
    def _measure(self) -> DeformationMeasure:
        return DeformationMeasure(self.model.groups, len(self.model.deformable), min(NAMED_STRAIN, self.limits.strain))

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
        if self.watch is None:
            return step
        h = self.scheme.h if self.scheme.timing.moving else 0.0
        if step.number % self.watch.witness.every and step.number != self.steps and not self.watch.always(step.state.v, h):
            return step
        return replace(step, overlap=self.watch.look(step.state.x))

    def _opening(self, state: State) -> tuple[str, ...]:
        """Remarks as a run begins."""
        settings = self.substeps.settings(state.t)
        own = opening_remarks(self.model, self.detector, self.scheme, state, self.steps, self.linkage, self.solver, settings)
        return (*locking_parts(self.model), *own)

    def run(self, after: Moment | None = None, anchor: Moment | None = None) -> Iterator[Step]:
        """Yield the steps after a moment (default: the initial state).

        With that moment's `anchor` the steps between the two are computed again first, and what follows is bit by bit what the whole
        run gives; without it, up to the solver's tolerance.
        """
        watch = self.watch  # refuses before anything is computed
        keep_in_common(self.model)
        if self.model.shares is not None:
            self.substeps.keep_in_common()
        if watch is not None:
            vars(self)["watch"] = watch = watch.in_common()
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
            try:
                refuse_beyond(self.limits, self.model, deformation, when)
            except KinematicsLeft as error:
                raise left(error, self.model, self.linkage, self.scheme, after.state) from None
            if watch is not None and watch.witness.stop and step.overlap is not None and step.overlap.beyond:
                soft = step.encounter.terms.compliance is not None
                late = isinstance(self.scheme.law, Velocity)
                raise Penetration(penetration_seen(step.number, step.state.t, step.overlap, watch.witness.tolerance, soft, late))
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
            part = Substep.of(self.substeps, cuts, clock, attempts).after(moment, kept, anchor or after)
            if part is None:
                if cuts == self.cuttings or given_up(attempts):
                    t, h = after.state.t, self.scheme.h
                    times, until = StepTimes(t, t + h, moment.state.t), t + (self.steps - after.number) * h
                    why = tuple(doubts(self.model, self.scheme, self.linkage, times, attempts, moment.state, until))
                    why += self._opening(after.state) if moment.number == 1 else ()
                    raise not_converged(self.solver, moment.number, times, cuts, attempts, why)
                cuts += 1
                continue
            last = part.last_energy()
            part.previous.forget()
            part = replace(part, last=last, ledger=moment.ledger.after(last))
            if self.scheme.timing.moving:
                refuse_creation(part, self.created, self._energy_at_rest, self.substeps.extent)
            position, substeps, impact = position + (end >> cuts), substeps + 1, impact or part.struck
            if cuts and position % (end >> (cuts - 1)) == 0:
                cuts -= 1
            if position == end:
                done = replace(part, state=part.state.at(after.state.t + self.scheme.h), seconds=clock.seconds, struck=impact)
                return replace(done, attempts=tuple(attempts), substeps=substeps, before=before, cuts=cuts)
            before = last if before is None else before.then(last)
            moment = part.moment
