"""A finished step and the moment it leaves for the next."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.arrays import BoolArray, FloatArray, is_whole
from fcsim.assembly.functions.of_bodies import Field, body_function
from fcsim.assembly.model import Model
from fcsim.assembly.supports import Support
from fcsim.brief import brief, refused
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_law.law import NOTHING, UNSHOWN, Breaking, Variables
from fcsim.errors import InputError
from fcsim.linkage import Linkage
from fcsim.problem import GlobalProblem, contact_status
from fcsim.problem.reduction import Reduction
from fcsim.problem.rolling import GlobalRollingProblem
from fcsim.ranks import in_common
from fcsim.solvers import Result, Status
from fcsim.timestep.chain import NOBODY, ONE_LOOP, Attempt, Lead
from fcsim.timestep.encounter import Encounter
from fcsim.timestep.energy import UNWRITTEN, Acting, Energy, Ledger
from fcsim.timestep.links.linked import Linked
from fcsim.timestep.reactions.reactions import Reactions
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State
from fcsim.witness import Overlap

if TYPE_CHECKING:
    from dolfinx.fem import Function


@dataclass(frozen=True, eq=False)
class Linearised:
    """One friction problem of the sequence that a step with nonlinear bodies is, see `fcsim.timestep.step_equation.newton`.

    problem, result, start  the problem, its answer, where its solver began
    residual                of the nonlinear equation after it, largest of a body relative to the forces on it
    length                  how far towards the answer the iteration went, 1 = all the way
    factored                bodies whose tangent was factored anew
    stiffened               share of the first stiffness that a body which had lost its own was given, 0 = none
    """

    problem: GlobalProblem
    result: Result
    start: FloatArray
    residual: float
    length: float
    factored: int
    stiffened: float

    __repr__ = brief


AT_LIMIT = 1e-6
"""Share by which a moment that is at its limit may be below."""


@dataclass(frozen=True, eq=False)
class Moment:
    """The end of step `number`, all that the next steps depend on: its state, the last reactions (newest first), and how many times
    the next step is halved before it is tried; variables: what the contact law remembers, None = nothing has been met yet; ledger:
    what contact has created so far; lead: which solver begins the next chain; seen: length of the step [s] that ended here and detected
    contacts ahead of its end, 0 = none, see `beginning`."""

    number: int
    state: State
    memory: tuple[Reactions, ...] = ()
    cuts: int = 0
    variables: Variables | None = None
    ledger: Ledger = UNWRITTEN
    lead: Lead = NOBODY
    seen: float = 0.0

    __repr__ = brief


@dataclass(frozen=True, eq=False)
class Step:
    """One finished step: all that export and view need. Where a step was cut, it is its last sub-step, which ends when the step ends.

    scheme            the scheme whose step it is, of the sub-step's length where the step was cut
    previous, state   the states at its beginning and end
    H                 contact matrix (n_dofs, d nc) of the forces over all dofs, driven ones included, read-only; of rolling moments see
                      `Encounter`
    problem, result   the global problem and its answer; the result's r acts as `reaction`
    reduction         its local form, and v from r
    start, earlier    (m,) where the solver began, and the reactions of earlier steps, newest first, see `warm_start`
    anchor            where the factors began that served this step, see `Simulation`
    support_impulse   (n_dofs,) from A v - f - H r: at driven dofs the reaction of the supports [N s; quasi-statics: N], zero elsewhere
    attempts          what the solver chain tried, the last one converged; of all sub-steps
    seconds           by phase: detection, assembly, solve; of all sub-steps
    substeps          into how many parts the step was cut; 1 where it was not
    before, last      balance of energy of the earlier sub-steps, None where there are none, and of the last; None: not made yet
    struck            balance of energy of an impact at the beginning, None where there was none, see `beginning.impact`
    whole_per_part    reactions of the whole step per reaction of the sub-step: the ratio of their lengths for impulses, 1 for forces
    cuts              see `Moment`
    encounter         the contacts under their law: what it was told and what it gave
    variables         what the law remembers at the end of the step
    ledger, lead      see `Moment`
    linked, linkage   the rows of its links, None where there are none; all links of the simulation, cables too
    linearised        with nonlinear bodies: the problems that led to the last one, see `Linearised`; of the last sub-step
    remarks           what is to be known of the run from this step on, see `Limits`
    penetration       deepest [m] at the end of the step, as detection sees it, at least 0; see `AtEnd`
    overlap           of the bodies at the end of the step, see `fcsim.witness`; None where it was not measured
    """

    number: int
    model: Model
    scheme: Scheme
    previous: State
    state: State
    contacts: Contacts
    H: sp.csc_array
    problem: GlobalProblem | GlobalRollingProblem
    result: Result
    reduction: Reduction
    start: FloatArray
    earlier: tuple[Reactions, ...]
    anchor: Moment
    support_impulse: FloatArray
    attempts: tuple[Attempt, ...]
    seconds: Mapping[str, float]
    encounter: Encounter
    substeps: int = 1
    before: Energy | None = None
    last: Energy | None = None
    whole_per_part: float = 1.0
    cuts: int = 0
    variables: Variables | None = None
    ledger: Ledger = UNWRITTEN
    lead: Lead = NOBODY
    overlap: Overlap | None = None
    remarks: tuple[str, ...] = ()
    linearised: tuple[Linearised, ...] = ()
    linked: Linked | None = None
    linkage: Linkage | None = None
    penetration: float = 0.0
    struck: Energy | None = None

    __repr__, __reduce__ = brief, refused("state", "contacts", "result")

    def handed_out(self, remarks: tuple[str, ...]) -> Step:
        """The step with what there is to remark, and a state of its own: a script that writes into it (`x *= 1e3`, for millimetres) does
        not change the steps to come, nor what other ranks see."""
        previous = self.previous.copied() if in_common(self.previous.x) else self.previous
        return replace(self, previous=previous, state=self.state.copied(), remarks=remarks)

    @property
    def memory(self) -> tuple[Reactions, ...]:
        """The last reactions, newest first."""
        return (self.reactions, *self.earlier)

    @property
    def moment(self) -> Moment:
        return Moment(self.number, self.state, self.memory, self.cuts, self.variables, self.ledger, self.lead, self.scheme.h)

    @property
    def reactions(self) -> Reactions:
        r = self.result.r.reshape(len(self.contacts), self.encounter.rows)
        return Reactions(self.contacts.identity, self.contacts.frame, self.whole_per_part * r)

    @property
    def force_per_reaction(self) -> float:
        """Force [N] of a unit reaction: 1/h for impulses, 1 for forces."""
        return self.scheme.force_per_reaction

    @property
    def fell_back(self) -> bool:
        """Whether some link of the solver chain failed; one loop that the settings left open is a way to try first, not a link."""
        return any(a.status != Status.SOLVED.value and a.start != ONE_LOOP for a in self.attempts)

    @property
    def iterations(self) -> int:
        """Iterations of the solves that were taken: of one, or where the step was cut of one a sub-step."""
        return sum(a.iterations for a in self.attempts if a.status == Status.SOLVED.value)

    @cached_property
    def guess(self) -> tuple[FloatArray, FloatArray | None]:
        """v (n,) and the multiplier of the reactions `start` where the solver began."""
        return self.reduction.velocity(self.start)

    @cached_property
    def energy(self) -> Energy:
        """The balance of energy over the step."""
        last = self.last or self.last_energy()
        return last if self.before is None else self.before.then(last)

    def last_energy(self) -> Energy:
        """The balance of energy over the last sub-step."""
        met, result = self.encounter, self.result
        acting = Acting(met.acting_H, met.reaction(result.r), met.velocity(result.u), met.rows)
        own = self.scheme.energy(self.model, self.previous, self.state, acting, self.support_impulse)
        own = own if self.linked is None else self._with_links(own, self.linked)
        before, after = self.encounter.meeting.variables or NOTHING, self.variables or NOTHING
        own = own.with_joints(before.stored, after.stored, after.breaking or Breaking())
        return own if self.struck is None else self.struck.then(own)

    def _with_links(self, own: Energy, linked: Linked) -> Energy:
        """The balance with the work of the links: the same scheme's with their rows as columns of H too."""
        met, l = self.encounter, self._multiplier
        more = -len(l) % met.rows
        H = sp.hstack([met.acting_H, linked.G, sp.csr_array((self.H.shape[0], more))], format="csr")
        r = np.concatenate([met.reaction(self.result.r), l, np.zeros(more)])
        u = np.concatenate([met.velocity(self.result.u), linked.G.T @ self.state.v, np.zeros(more)])
        both = self.scheme.energy(self.model, self.previous, self.state, Acting(H, r, u, met.rows), self.support_impulse)
        gain = both.normal_dissipation + both.tangential_dissipation - own.normal_dissipation - own.tangential_dissipation
        return replace(own, link_work=-gain, links=linked.stored(self.state.x), residual=both.residual)

    @property
    def _multiplier(self) -> FloatArray:
        return np.zeros(0) if self.result.multiplier is None else self.result.multiplier

    def link_force(self, name: str) -> FloatArray:
        """Resultant (d,) [N] of the forces of a link on the first body that it names, in world axes."""
        if self.linkage is None:
            raise InputError(f"link {name!r}: expected a simulation with a linkage, got one without")
        cable = self.linkage.cable_identity(name)
        if cable is not None:  # a contact, none where it is slack
            pull: FloatArray = self.force_in_space[self.contacts.identity == cable].sum(axis=0)
            return pull
        assert self.linked is not None  # what is no cable has rows
        forces = self.force_per_reaction * self._multiplier
        return self.linked.linkage.force(name, self.linked.rows, forces)

    @cached_property
    def reaction(self) -> FloatArray:
        """(d nc,) [N s; quasi-statics: N] the forces on the slave bodies in the contacts' frames: the problem's r, less adhesion."""
        return self.encounter.forces(self.encounter.reaction(self.result.r)).ravel()

    @cached_property
    def rolling_moment(self) -> FloatArray | None:
        """Moments (nc, 2) [N m] about T1, T2 (2D: z, -) against the slave bodies' rolling; None without rolling resistance."""
        return None if self.encounter.terms.rolling is None else self._moments[:, :2]

    @cached_property
    def spinning_moment(self) -> FloatArray | None:
        """Moments (nc,) [N m] about the normals against the slave bodies' spinning; None without spinning resistance."""
        return None if self.encounter.terms.spinning is None else self._moments[:, 2]

    @property
    def _moments(self) -> FloatArray:
        """(nc, 2) or, with spinning resistance, (nc, 3) [N m]."""
        return self.force_per_reaction * self.result.r.reshape(len(self.contacts), self.encounter.rows)[:, 3:]

    @property
    def rolling(self) -> BoolArray:
        """(nc,) whether the rolling moment is as large as it can be: these contacts roll, or are about to."""
        moment = self.rolling_moment
        return self._at_limit(self.encounter.terms.rolling, None if moment is None else np.hypot(*moment.T))

    @property
    def spinning(self) -> BoolArray:
        """(nc,) whether the spinning moment is as large as it can be: these contacts spin, or are about to."""
        moment = self.spinning_moment
        return self._at_limit(self.encounter.terms.spinning, None if moment is None else np.abs(moment))

    def _at_limit(self, resistance: FloatArray | None, moment: FloatArray | None) -> BoolArray:
        if resistance is None or moment is None:
            return np.zeros(len(self.contacts), dtype=bool)
        limit = resistance * self.force_per_reaction * self.encounter.forces(self.result.r)[:, 0]
        return (limit > 0) & (moment >= (1 - AT_LIMIT) * limit)

    @property
    def law_variables(self) -> dict[str, FloatArray]:
        """What the contact law remembers of the step's contacts, by name: (nc,) or (nc, c)."""
        if self.variables is None:
            return {}
        values = {name: values for name, values in self.variables.values.items() if name not in UNSHOWN}
        nothing = {name: np.full((len(self.contacts), *known.shape[1:]), np.nan) for name, known in values.items()}
        return {name: self.variables.of(name, self.contacts.identity, fresh) for name, fresh in nothing.items()}

    def function(self, body: str, field: Field | str = "displacement") -> Function:
        """A field of a deformable body, or an internal variable by its name, at the end of the step as a dolfinx function, see
        `body_function`."""
        return body_function(self.model, body, self.state.x, self.state.v, field, self.state.internal, self.state.t)

    @cached_property
    def contact_force(self) -> FloatArray:
        """Forces (nc, d) [N] on the slave bodies in the contacts' frames (N, T1[, T2])."""
        return self.force_per_reaction * self.reaction.reshape(-1, self.contacts.dimension)

    @cached_property
    def contact_status(self) -> NDArray[np.int8]:
        """0 open, 1 stick, 2 slip (nc,)."""
        return contact_status(self.encounter.forces(self.result.r).ravel(), self.contacts.mu, self.contacts.dimension)

    @cached_property
    def force_in_space(self) -> FloatArray:
        """Forces (nc, d) [N] on the slave bodies in the world axes."""
        return np.einsum("aij,ai->aj", self.contacts.frame, self.contact_force)

    def contact_force_on(self, body: int | str) -> FloatArray:
        """Resultant (d,) [N] of the contact forces on a body, by its name or its number; InputError where there is none such."""
        if isinstance(body, str) or not (is_whole(body, 0) and body < len(self.model.bodies)):
            body = self.model.body_number(body)  # type: ignore[arg-type] # which refuses what is no name
        slave, master = self.contacts.bodies.T
        return self.force_in_space[slave == body].sum(axis=0) - self.force_in_space[master == body].sum(axis=0)

    def support_force(self, support: Support) -> FloatArray:
        """Resultant (d,) [N] of the supports' forces, in world axes, on the nodes (or the rigid body) that a support of the model names,
        those of other supports at the same nodes included."""
        layout, d = self.model, self.model.dimension
        first = int(layout.dof_offset[layout.body_number(support.body)])
        rigid = support.selection.whole and first >= layout.n_elastic
        nodes = np.zeros(1, dtype=np.int64) if rigid else support.selection.of(layout, support.body, f"support of body {support.body!r}")
        dofs = first + d * nodes[:, None] + np.arange(d)
        return self.force_per_reaction * self.support_impulse[dofs].sum(axis=0)

    @property
    def friction_dissipation(self) -> float:
        """-sum r_T . u_T [J; quasi-statics: J], never negative."""
        return self.energy.friction_dissipation
