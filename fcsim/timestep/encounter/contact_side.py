"""What the contacts of a step and their law give the problem: H, w and the scales of its unknowns, and what its answer means for them."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.brief import brief
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_law.coulomb import Gap
from fcsim.contact_law.driven import Driven, refuse_driven
from fcsim.contact_law.handed_on import places
from fcsim.contact_law.law import NOTHING, Implicit, Law, Meeting, Outcome, Terms, Variables
from fcsim.contact_law.rolling_rows import ROWS, SPINNING_ROWS, widened, with_moments
from fcsim.linear.sparse.by_ranks import times_by_ranks, transposed_times_by_ranks
from fcsim.linear.sparse.columns import times
from fcsim.linkage import Linkage
from fcsim.timestep.reactions.drift import Drift


@dataclass(frozen=True, eq=False)
class Encounter:
    """The contacts of a step under their law; see `fcsim.contact_law.law` for S, r_c and C.

    contacts  as the law takes them: its mu, and its frames where it turns them
    H         (n_dofs, d nc) contact matrix of the forces over all dofs, driven ones included
    meeting   what the law was told
    terms     what it gave
    left      the contacts that the law leaves out, None where it takes all
    driven    those that supports and links alone move along their normals, which are no part of the problem, see `Driven`; None where
              there are none
    moments   (n_dofs, 2 nc) contact matrix of rolling moments, (n_dofs, 3 nc) with spinning resistance; None without either, see
              `rolling_rows`
    passing   what the law leaves out and the bodies would go through within the step, see `detected.passing`; None where there is nothing
    ending    (n, 2) pairs of bodies that a load step of statics carries over each other, held where they end it, `look_ahead.load_steps`
    linkage   the links that it knows of, None where there are none
    released  (n, 2) pairs of bodies of which contacts of the beginning were taken out, since they bore what had gone apart
    turned    (n, 2) pairs of bodies that statics turn, which have the contacts of the end, `look_ahead.turned_meshes`
    drift     of what bore in the last step, None where it is not asked for
    arms      (n_dofs,) configuration in which rigid bodies have the lever arms of H; None: that of detection
    """

    contacts: Contacts
    H: sp.csc_array
    meeting: Meeting
    terms: Terms
    passing: Contacts | None = None
    moments: sp.csc_array | None = None
    left: Contacts | None = None
    driven: Driven | None = None
    linkage: Linkage | None = None
    ending: IntArray = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    released: IntArray = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    turned: IntArray = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    drift: Drift | None = None
    arms: FloatArray | None = None

    __repr__ = brief

    @property
    def rows(self) -> int:
        """Unknowns a contact: d, with rolling resistance 5, with spinning resistance 6."""
        if self.moments is None:
            return self.contacts.dimension
        return ROWS if self.terms.spinning is None else SPINNING_ROWS

    @property
    def handed_out(self) -> sp.csc_array:
        """H whose arrays cannot be written into: the next steps have its pattern, and the ranks of one machine its entries."""
        H = copy(self.H)
        for name in ("data", "indices", "indptr"):
            setattr(H, name, values := getattr(H, name).view())
            values.setflags(write=False)
        return H

    @cached_property
    def acting_H(self) -> sp.csc_array:
        """(n_dofs, m) of all unknowns, forces and moments."""
        return self.H if self.moments is None else with_moments(self.H, self.moments, self.contacts.dimension)

    def _of_rows(self, values: FloatArray, fill: float = 0.0) -> FloatArray:
        """(m,) from the forces' (nc, d)."""
        return (values if self.moments is None else widened(values, self.rows, fill)).ravel()

    @cached_property
    def scaled_H(self) -> sp.csc_array:
        """H S, the problem's."""
        scale = self.terms.scale
        if scale is None:
            return self.acting_H
        H = self.acting_H
        return sp.csc_array((H.data * np.repeat(self._of_rows(scale, 1.0), np.diff(H.indptr)), H.indices, H.indptr), shape=H.shape)

    @property
    def w(self) -> FloatArray:
        """w (m,) without what driven dofs add."""
        return self._of_rows(self.terms.w)

    @property
    def compliance(self) -> FloatArray | None:
        """The diagonal of C (m,), None where all is rigid."""
        return None if self.terms.compliance is None else self._of_rows(self.terms.compliance)

    @property
    def adhesive_impulse(self) -> FloatArray | None:
        """H r_c (n_dofs,), None without adhesion."""
        return None if self.terms.adhesion is None else times(self.H, self.terms.adhesion.ravel())

    def reaction(self, r: FloatArray) -> FloatArray:
        """S r - r_c (m,): what acts on the slave bodies for the problem's r."""
        if self.terms.scale is not None:
            r = self._of_rows(self.terms.scale, 1.0) * r
        return r if self.terms.adhesion is None else r - self._of_rows(self.terms.adhesion)

    def impulse(self, r: FloatArray) -> FloatArray:
        """(n_dofs,) on the bodies' dofs for the problem's r (m,)."""
        return times_by_ranks(self.acting_H, self.reaction(r))

    def forces(self, r: FloatArray) -> FloatArray:
        """The forces' components (nc, d) of a vector on the problem's rows (m,)."""
        return r.reshape(len(self.contacts), self.rows)[:, : self.contacts.dimension]

    def velocity(self, u: FloatArray) -> FloatArray:
        """The law's velocity (m,) in the contacts' frames for the problem's u = S ..."""
        return u if self.terms.scale is None else u / self._of_rows(self.terms.scale, 1.0)

    def outcome(self, u: FloatArray, r: FloatArray, v: FloatArray) -> Outcome:
        """What the law is told of the problem's u, r (m,) and the velocity v (n_dofs,)."""
        return Outcome(self.terms, self.forces(u), self.forces(r), self.relative(v).reshape(self.terms.w.shape))

    def relative(self, v: FloatArray) -> FloatArray:
        """H^T v (d nc,) of v (n_dofs,), read-only; of the same array once: where a step leads and what the law remembers ask for it."""
        last = self.__dict__.get("_relative")
        if last is None or last[0] is not v:
            found = transposed_times_by_ranks(self.H, v)
            found.setflags(write=False)
            last = self.__dict__["_relative"] = v, found
        return last[1]

    def tried(self, law: Law, trial: Variables) -> Encounter:
        """The same contacts under a law that is told `trial`, see `Implicit`."""
        meeting = replace(self.meeting, trial=trial)
        terms = law.terms(meeting)
        return replace(self, contacts=replace(self.contacts, mu=terms.mu), meeting=meeting, terms=terms)

    def eased(self, law: Law) -> Encounter | None:
        """The same contacts without taking penetrations back in this step; None where the law `Gap` takes none back.

        Coulomb's law need not have an answer where it is to push bodies out of each other: a wedge that friction locks is held by any
        force, and by none where its gaps are a hair below zero. With w_N >= 0 bodies that stay where they are are an answer (V. Acary,
        F. Cadoux, "Applications of an existence result for the Coulomb friction problem", Recent Advances in Contact Mechanics, 2013).
        """
        w = self.terms.w
        if not isinstance(law, Gap) or not self.meeting.timing.moving or not (w[:, 0] < 0).any():
            return None
        w = np.column_stack([np.maximum(w[:, 0], 0.0), w[:, 1:]])
        return replace(self, terms=replace(self.terms, w=w))

    def refuse_driven(self, model: Model, v: FloatArray, when: str, found: Callable[[], Contacts]) -> None:
        """InputError where supports or links drive parts into each other, by the step's answer v (n_dofs,); found: contacts after it."""
        if self.driven is not None:
            refuse_driven(self.driven, model, self.meeting.timing.length_per_u * v, when, found)

    def keeps_apart(self, law: Law) -> bool:
        """Whether the law keeps bodies apart by their gaps: no joints, which yield or hold, nor a law on velocities."""
        terms, meeting = self.terms, self.meeting
        if terms.adhesion is not None or terms.compliance is not None or isinstance(law, Implicit):
            return False
        farther = law.terms(replace(meeting, bend=meeting.size))
        return bool((farther.w[:, 0] > terms.w[:, 0]).any())

    def remember(self, law: Law, u: FloatArray, r: FloatArray, v: FloatArray) -> Variables | None:
        """The law's variables after the step with the problem's u, r (m,) and the velocity v (n_dofs,) at its end."""
        outcome = self.outcome(u, r, v)
        kept = law.remember(self.meeting, outcome)
        earlier = self.meeting.variables or NOTHING
        if not kept.values:
            return replace(earlier, stored=kept.stored, breaking=kept.breaking)
        values = {**kept.values, **places(self.meeting, outcome, kept)}
        return earlier.merged(self.contacts.identity, values, kept.stored, kept.breaking)
