"""Contacts whose gaps nothing but supports changes: no unknown moves them, so they are no part of a step's problem.

Where both sides of a contact are held or driven along its normal, its row of H^T is zero on the unknowns and u_N is known beforehand. With
u_N >= 0 the law 0 <= u_N ⊥ r_N >= 0 has the answer r = 0, also where u_N = 0 leaves r_N open: what such parts press on each other
goes from one support into the other, and no equation of the model has it. With u_N < 0 it has none. As a row of the problem such a
contact makes W singular, and where round-off makes its u_N negative there is no answer to it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray
from fcsim.assembly.model import Model
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_law.law import Terms
from fcsim.contact_law.proportions import Proportions
from fcsim.errors import InputError
from fcsim.linear.sparse.by_ranks import normals_by_ranks

FREE = 1e-6
"""Of a contact's row along its normal: less of it on free unknowns is none."""

TOUCHES = 1e-6
"""Of the smaller body's size: what ends a step nearer may press."""

PRESSED = 1e-3
"""Of the smaller body's size: supports that drive parts deeper into each other contradict the contact. It is wider than round-off, since
driven facets stand for curved surfaces."""


class Driven(NamedTuple):
    """contacts, with their gaps for increments from the step's beginning; normals (n_dofs, nc): H along their normals; size (nc,) [m] of
    the smaller body."""

    contacts: Contacts
    normals: sp.csc_array
    size: FloatArray

    def gaps(self, dx: FloatArray) -> FloatArray:
        """Gaps (nc,) [m] after the step's motion dx (n_dofs,) [m, rad]."""
        gaps: FloatArray = self.contacts.gap + self.normals.T @ dx
        return gaps

    def touching(self, dx: FloatArray) -> Contacts:
        """Those that may press after the step's motion: their forces are not determined."""
        return self.contacts.take(self.gaps(dx) <= TOUCHES * self.size)


def moved_by_supports(model: Model, H: sp.sparray, dimension: int, proportions: Proportions) -> BoolArray:
    """Which contacts (nc,) of H (n_dofs, m) no free degree of freedom moves along their normals; levers of rigid rotations count in sizes
    of their body."""
    none = np.zeros(H.shape[1] // dimension, dtype=bool)
    if not len(model.driven_dofs) or not len(none):
        return none
    rows = H if model.axes_matrix is None else model.axes_matrix @ H
    rows = rows if isinstance(rows, sp.csr_array | sp.csc_array) else sp.csr_array(rows)
    weight = np.ones(model.n_dofs)
    size = proportions.size[len(model.deformable) :, None]
    model.rigid_part(weight)[:, model.dimension :] /= np.where(size > 0, size, 1.0) ** 2
    driven = np.zeros(model.n_dofs, dtype=bool)
    driven[model.driven_dofs] = True
    whole, free, touched = normals_by_ranks(rows, weight, driven, dimension)
    return touched & np.asarray(free <= FREE**2 * whole)


def without_force(terms: Terms) -> bool:
    """Whether a law gives its contacts no force of their own: neither adhesion nor a compliance, which make r known where u is. Of a law
    that does, contacts stay that have lost theirs: it remembers them."""
    return terms.adhesion is None and terms.compliance is None


def refuse_driven(driven: Driven, model: Model, dx: FloatArray, when: str) -> None:
    """InputError where supports drive parts into each other by the step's motion dx (n_dofs,); what lay in each other may stay."""
    gaps = driven.gaps(dx)
    closes = gaps < driven.contacts.gap - TOUCHES * driven.size
    bad = np.flatnonzero(closes & (gaps < -PRESSED * driven.size))
    if not len(bad):
        return
    worst = bad[int(np.argmin(gaps[bad]))]
    contacts = driven.contacts
    one, other = (model.bodies[int(k)].name for k in contacts.bodies[worst])
    raise InputError(
        f"{when}: supports drive {one!r} and {other!r} {-gaps[worst]:.3g} m into each other at "
        f"({', '.join(f'{x:.4g}' for x in contacts.point[worst])}), where both are held or driven along the contact's normal, so that "
        "nothing can give way: expected supports that leave one of them free there, or a gap"
    )
