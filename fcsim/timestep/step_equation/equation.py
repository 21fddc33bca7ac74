"""The equation of one step or part of a step, M v = H r + f with the laws of contact, and its answer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, Matrix
from fcsim.assembly.compliance import SystemFactor
from fcsim.assembly.model import Model
from fcsim.contact_detection.contacts import Contacts
from fcsim.linear.sparse.by_ranks import RowsKept
from fcsim.linear.sparse.columns import transposed_times
from fcsim.problem import GlobalProblem
from fcsim.problem.reduction import Reduction
from fcsim.problem.rolling import GlobalRollingProblem
from fcsim.ranks import elementwise
from fcsim.solvers import Memory, Result
from fcsim.timestep.chain import Attempt, Chain, Clock, Lead, SolverSettings
from fcsim.timestep.encounter import Encounter
from fcsim.timestep.links.linked import Linked
from fcsim.timestep.reactions.reactions import Reactions
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State
from fcsim.timestep.step import Linearised
from fcsim.timestep.step_equation.compliance import StepCompliance
from fcsim.timestep.step_equation.contact_tangent.leaning import Leaning, leaning
from fcsim.timestep.step_equation.linearisation import Linearisation
from fcsim.timestep.step_equation.linked_compliance import LinkedCompliance

_kept: WeakKeyDictionary[Model, RowsKept] = WeakKeyDictionary()
"""H's rows on the problems' unknowns."""


@dataclass(frozen=True, eq=False)
class Equation:
    """What a step's problems share: all but the elastic term of the right side.

    met: its contacts; factor: of the step's M; rest (n_dofs,): right side without the elastic term; driven: values of the driven
    unknowns; share: of the whole step that it is; linked: the rows of its links; bent (n_dofs, n_dofs): geometric stiffness of contact that
    is part of M, None = none; slanted (n_dofs, m): E of `leaning`, with the iterate v_i (n_dofs,) that it is of, None = none;
    summed: W where it is known, see `StepCompliance`; borne [m/s]: the residual that a contact may have where the step is to be solved
    again, 0 = none but that of the settings, see `look_ahead.ahead.borne_at_first`
    """

    scheme: Scheme
    model: Model
    state: State
    met: Encounter
    factor: SystemFactor
    rest: FloatArray
    driven: FloatArray
    elastic: Linearisation
    share: float
    linked: Linked | None = None
    bent: sp.csr_array | None = None
    slanted: tuple[sp.csr_array, FloatArray] | None = None
    summed: Matrix | None = None
    borne: float = 0.0

    @cached_property
    def _moved(self) -> FloatArray | None:
        """Velocities (n_dofs,) of the driven dofs alone, in world axes; None where all are zero."""
        return self.model.of_driven(self.driven) if np.any(self.driven) else None

    @cached_property
    def compliance(self) -> StepCompliance | LinkedCompliance:
        bent = None if self._all_bent is None else self._on_unknowns(self._on_unknowns(self._all_bent).T).T
        bent = bent if bent is None or not bent.nnz else sp.csr_array(bent)
        own = StepCompliance(self.factor, self.met.compliance, self.summed, bent, self.leaning)
        if self.linked is None:
            return own
        whole = self.linked.bending is not None and self.linked.bending.whole
        H = own.with_joints(self._on_unknowns(self.met.scaled_H)) if len(self.met.contacts) else None
        return LinkedCompliance(own, self._on_unknowns(self.linked.G), self.linked.compliance, self.summed, whole, H)

    @cached_property
    def _all_bent(self) -> sp.csr_array | None:
        """The geometric stiffness (n_dofs, n_dofs) of contact and links."""
        if self.linked is None or self.linked.bending is None:
            return self.bent
        return self.linked.bending.B if self.bent is None else sp.csr_array(self.bent + self.linked.bending.B)

    @property
    def of_bodies(self) -> StepCompliance:
        """The compliance without links."""
        return self.compliance if isinstance(self.compliance, StepCompliance) else self.compliance.base

    @cached_property
    def leaning(self) -> Leaning | None:
        """How gaps lean from their normals; None where they do not, and beside links."""
        if self.slanted is None or self.linked is not None:
            return None
        return leaning(self._on_unknowns(self.met.scaled_H), self._on_unknowns(self.slanted[0]))

    def _unknown(self, v: FloatArray) -> FloatArray:
        """The bodies' unknowns of v (n_dofs,)."""
        v = self.model.along(v)
        return v[self.model.free_dofs] if self.model.driven == "eliminated" else v

    def _on_unknowns(self, H: sp.sparray) -> sp.csr_array | sp.csc_array:
        """The rows of H (n_dofs, m) of the bodies' unknowns in the problem, driven ones zero or left out; by columns where H is."""
        model = self.model
        if model.axes_matrix is None and isinstance(H, sp.csc_array):
            if model not in _kept:
                _kept[model] = RowsKept(*model.place_of_unknowns)
            return _kept[model](H)
        if model.axes_matrix is not None:
            H = sp.csr_array(model.axes_matrix @ H)
        if model.driven == "eliminated":
            return sp.csr_array(H[model.free_dofs])
        H = sp.csr_array(H)
        free = np.zeros(model.n_dofs, dtype=bool)
        free[model.free_dofs] = True
        entries = np.repeat(free, counts := np.diff(H.indptr))
        indptr = np.concatenate([[0], np.cumsum(np.where(free, counts, 0), dtype=H.indptr.dtype)]).astype(H.indptr.dtype)
        return sp.csr_array((H.data[entries], H.indices[entries], indptr), shape=H.shape)

    @cached_property
    def H(self) -> sp.sparray:
        """H on the problems' unknowns."""
        return self.compliance.with_joints(self._on_unknowns(self.met.scaled_H))

    @cached_property
    def _w(self) -> FloatArray:
        w = self.met.w if self._moved is None else self.met.w + transposed_times(self.met.scaled_H, self._moved)
        if self.leaning is None or self.slanted is None:
            return w
        E, v = self.slanted
        arrived = self.model.of_driven(self.driven) - self.model.driven_share(v)  # what an iterate on the way has still to go
        return w + E.T @ arrived

    @cached_property
    def _given(self) -> FloatArray | float:
        """What adhesion and driven dofs take from the load (n_dofs,); 0 where there is neither."""
        adhesive = self.met.adhesive_impulse
        given = 0.0 if adhesive is None else adhesive
        if self._moved is None:
            return given
        return given + self.factor.apply(self._moved) + (0.0 if self._all_bent is None else self._all_bent @ self._moved)

    def right_side(self, load: FloatArray) -> FloatArray:
        """f (n,) of the problem for the right side load (n_dofs,); what driven dofs and adhesion do enters it."""
        bending = None if self.linked is None else self.linked.bending
        load = load if bending is None else load + bending.B @ bending.v
        model, f = self.model, self.model.along(load - self._given)
        if model.driven == "eliminated":
            f = f[model.free_dofs]
        else:
            f[model.driven_dofs] = self.driven
        if self.leaning is not None and self.slanted is not None:
            v = self._unknown(self.slanted[1])
            straight = replace(self.compliance, leaning=None).matrix()  # type: ignore[arg-type] # of one class where `slanted` is set
            f = f + straight @ (self.leaning.straight(v) - v)
        return self.compliance.load(f)

    def problem(self, load: FloatArray) -> GlobalProblem | GlobalRollingProblem:
        """The problem on the model's unknowns for the right side load (n_dofs,); what driven dofs and adhesion do enters f and w too."""
        model, f = self.model, self.right_side(load)
        mu, compliance = self.met.contacts.mu, self.compliance
        matrix = compliance.problem_matrix() if isinstance(compliance, StepCompliance) else compliance.matrix()
        G = b = None
        if self.linked is not None and isinstance(compliance, LinkedCompliance):
            G, b = compliance.matrix_of_links, self.linked.b
            b = b if self._moved is None else b + self.linked.G.T @ self._moved
        terms = self.met.terms
        if self.met.moments is not None:
            rolling = np.zeros_like(mu) if terms.rolling is None else terms.rolling
            return GlobalRollingProblem(matrix, self.H, f, self._w, mu, rolling, G, b, mu_s=terms.spinning)
        return GlobalProblem(matrix, self.H, f, self._w, mu, G, b, dimension=model.dimension)

    def velocity(self, of_problem: FloatArray) -> FloatArray:
        """The unknowns v (n_dofs,) of all dofs, in world axes, from the problem's."""
        model = self.model
        of_problem = self.compliance.bodies(of_problem)
        if self.leaning is not None and self.slanted is not None:
            begin = self._unknown(self.slanted[1])
            of_problem = begin + self.leaning.straight(of_problem - begin)
        if model.driven == "eliminated":
            v = np.empty(model.n_dofs)
            v[model.free_dofs] = of_problem
        else:
            v = elementwise("velocities", len(of_problem), lambda some: of_problem[some].copy())
        v[model.driven_dofs] = self.driven
        return model.world(v)


