"""Contacts whose gaps nothing but supports and links changes: no unknown moves them, so they are no part of a step's problem.

Where both sides of a contact are held or driven along its normal, its row of H^T is zero on the unknowns, or a sum of the links' rows G^T,
and u_N is known beforehand. With u_N >= 0 the law 0 <= u_N ⊥ r_N >= 0 has the answer r = 0, also where u_N = 0 leaves r_N open: what such
parts press on each other goes from one support or link into the other, and no equation of the model has it. With u_N < 0 it has none. As a
row of the problem such a contact makes W singular, and where round-off makes its u_N negative there is no answer to it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.contact_detection.contacts import CABLES, Contacts
from fcsim.contact_law.law import Terms
from fcsim.contact_law.proportions import Proportions
from fcsim.errors import InputError
from fcsim.linear.sparse.by_ranks import normals_by_ranks
from fcsim.linkage import Linkage

FREE = 1e-6
"""Of a contact's row along its normal: less of it on free unknowns is none."""

TOUCHES = 1e-6
"""Of the smaller body's size: what ends a step nearer may press."""

MOST = 1e5
"""Entries of the rows of two bodies' links up to which what they hold is asked: wide surfaces that are tied have more."""

PRESSED = 1e-3
"""Of the smaller body's size: supports that drive parts deeper into each other contradict the contact. It is wider than round-off, since
driven facets stand for curved surfaces."""


class Driven(NamedTuple):
    """contacts, with their gaps for increments from the step's beginning; normals (n_dofs, nc): H along their normals; size (nc,) [m] of
    the smaller body; linked (nc,): which of them take links to hold them."""

    contacts: Contacts
    normals: sp.csc_array
    size: FloatArray
    linked: BoolArray

    @property
    def by(self) -> str:
        """What holds or drives them, in words."""
        return "supports or links" if self.linked.any() else "supports"

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


def held_by_links(model: Model, linkage: Linkage, x: FloatArray, H: sp.sparray, contacts: Contacts, proportions: Proportions) -> BoolArray:
    """Which contacts (nc,) of H (n_dofs, m) in the configuration x (n_dofs,) the links of their own two bodies hold along their normals, by
    each other, by the ground, or by what supports hold: those whose normals' rows are sums of the links'; levers count as above.

    Of contacts that are open those alone that links drive: others have u_N = 0 there, which may bear nothing in a problem, but once bodies
    have turned no longer, as an eccentric disc on a pin at its dead point, whose contact is to stop it."""
    held, pairs = np.zeros(len(contacts), dtype=bool), np.sort(contacts.bodies, axis=1)
    kept = np.flatnonzero(np.isinf(linkage.stiffness))
    touch = contacts.gap <= TOUCHES * proportions.size_at(contacts)
    if not len(kept) or not (touch.any() or linkage.driven[kept].any()):
        return held
    weight = np.ones(model.n_dofs)
    size = proportions.size[len(model.deformable) :, None]
    model.rigid_part(weight)[:, model.dimension :] /= np.where(size > 0, size, 1.0)
    G = linkage.matrix(linkage.rows(x), x, balanced=False)[:, kept]
    normals = sp.csc_array(H)[:, :: contacts.dimension]
    if model.axes_matrix is not None:
        G, normals = model.axes_matrix @ G, model.axes_matrix @ normals
    free = np.zeros(model.n_dofs)
    free[model.free_dofs] = weight[model.free_dofs]
    G, normals = sp.csc_array(sp.diags_array(free) @ G), sp.csc_array(sp.diags_array(free) @ normals)
    first, last = _ends(G, np.searchsorted(model.dof_offset, np.arange(model.n_dofs), side="right") - 1)
    count = len(model.bodies)
    of_row = np.where(first >= 0, first * count + last, -1)
    own = pairs[:, [0, 1, 0]] * count + pairs[:, [0, 1, 1]]  # of rows of one of both bodies beside what does not move, or of both
    may = touch | np.isin(own, of_row[linkage.driven[kept]]).any(axis=1)
    linked = may & np.isin(own, of_row).any(axis=1) & (contacts.identity < CABLES)
    for numbers in np.unique(own[linked], axis=0):
        between = np.flatnonzero(linked & (own == numbers).all(axis=1))
        rows = np.flatnonzero(np.isin(of_row, numbers))
        held[between] = _sums_of(sp.csc_array(G[:, rows]), sp.csc_array(normals[:, between]))
    return held


