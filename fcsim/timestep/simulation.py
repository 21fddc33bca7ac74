"""The simulation: an iterator of steps. Exporters, views, progress bars and checkpoints are consumers of it."""

from __future__ import annotations

from collections.abc import Iterator
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
from fcsim.errors import InputError
from fcsim.problem import GlobalProblem
from fcsim.problem.reduction import Reduction
from fcsim.solvers import Memory
from fcsim.timestep.chain import Clock, SolverSettings, not_converged, solve_chain
from fcsim.timestep.linearisation import MAX_ITERATIONS, Linearisation
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State, at_rest
from fcsim.timestep.step import Attempt, Moment, Step
from fcsim.timestep.step_compliance import StepCompliance
from fcsim.timestep.warm_start import MEMORY, warm_start


@dataclass(frozen=True, eq=False)
class Simulation:
    """A model, where it may touch itself, and how it moves in time; iterate over it for its steps.

    The factors of deformable bodies and their compliances are computed on the first step and kept: only the small blocks of rotating
    rigid bodies change. What changes little from step to step, the factors of the solver's own linear systems, serves up to `keep` steps
    as an approximation; it is forgotten after the steps whose numbers are multiples of `keep`, the anchors, from which a resumed run
    rebuilds it.

    A step that does not converge is halved, and halved again up to `cuttings` times (0: never); sub-steps that converge are doubled
    again as soon as they end where a longer one would. Steps always end on the grid of h, and only there is something yielded.
    """

    model: Model
    detector: Detection
    scheme: Scheme
    steps: int
    solver: SolverSettings = field(default_factory=SolverSettings)
    initial: State | None = None
    keep: int = 25
    cuttings: int = 5

    def __post_init__(self) -> None:
        if self.keep < 0:
            raise InputError(f"keep: expected a whole number >= 0, got {self.keep}")
        if self.steps < 0:
            raise InputError(f"steps: expected a whole number >= 0, got {self.steps}")
        if not 0 <= self.cuttings <= 20:
            raise InputError(f"cuttings: expected a whole number from 0 to 20, got {self.cuttings}")
        object.__setattr__(self, "model", self.model.moving(self.scheme.kinematics))
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

    def run(self, after: Moment | None = None, anchor: Moment | None = None) -> Iterator[Step]:
        """Yield the steps after a moment (default: the initial state).

        With that moment's `anchor` the steps between the two are computed again first, and what follows is bit by bit what the whole
        run gives; without it, up to the solver's tolerance.
        """
        after = after or Moment(0, self.initial or at_rest(self.model))
        moment = anchor = after if anchor is None or not self.keep or after.number % self.keep == 0 else anchor
        kept: dict[int, Memory] | None = {} if self.keep else None
        while moment.number < self.steps:
            step = self.step(moment, kept, anchor)
            moment = step.moment
            if step.number > after.number:
                yield step
            del step  # its W is not kept while the next one is made
            if self.keep and moment.number % self.keep == 0:
                kept, anchor = {}, moment

    def step(self, after: Moment, kept: dict[int, Memory] | None = None, anchor: Moment | None = None) -> Step:
        """Compute the step after a moment, cut where it must be; raises NotConverged when the solver chain fails on the shortest part.

        kept: what serves the next problems (see `fcsim.solvers.memory`), by the number of cuts; this step's takes its place there.
        """
        clock, attempts = Clock(), list[Attempt]()
        cuts, position, end = after.cuts, 0, 2**self.cuttings
        moment, before, substeps = replace(after, number=after.number + 1), None, 0
        while True:
            part = self._part(moment, cuts, kept, anchor or after, clock, attempts)
            if part is None:
                if cuts == self.cuttings:
                    raise not_converged(
                        self.solver, moment.number, (after.state.t, after.state.t + self.scheme.h, moment.state.t), self.cuttings, attempts
                    )
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
        self, start: Moment, cuts: int, kept: dict[int, Memory] | None, anchor: Moment, clock: Clock, attempts: list[Attempt]
    ) -> Step | None:
        """The step, or its next part of the length h / 2^cuts; None where the solver chain fails. What was tried goes into `attempts`."""
        model, state = self.model, start.state
        scheme = self.scheme.cut(2**cuts) if cuts else self.scheme
        whole_per_part = scheme.force_per_reaction / self.scheme.force_per_reaction
        configuration = scheme.detection_configuration(model, state)
        contacts = scheme.select(self.detector(model.positions(configuration)))
        H = model.contact_matrix(contact_matrix(contacts, model.n_nodes), configuration)
        clock.lap("detection")
        elastic = Linearisation(scheme, model, state)
        rest = scheme.right_hand_side(model, state)
        rigid_mass = scheme.rigid_mass(model, state, rest)
        factor = self._system(scheme).with_rigid_mass(rigid_mass)
        factor = factor if elastic.rotation is None else factor.turned(elastic.rotation)
        driven = scheme.driven(model, state)
        w = scheme.contact_velocity(state, contacts, H)
        clock.lap("assembly")
        memory = start.memory if whole_per_part == 1 else tuple(replace(old, r=old.r / whole_per_part) for old in start.memory)
        serving = None if kept is None else kept.pop(cuts, Memory.of(contacts.identity)).follow(contacts.identity)
        compliance, term = StepCompliance(factor), elastic.term(elastic.first)
        for iteration in range(MAX_ITERATIONS):
            load = rest - term
            problem = self._problem(factor, H, load, w, driven, contacts.mu)
            reduction = Reduction(problem, compliance)
            if len(contacts):
                compliance = replace(compliance, summed=reduction.local.W)
            clock.lap("assembly")
            if not iteration:
                r = warm_start(reduction.local, contacts, memory) if len(contacts) else np.empty(0)
            tol = self.solver.tol * min(1.0, self._longest_flight(reduction, scheme.force_per_reaction))
            result, serving = solve_chain(self.solver, reduction, r if not iteration else result.r, tol, 0.5**cuts, attempts, serving)
            clock.lap("solve")
            if result is None:
                break
            v = np.empty(model.n_dofs)
            v[model.free_dofs] = result.v if model.driven == "eliminated" else result.v[model.free_dofs]  # type: ignore[index]
            v[model.driven_dofs] = driven
            if elastic.rotation is None:
                break
            old, term = term, elastic.term(v)
            clock.lap("assembly")
            if not np.any(elastic.change(old, term, rest) > 1):
                break
        else:
            result = None
        if kept is not None and serving is not None:
            kept[cuts] = serving
        if result is None:
            return None
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

    def _longest_flight(self, reduction: Reduction, force_per_reaction: float) -> float:
        """How far the bodies may fly freely in one step, the size of the model, relative to how far they do; infinity where they rest.

        Bodies that only contact holds move freely by f / (eta M / h^2) in q, which may be kilometres: an error relative to that would
        take metres of penetration for converged, so that free motion counts up to the size of the model only.
        """
        free = float(np.linalg.norm(reduction.q))
        return self._extent * force_per_reaction * float(np.sqrt(reduction.problem.nc)) / free if free else np.inf
