"""The simulation: an iterator of steps. Exporters, views, progress bars and checkpoints are consumers of it."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.arrays import FloatArray
from fcsim.assembly.compliance import SystemFactor
from fcsim.assembly.model import Model
from fcsim.contact_detection import Detection, contact_matrix
from fcsim.contact_detection.contacts import Contacts
from fcsim.errors import InputError, NotConverged, Penetration
from fcsim.problem import GlobalProblem, contact_status
from fcsim.problem.reduction import Reduction
from fcsim.solvers import Memory, Result, Status, method, solve
from fcsim.solvers.base import override
from fcsim.timestep.energy import Energy
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State, at_rest
from fcsim.timestep.warm_start import MEMORY, Reactions, warm_start
from fcsim.witness import Overlap, Watch, Witness, begin, penetration_seen


@dataclass(frozen=True, kw_only=True)
class SolverSettings:
    """Which solver a step uses, and what follows when it does not converge.

    The chain of a step: `name` from the previous steps' reactions (see `warm_start`), `name` from zero, then each of `fallback` from
    zero. The first answer below `tol` is taken; if none is, the step raises NotConverged. floor [m/s; quasi-statics: m]: see
    `fcsim.problem.error`.
    """

    name: str = "NSN-AC"
    tol: float = 1e-8
    floor: float = 1e-3
    options: Mapping[str, Any] = field(default_factory=dict)
    fallback: tuple[str, ...] = ("NSN-NM", "NSN-AC-HYBRID", "auto")

    def __post_init__(self) -> None:
        override(method(self.name).options, dict(self.options))
        for name in self.fallback:
            method(name)
        if not self.tol > 0:
            raise InputError(f"tol: expected a number > 0, got {self.tol}")
        if not self.floor >= 0:
            raise InputError(f"floor: expected a number >= 0, got {self.floor}")


@dataclass(frozen=True)
class Attempt:
    """One link of the fallback chain: the solver, where it started ("previous steps" or "zero") and how it ended.

    share: the part of the step that was attempted, 1 or, where the step was cut, 1/2, 1/4, ...; tol: the error asked for
    """

    solver: str
    start: str
    status: str
    error: float
    iterations: int
    share: float
    tol: float

    def __str__(self) -> str:
        return f"{self.solver} from {self.start}: {self.status}, error {self.error:.2e}"


@dataclass(frozen=True, eq=False)
class Moment:
    """The end of step `number`, all that the next steps depend on: its state, the last reactions (newest first), and how many times
    the next step is halved before it is tried."""

    number: int
    state: State
    memory: tuple[Reactions, ...] = ()
    cuts: int = 0


@dataclass(frozen=True, eq=False)
class Step:
    """One finished step: all that export and view need. Where a step was cut, it is its last sub-step, which ends when the step ends.

    scheme            the scheme whose step it is, of the sub-step's length where the step was cut
    previous, state   the states at its beginning and end
    H                 contact matrix (n_dofs, m) over all dofs, driven ones included
    problem, result   the global problem and its answer
    reduction         its local form, and v from r
    start, earlier    (m,) where the solver began, and the reactions of earlier steps, newest first, see `warm_start`
    anchor            where the factors began that served this step, see `Simulation`
    support_impulse   (n_dofs,) from A v - f - H r: at driven dofs the reaction of the supports [N s; quasi-statics: N], zero elsewhere
    attempts          what the solver chain tried, the last one converged; of all sub-steps
    seconds           by phase: detection, assembly, solve; of all sub-steps
    substeps          into how many parts the step was cut; 1 where it was not
    before            balance of energy of the earlier sub-steps, None where there are none
    whole_per_part    reactions of the whole step per reaction of the sub-step: the ratio of their lengths for impulses, 1 for forces
    cuts              see `Moment`
    overlap           of the bodies at the end of the step, see `fcsim.witness`; None where it was not measured
    """

    number: int
    model: Model
    scheme: Scheme
    previous: State
    state: State
    contacts: Contacts
    H: Any
    problem: GlobalProblem
    result: Result
    reduction: Reduction
    start: FloatArray
    earlier: tuple[Reactions, ...]
    anchor: Moment
    support_impulse: FloatArray
    attempts: tuple[Attempt, ...]
    seconds: Mapping[str, float]
    substeps: int = 1
    before: Energy | None = None
    whole_per_part: float = 1.0
    cuts: int = 0
    overlap: Overlap | None = None

    @property
    def memory(self) -> tuple[Reactions, ...]:
        """The last reactions, newest first."""
        return (self.reactions, *self.earlier)

    @property
    def moment(self) -> Moment:
        return Moment(self.number, self.state, self.memory, self.cuts)

    @property
    def reactions(self) -> Reactions:
        d = self.contacts.dimension
        return Reactions(self.contacts.identity, self.contacts.frame, self.whole_per_part * self.result.r.reshape(-1, d))

    @property
    def force_per_reaction(self) -> float:
        """Force [N] of a unit reaction: 1/h for impulses, 1 for forces."""
        return self.scheme.force_per_reaction

    @property
    def iterations(self) -> int:
        """Iterations of the solves that were taken: of one, or where the step was cut of one a sub-step."""
        return sum(a.iterations for a in self.attempts if a.status == Status.SOLVED.value)

    @cached_property
    def energy(self) -> Energy:
        """The balance of energy over the step."""
        own = self.scheme.energy(self.model, self.previous, self.state, self.H, self.result, self.support_impulse)
        return own if self.before is None else self.before.then(own)

    @cached_property
    def contact_force(self) -> FloatArray:
        """Forces (nc, d) [N] on the slave bodies in the contacts' frames (N, T1[, T2])."""
        return self.force_per_reaction * self.result.r.reshape(-1, self.contacts.dimension)

    @cached_property
    def contact_status(self) -> NDArray[np.int8]:
        """0 open, 1 stick, 2 slip (nc,)."""
        return contact_status(self.result.r, self.contacts.mu, self.contacts.dimension)

    @cached_property
    def force_in_space(self) -> FloatArray:
        """Forces (nc, d) [N] on the slave bodies in the world axes."""
        return np.einsum("aij,ai->aj", self.contacts.frame, self.contact_force)

    def contact_force_on(self, body: int) -> FloatArray:
        """Resultant (d,) [N] of the contact forces on a body."""
        slave, master = self.contacts.bodies.T
        return self.force_in_space[slave == body].sum(axis=0) - self.force_in_space[master == body].sum(axis=0)

    @property
    def friction_dissipation(self) -> float:
        """-sum r_T . u_T [J; quasi-statics: J], never negative."""
        return self.energy.friction_dissipation

    @property
    def penetration(self) -> float:
        """Deepest overlap [m] in the configuration where the step detected its contacts, at least 0."""
        return float(np.maximum(-self.contacts.gap, 0).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class Simulation:
    """A model, where it may touch itself, and how it moves in time; iterate over it for its steps.

    The factors of deformable bodies and their compliances are computed on the first step and kept: only the small blocks of rotating
    rigid bodies change. What changes little from step to step, the factors of the solver's own linear systems, serves up to `keep` steps
    as an approximation; it is forgotten after the steps whose numbers are multiples of `keep`, the anchors, from which a resumed run
    rebuilds it.

    A step that does not converge is halved, and halved again up to `cuttings` times (0: never); sub-steps that converge are doubled
    again as soon as they end where a longer one would. Steps always end on the grid of h, and only there is something yielded.

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
    witness: Witness | None = field(default_factory=Witness)

    def __post_init__(self) -> None:
        if self.keep < 0:
            raise InputError(f"keep: expected a whole number >= 0, got {self.keep}")
        if self.steps < 0:
            raise InputError(f"steps: expected a whole number >= 0, got {self.steps}")
        if not 0 <= self.cuttings <= 20:
            raise InputError(f"cuttings: expected a whole number from 0 to 20, got {self.cuttings}")
        self.scheme.refuse(self.model)  # before anything runs

    def __iter__(self) -> Iterator[Step]:
        return self.run()

    @cached_property
    def contact_nodes(self) -> NDArray[np.int64]:
        """Nodes that contacts can touch."""
        return self.detector.nodes

    @cached_property
    def factor(self) -> SystemFactor:
        """Of the system matrix in the reference configuration."""
        return self._system(self.scheme)

    @property
    def matrix(self) -> Any:
        """The problems' M in the reference configuration; one object for all steps that are not cut unless rigid bodies' inertia turns."""
        return self.factor.matrix()

    @cached_property
    def _systems(self) -> dict[tuple[float, float], SystemFactor]:
        return {}

    def _system(self, scheme: Scheme) -> SystemFactor:
        """The factor of a scheme's system matrix: made once for all steps of its length."""
        factors = scheme.factors(self.model)
        if factors not in self._systems:
            self._systems[factors] = SystemFactor(self.model, *factors, self.contact_nodes)
        return self._systems[factors]

    @cached_property
    def _extent(self) -> float:
        """Size of the model [m]."""
        return float(np.ptp(self.model.reference, axis=0).max())

    @cached_property
    def watch(self) -> Watch | None:
        """The witness at work, from the initial state on; InputError where it refuses that."""
        initial = self.initial or at_rest(self.model)
        return None if self.witness is None else begin(self.witness, self.model, initial.x)

    @property
    def notes(self) -> tuple[str, ...]:
        """What the summary of a run says of the scheme and of the witness."""
        seen = ("overlap of bodies is not witnessed",) if self.watch is None else self.watch.notes
        return (*self.scheme.notes, *seen)

    def _witnessed(self, step: Step) -> Step:
        """The step with its overlap, where it is one that is measured."""
        if self.watch is None or (step.number % self.watch.witness.every and step.number != self.steps):
            return step
        return replace(step, overlap=self.watch.look(step.state.x))

    def run(self, after: Moment | None = None, anchor: Moment | None = None) -> Iterator[Step]:
        """Yield the steps after a moment (default: the initial state).

        With that moment's `anchor` the steps between the two are computed again first, and what follows is bit by bit what the whole
        run gives; without it, up to the solver's tolerance.
        """
        watch = self.watch  # refuses before anything is computed
        after = after or Moment(0, self.initial or at_rest(self.model))
        moment = anchor = after if anchor is None or not self.keep or after.number % self.keep == 0 else anchor
        kept: dict[int, Memory] | None = {} if self.keep else None
        while moment.number < self.steps:
            step = self._witnessed(self.step(moment, kept, anchor))
            moment = step.moment
            if step.number > after.number:
                yield step
            if watch is not None and watch.witness.stop and step.overlap is not None and step.overlap.beyond:
                raise Penetration(penetration_seen(step.number, step.state.t, step.overlap, watch.witness.tolerance))
            del step  # its W is not kept while the next one is made
            if self.keep and moment.number % self.keep == 0:
                kept, anchor = {}, moment

    def step(self, after: Moment, kept: dict[int, Memory] | None = None, anchor: Moment | None = None) -> Step:
        """Compute the step after a moment, cut where it must be; raises NotConverged when the solver chain fails on the shortest part.

        kept: what serves the next problems (see `fcsim.solvers.memory`), by the number of cuts; this step's takes its place there.
        """
        clock, attempts = _Clock(), list[Attempt]()
        cuts, position, end = after.cuts, 0, 2**self.cuttings
        moment, before, substeps = replace(after, number=after.number + 1), None, 0
        while True:
            part = self._part(moment, cuts, kept, anchor or after, clock, attempts)
            if part is None:
                if cuts == self.cuttings:
                    raise self._not_converged(moment, after.state.t, attempts)
                cuts += 1
                continue
            position, substeps = position + (end >> cuts), substeps + 1
            if cuts and position % (end >> (cuts - 1)) == 0:
                cuts -= 1
            if position == end:
                state = replace(part.state, t=after.state.t + self.scheme.h)  # h/2 + h/2 may not be h to the last bit of t
                return replace(
                    part, state=state, attempts=tuple(attempts), seconds=clock.seconds, substeps=substeps, before=before, cuts=cuts
                )
            before = part.energy if before is None else before.then(part.energy)
            moment = part.moment

    def _part(
        self, start: Moment, cuts: int, kept: dict[int, Memory] | None, anchor: Moment, clock: _Clock, attempts: list[Attempt]
    ) -> Step | None:
        """The step, or its next part of the length h / 2^cuts; None where the solver chain fails. What was tried goes into `attempts`."""
        model, state = self.model, start.state
        scheme = self.scheme.cut(2**cuts) if cuts else self.scheme
        whole_per_part = scheme.force_per_reaction / self.scheme.force_per_reaction
        configuration = scheme.detection_configuration(model, state)
        contacts = scheme.select(self.detector(model.positions(configuration)))
        H = model.contact_matrix(contact_matrix(contacts, model.n_nodes), configuration)
        clock.lap("detection")
        load = scheme.right_hand_side(model, state)
        rigid_mass = scheme.rigid_mass(model, state, load)
        factor = self._system(scheme).with_rigid_mass(rigid_mass)
        driven = scheme.driven(model, state)
        problem = self._problem(factor, H, load, scheme.contact_velocity(state, contacts, H), driven, contacts.mu)
        reduction = Reduction(problem, factor)
        if len(contacts):
            _ = reduction.local
        clock.lap("assembly")
        memory = start.memory if whole_per_part == 1 else tuple(replace(old, r=old.r / whole_per_part) for old in start.memory)
        r = warm_start(reduction.local, contacts, memory) if len(contacts) else np.empty(0)
        serving = None if kept is None else kept.pop(cuts, Memory.of(contacts.identity)).follow(contacts.identity)
        result, serving = self._solve(reduction, r, scheme.force_per_reaction, 0.5**cuts, attempts, serving)
        if kept is not None and serving is not None:
            kept[cuts] = serving
        clock.lap("solve")
        if result is None:
            return None
        v = np.empty(model.n_dofs)
        v[model.free_dofs] = result.v if model.driven == "eliminated" else result.v[model.free_dofs]  # type: ignore[index]
        v[model.driven_dofs] = driven
        impulse = H @ result.r
        support = scheme.support_impulse(model, factor.apply(v) - load - impulse, impulse)
        after = scheme.advance(model, state, v, impulse, rigid_mass)
        clock.lap("assembly")
        return Step(
            number=start.number,
            model=model,
            scheme=scheme,
            previous=state,
            state=after,
            contacts=contacts,
            H=H,
            problem=problem,
            result=result,
            reduction=reduction,
            start=r,
            earlier=tuple(start.memory[: MEMORY - 1]),
            anchor=anchor,
            support_impulse=support,
            attempts=tuple(attempts),
            seconds=clock.seconds,
            whole_per_part=whole_per_part,
        )

    def _problem(self, factor: SystemFactor, H: Any, load: FloatArray, w: FloatArray, driven: FloatArray, mu: FloatArray) -> GlobalProblem:
        """The problem on the model's unknowns; what driven dofs do enters f and w."""
        model = self.model
        free = model.free_dofs
        f = load
        if np.any(driven):
            moved = np.zeros(model.n_dofs)
            moved[model.driven_dofs] = driven
            w = w + H.T @ moved
            f = load - factor.apply(moved)
        if model.driven == "eliminated":
            f, free_H = f[free], sp.csr_array(H[free])
        else:
            f = f.copy()
            f[model.driven_dofs] = driven
            mask = np.zeros(model.n_dofs)
            mask[free] = 1
            free_H = sp.csr_array(sp.diags_array(mask) @ H)
        return GlobalProblem(factor.matrix(), free_H, f, w, mu, dimension=model.dimension)

    def _solve(
        self,
        reduction: Reduction,
        warm: FloatArray,
        force_per_reaction: float,
        share: float,
        attempts: list[Attempt],
        kept: Memory | None,
    ) -> tuple[Result | None, Memory | None]:
        """The first answer of the chain that is solved, None where none is; and what the chain leaves for the next problem."""
        settings = self.solver
        chain: list[tuple[str, str, Mapping[str, Any]]] = [(settings.name, "previous steps", settings.options)]
        if np.any(warm):
            chain.append((settings.name, "zero", settings.options))
        chain += [(name, "zero", {}) for name in settings.fallback if name != settings.name]
        tol = settings.tol * min(1.0, self._longest_flight(reduction, force_per_reaction))
        for name, start, options in chain:
            r = warm if start == "previous steps" else None
            result = solve(reduction, name, r, tol=tol, floor=settings.floor, memory=kept, **options)
            kept = result.memory
            attempts.append(Attempt(name, start, result.status.value, result.error, result.iterations, share, tol))
            if result.solved:
                return replace(result, memory=None), kept
        return None, kept

    def _longest_flight(self, reduction: Reduction, force_per_reaction: float) -> float:
        """How far the bodies may fly freely in one step, the size of the model, relative to how far they do; infinity where they rest.

        Bodies that only contact holds move freely by f / (eta M / h^2) in q, which may be kilometres: an error relative to that would
        take metres of penetration for converged, so that free motion counts up to the size of the model only.
        """
        free = float(np.linalg.norm(reduction.q))
        return self._extent * force_per_reaction * float(np.sqrt(reduction.problem.nc)) / free if free else np.inf

    def _not_converged(self, start: Moment, t: float, attempts: Sequence[Attempt]) -> NotConverged:
        """The error that says what was tried on the last part, and how short that is."""
        h, last = self.scheme.h, attempts[-1]
        tried = "; ".join(map(str, (a for a in attempts[_last_solved(attempts) + 1 :] if a.share == last.share)))
        text = f"step {start.number} did not converge to {last.tol:.3g} ({tried})"
        if self.cuttings:
            text += (
                f", from t = {t:.6g} to {t + h:.6g} s: cut into parts of h/2 to h/{2**self.cuttings} = {last.share * h:.3g} s, the last "
                f"from t = {start.state.t:.6g} s"
            )
        if last.tol != self.solver.tol:
            text += "; bodies fly farther than the model is large in one step: choose a larger eta or a smaller h"
        return NotConverged(text)


def _last_solved(attempts: Sequence[Attempt]) -> int:
    return max((k for k, attempt in enumerate(attempts) if attempt.status == Status.SOLVED.value), default=-1)


class _Clock:
    """Seconds by phase."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, phase: str) -> None:
        now = time.perf_counter()
        self.seconds[phase] = self.seconds.get(phase, 0.0) + now - self._last
        self._last = now