def _ends(G: sp.csc_array, bodies: IntArray) -> tuple[IntArray, IntArray]:
    """The first and the last body (p,) that columns of G (n_dofs, p) touch, -1 = none; bodies (n_dofs,)."""
    G.eliminate_zeros()
    first, last = np.full((2, G.shape[1]), -1)
    some = np.flatnonzero(np.diff(G.indptr))
    if len(some):
        touched = bodies[G.indices]
        first[some] = np.minimum.reduceat(touched, G.indptr[some])
        last[some] = np.maximum.reduceat(touched, G.indptr[some])
    return first, last


def _sums_of(G: sp.csc_array, normals: sp.csc_array) -> BoolArray:
    """Which columns (k,) of normals (n, k) are sums of the columns of G (n, p), to `FREE`; not those that are zero."""
    dofs = np.unique(G.indices)
    if len(dofs) * G.shape[1] > MOST:
        return np.zeros(normals.shape[1], dtype=bool)
    inside = normals[dofs].toarray()
    whole = np.asarray(normals.multiply(normals).sum(axis=0)).ravel()
    basis, sizes, _ = np.linalg.svd(G[dofs].toarray(), full_matrices=False)
    basis = basis[:, sizes > FREE * sizes.max(initial=0.0)]
    left = whole - (inside**2).sum(axis=0) + ((inside - basis @ (basis.T @ inside)) ** 2).sum(axis=0)
    return (whole > 0) & (left <= FREE**2 * whole)


def without_force(terms: Terms) -> bool:
    """Whether a law gives its contacts no force of their own: neither adhesion nor a compliance, which make r known where u is. Of a law
    that does, contacts stay that have lost theirs: it remembers them."""
    return terms.adhesion is None and terms.compliance is None


def refuse_driven(driven: Driven, model: Model, dx: FloatArray, when: str, found: Callable[[], Contacts]) -> None:
    """InputError where supports or links drive parts into each other by the step's motion dx (n_dofs,); what lay in each other may stay.
    found: the contacts after it, whose gaps count for what links hold, which may turn far."""
    gaps = driven.gaps(dx)
    bad = _pressed(driven, gaps)
    if driven.linked[bad].any():
        after = found()
        own, there = np.intersect1d(driven.contacts.identity, after.identity, return_indices=True)[1:]
        gaps[own] = np.where(driven.linked[own], after.gap[there], gaps[own])
        bad = _pressed(driven, gaps)
    if not len(bad):
        return
    worst = bad[int(np.argmin(gaps[bad]))]
    contacts = driven.contacts
    one, other = (model.bodies[int(k)].name for k in contacts.bodies[worst])
    raise InputError(
        f"{when}: {driven.by} drive {one!r} and {other!r} {-gaps[worst]:.3g} m into each other at "
        f"({', '.join(f'{x:.4g}' for x in contacts.point[worst])}), where both are held or driven along the contact's normal, so that "
        f"nothing can give way: expected {driven.by} that leave one of them free there, or a gap"
    )


def _pressed(driven: Driven, gaps: FloatArray) -> IntArray:
    """The contacts (k,) that gaps (nc,) [m] after a step show to be driven together."""
    closes = gaps < driven.contacts.gap - TOUCHES * driven.size
    return np.flatnonzero(closes & (gaps < -PRESSED * driven.size))