@dataclass(frozen=True, eq=False)
class Answer:
    """The last problem of a step, its result, v (n_dofs,), its right side load (n_dofs,), where a solve began, start (m,), the factor of
    its matrix and its contacts; linearised: all problems of a step with nonlinear bodies."""

    problem: GlobalProblem | GlobalRollingProblem
    reduction: Reduction
    result: Result
    v: FloatArray
    load: FloatArray
    start: FloatArray
    factor: SystemFactor
    met: Encounter
    linearised: tuple[Linearised, ...] = ()


@dataclass(frozen=True, eq=False)
class Past:
    """What the steps before leave for a step: their reactions, newest first, who leads the chain, and what serves the solver."""

    reactions: Sequence[Reactions]
    lead: Lead
    serving: Memory | None

    def of_the_same_step(self, met: Contacts, ahead: Contacts, r: FloatArray) -> Past:
        """The past of the step's next solve with other contacts `ahead`, after r (m,) was found with the contacts `met`."""
        last = Reactions(met.identity, met.frame, r.reshape(len(met), -1 if len(met) else met.dimension))
        return replace(self, reactions=(last,), serving=None if self.serving is None else self.serving.follow(ahead.identity))


@dataclass(frozen=True, eq=False)
class StepSolver:
    """How the problems of a step or part of one are solved, and where it is written down; the same for all of them.

    settings: of the friction problems; extent [m]: size of the model, see `longest_flight`. Those who solve add what they tried to attempts
    and the seconds of each phase to clock.
    """

    settings: SolverSettings
    extent: float
    attempts: list[Attempt]
    clock: Clock

    def chain(self, equation: Equation) -> Chain:
        """What solves the equation's problems."""
        return Chain(self.settings, equation.share, self.attempts, serves=equation.model.n_elastic > 0)
