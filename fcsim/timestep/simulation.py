"""The simulation: an iterator of steps. Exporters, views, progress bars and checkpoints are consumers of it."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.assembly.compliance import SystemFactor
from fcsim.assembly.model import Model
from fcsim.contact_detection import Detector, contact_matrix
from fcsim.contact_detection.contacts import Contacts
from fcsim.errors import InputError, NotConverged
from fcsim.problem import GlobalProblem, contact_status
from fcsim.reduction import Reduction
from fcsim.solvers import Result, method, solve
from fcsim.solvers.base import override
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State, at_rest
from fcsim.timestep.warm_start import MEMORY, Reactions, warm_start

FloatArray = NDArray[np.float64]


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
    """One link of the fallback chain: the solver, where it started ("previous steps" or "zero") and how it ended."""

    solver: str
    start: str
    status: str
    error: float
    iterations: int


@dataclass(frozen=True, eq=False)
class Moment:
    """The end of step `number`: its state and the last reactions (newest first), all that the next steps depend on."""

    number: int
    state: State
    memory: tuple[Reactions, ...] = ()


@dataclass(frozen=True, eq=False)
class Step:
    """One finished step: all that export and view need.

    previous, state   the states at its beginning and end
    H                 contact matrix (n_dofs, m) over all dofs, driven ones included
    problem, result   the global problem and its answer
    reduction         its local form, and v from r
    start, earlier    (m,) where the solver began, and the reactions of earlier steps, newest first, see `warm_start`
    anchor            where the factors began that served this step, see `Simulation`
    support_impulse   (n_dofs,) A v - f - H r: at driven dofs the reaction of the supports [N s; quasi-statics: N], zero elsewhere
    attempts          what the solver chain tried, the last one converged
    seconds           by phase: detection, assembly, solve
    """

    number: int
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
    force_per_reaction: float
    attempts: tuple[Attempt, ...]
    seconds: Mapping[str, float]

    @property
    def memory(self) -> tuple[Reactions, ...]:
        """The last reactions, newest first."""
        return (self.reactions, *self.earlier)

    @property
    def moment(self) -> Moment:
        return Moment(self.number, self.state, self.memory)

    @property
    def reactions(self) -> Reactions:
        d = self.contacts.dimension
        return Reactions(self.contacts.identity, self.contacts.frame, self.result.r.reshape(-1, d))

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
        d = self.contacts.dimension
        r, u = self.result.r.reshape(-1, d), self.result.u.reshape(-1, d)
        return -float(np.einsum("ai,ai->", r[:, 1:], u[:, 1:]))

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
    """

    model: Model
    detector: Detector
    scheme: Scheme
    steps: int
    solver: SolverSettings = field(default_factory=SolverSettings)
    initial: State | None = None
    keep: int = 25

    def __post_init__(self) -> None:
        if self.keep < 0:
            raise InputError(f"keep: expected a whole number >= 0, got {self.keep}")
        if self.steps < 0:
            raise InputError(f"steps: expected a whole number >= 0, got {self.steps}")

    def __iter__(self) -> Iterator[Step]:
        return self.run()

    @cached_property
    def contact_nodes(self) -> NDArray[np.int64]:
        """Nodes that contacts can touch."""
        nodes = [surface.facets.ravel() for pair in self.detector.pairs for surface in (pair.slave, pair.master)]
        touched = np.unique(np.concatenate(nodes))
        return touched[touched >= 0]

    @cached_property
    def factor(self) -> SystemFactor:
        """Of the system matrix in the reference configuration."""
        return SystemFactor(self.model, *self.scheme.factors(self.model), self.contact_nodes)

    @property
    def matrix(self) -> Any:
        """The problems' M in the reference configuration; one object for all steps unless rigid bodies' inertia turns."""
        return self.factor.matrix()

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
        kept: dict[str, Any] | None = {} if self.keep else None
        while moment.number < self.steps:
            step = self.step(moment, kept, anchor)
            if step.number > after.number:
                yield step
            moment = step.moment
            if self.keep and moment.number % self.keep == 0:
                kept, anchor = {}, moment

    def step(self, after: Moment, kept: dict[str, Any] | None = None, anchor: Moment | None = None) -> Step:
        """Compute the step after a moment; raises NotConverged when the whole solver chain fails. `kept`: see `LocalProblem`."""
        number, state, memory = after.number + 1, after.state, after.memory
        model, scheme = self.model, self.scheme
        clock = _Clock()
        configuration = scheme.detection_configuration(model, state)
        contacts = scheme.select(self.detector(model.positions(configuration)))
        H = model.contact_matrix(contact_matrix(contacts, model.n_nodes), configuration)
        clock.lap("detection")
        load = scheme.right_hand_side(model, state)
        rigid_mass = scheme.rigid_mass(model, state, load)
        factor = self.factor.with_rigid_mass(rigid_mass)
        problem = self._problem(state, contacts, H, load, factor)
        reduction = Reduction(problem, factor, kept)
        if len(contacts):
            _ = reduction.local
        clock.lap("assembly")
        start = warm_start(reduction.local, contacts, memory) if len(contacts) else np.empty(0)
        result, attempts = self._solve(number, reduction, start)
        clock.lap("solve")
        v = np.empty(model.n_dofs)
        v[model.free_dofs] = result.v if model.driven == "eliminated" else result.v[model.free_dofs]  # type: ignore[index]
        v[model.driven_dofs] = scheme.driven(model, state)
        support = factor.apply(v) - load - H @ result.r
        end = scheme.advance(model, state, v, rigid_mass)
        clock.lap("assembly")
        return Step(
            number=number,
            previous=state,
            state=end,
            contacts=contacts,
            H=H,
            problem=problem,
            result=result,
            reduction=reduction,
            start=start,
            earlier=tuple(memory[: MEMORY - 1]),
            anchor=anchor or after,
            support_impulse=support,
            force_per_reaction=scheme.force_per_reaction,
            attempts=attempts,
            seconds=clock.seconds,
        )

    def _problem(self, state: State, contacts: Contacts, H: Any, load: FloatArray, factor: SystemFactor) -> GlobalProblem:
        """The step's problem on the model's unknowns; what driven dofs do enters f and w."""
        model = self.model
        driven = self.scheme.driven(model, state)
        w = self.scheme.contact_velocity(state, contacts, H)
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
        return GlobalProblem(factor.matrix(), free_H, f, w, contacts.mu, dimension=model.dimension)

    def _solve(self, number: int, reduction: Reduction, warm: FloatArray) -> tuple[Result, tuple[Attempt, ...]]:
        settings = self.solver
        chain: list[tuple[str, str, Mapping[str, Any]]] = [(settings.name, "previous steps", settings.options)]
        if np.any(warm):
            chain.append((settings.name, "zero", settings.options))
        chain += [(name, "zero", {}) for name in settings.fallback if name != settings.name]
        # Bodies that only contact holds move freely by f / (eta M / h^2) in q, which may be kilometres: an error relative to that would
        # take metres of penetration for converged, so that free motion counts up to the size of the model only.
        free = float(np.linalg.norm(reduction.q))
        longest = self._extent * self.scheme.force_per_reaction * float(np.sqrt(reduction.problem.nc))
        tol = settings.tol * min(1.0, longest / free) if free else settings.tol
        attempts: list[Attempt] = []
        for name, start, options in chain:
            r = warm if start == "previous steps" else None
            result = solve(reduction, name, r, tol=tol, floor=settings.floor, **options)
            attempts.append(Attempt(name, start, result.status.value, result.error, result.iterations))
            if result.solved:
                return result, tuple(attempts)
        tried = "; ".join(f"{a.solver} from {a.start}: {a.status}, error {a.error:.2e}" for a in attempts)
        hint = "" if tol == settings.tol else "; bodies fly farther than the model is large in one step: choose a larger eta or a smaller h"
        raise NotConverged(f"step {number} did not converge to {tol:.3g} ({tried}){hint}")


class _Clock:
    """Seconds by phase."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, phase: str) -> None:
        now = time.perf_counter()
        self.seconds[phase] = self.seconds.get(phase, 0.0) + now - self._last
        self._last = now
