"""Limit problems as numbers that neither units, pose nor numbering choose.

States of collapse under Coulomb's law are not unique, and the rounds that find one enlarge what differs: a bit of the input may decide
which. So the same structure is to be the same numbers, to the last bit, whatever its units, wherever it stands and in whatever order its
blocks come. Axes are those of its loads, up against the loads that stay and ahead along those that grow (what they leave open the contacts
decide); lengths are measured by arms of contacts, forces by the largest load upon a block; blocks and contacts are ordered by their
places; and all of it is rounded to nine digits, as many as turned coordinates of a structure keep.

What is as symmetric as its loads (no direction ahead, corners of a regular polygon) leaves the axes open: there round-off chooses them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray
from fcsim.masonry.limit_analysis.limit_problem import LimitProblem

DIGITS = 9
_OPEN = 1e-6
"""A vector below this share of the sizes that it sums says no direction."""


@dataclass(frozen=True, eq=False)
class Canonical:
    """Equilibrium H r + dead + lambda live = 0 in canonical axes, units and order.

    H (n, m), dead (n,), live (n,), mu (nc,)
    order (nc,)            which contact of the problem each of its contacts is
    rows (n, n_dofs)       velocities v of the problem are rows^T times its own
    columns (m, m)         forces r [N] of the problem are `force` [N] times columns times its own
    """

    H: sp.csc_array
    dead: FloatArray
    live: FloatArray
    mu: FloatArray
    order: IntArray
    rows: sp.csr_array
    columns: sp.csc_array
    force: float

    @property
    def dimension(self) -> int:
        return self.H.shape[1] // len(self.mu) if len(self.mu) else 2

    def own_forces(self, r: FloatArray) -> FloatArray:
        """Forces r (m,) [N] of the problem as its own."""
        return rounded(self.columns.T @ r / self.force)

    def forces(self, r: FloatArray) -> FloatArray:
        """Its forces as those of the problem (m,) [N]."""
        return np.asarray(self.columns @ r) * self.force

    def velocities(self, v: FloatArray) -> FloatArray:
        """Its velocities as those of the problem (n_dofs,)."""
        return np.asarray(self.rows.T @ v)


def rounded(x: FloatArray, digits: int = DIGITS) -> FloatArray:
    """To so many digits after the point; none is 0, not -0."""
    return np.round(x, digits) + 0.0


def canonical(problem: LimitProblem, dead: FloatArray, live: FloatArray, digits: int = DIGITS) -> Canonical:
    """The limit problem with loads dead, live (n_dofs,) [N, N m] in canonical form, H and loads rounded to so many digits."""
    contacts, model = problem.contacts, problem.model
    d, nc = model.dimension, len(contacts)
    dofs = model.rigid_part(np.arange(model.n_dofs))
    free = np.zeros(model.n_dofs, dtype=bool)
    free[problem.free] = True
    whole = free[dofs].all(axis=1)
    centres = np.array([body.centre for body in model.rigid])
    middle = contacts.point.mean(axis=0) if nc else centres.mean(axis=0)
    extent = float(np.sqrt(np.mean((contacts.point - middle) ** 2))) if nc else 1.0
    extent = extent if extent > 0 else 1.0
    forces = [np.where(whole[:, None], model.rigid_part(load)[:, :d], 0.0) for load in (dead, live)]
    axes = _axes((contacts.point - middle) / extent, (-forces[0], forces[1]))
    arms = _arms(problem, centres)

    rank = np.empty(len(centres), dtype=int)
    rank[_lexical(rounded((centres - middle) @ axes.T / extent))] = np.arange(len(centres))
    transform = _of_rows(dofs, whole, axes, arms)
    ordered = dofs[np.argsort(rank)].ravel()
    rows = sp.csr_array(transform[ordered[free[ordered]]])
    columns, order = _of_columns(problem, axes, rounded((contacts.point - middle) @ axes.T / extent), rank)
    H = sp.csc_array(rows[:, problem.free] @ problem.H @ columns)
    H.data = rounded(H.data, digits)
    H.eliminate_zeros()

    held = np.zeros(model.n_dofs)
    loads = []
    for load in (dead, live):
        held[:] = 0.0
        held[problem.free] = load[problem.free]
        loads.append(np.asarray(transform @ held))
    sizes = [np.linalg.norm(load[dofs], axis=1) for load in loads]
    force = float(sizes[0].max(initial=0.0)) or float(sizes[1].max(initial=0.0)) or 1.0
    of = ordered[free[ordered]]
    kept = [_by_block(load / force, dofs, size / force, digits)[of] for load, size in zip(loads, sizes, strict=True)]
    return Canonical(H, kept[0], kept[1], contacts.mu[order], order, rows, columns, force)


def _axes(points: FloatArray, loads: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Axes (d, d), one a row, of contacts at points (nc, d) and loads (n, d): against those that stay, along those that grow, then where
    most contacts lie."""
    d = points.shape[1]
    axes = np.empty((0, d))
    far = np.sum(points**2, axis=1, keepdims=True) * points
    for vectors in (*loads, far):
        total, size = vectors.sum(axis=0), float(np.linalg.norm(vectors, axis=1).sum())
        rest = total - axes.T @ (axes @ total)
        length = float(np.linalg.norm(rest))
        if len(axes) < d and length > _OPEN * size:
            axes = np.vstack([axes, rest / length])
    while len(axes) < d:
        left = np.eye(d) if not len(axes) else np.linalg.svd(axes)[2][len(axes) :]
        spread = left @ points.T @ points @ left.T
        along = left.T @ np.linalg.eigh(spread)[1][:, -1]
        axes = np.vstack([axes, _sided(along, points, axes)])
    return axes


def _sided(along: FloatArray, points: FloatArray, axes: FloatArray) -> FloatArray:
    """An axis or its opposite: towards the side that the first uneven moment of the points tells."""
    reach, others = points @ along, (points @ axes.T).T
    weights = [np.ones_like(reach), *others, *(a * b for k, a in enumerate(others) for b in others[k:])]
    weights += [reach**2 * weight for weight in weights]
    for weight in weights:
        moment = float(np.sum(reach * weight))
        if abs(moment) > _OPEN * float(np.abs(reach * weight).sum()):
            return along if moment > 0 else -along
    return along


def _arms(problem: LimitProblem, centres: FloatArray) -> FloatArray:
    """The largest distance (n,) [m] of a block's contacts from its centre: moments are measured by it."""
    contacts = problem.contacts
    arms = np.zeros(len(centres))
    for side in range(2):
        number = contacts.bodies[:, side]
        np.maximum.at(arms, number, np.linalg.norm(contacts.point - centres[number], axis=1))
    return np.where(arms > 0, arms, problem.problem.size)


def _of_rows(dofs: IntArray, whole: np.ndarray, axes: FloatArray, arms: FloatArray) -> sp.csr_array:
    """(n_dofs, n_dofs): forces and moments along the canonical axes, moments over their arms; of blocks that are not wholly free
    along their own."""
    d, size = len(axes), dofs.shape[1]
    handed = float(np.sign(np.linalg.det(axes)))
    turn = np.zeros((size, size))
    turn[:d, :d] = axes
    turn[d:, d:] = handed * axes if d == 3 else handed  # moments turn as axial vectors do
    blocks = np.where(whole[:, None, None], turn, np.eye(size))
    blocks[:, d:] /= arms[:, None, None]
    into, of = np.broadcast_to(dofs[:, :, None], blocks.shape), np.broadcast_to(dofs[:, None, :], blocks.shape)
    return sp.csr_array((blocks.ravel(), (into.ravel(), of.ravel())), shape=(dofs.max() + 1,) * 2)


def _of_columns(problem: LimitProblem, axes: FloatArray, points: FloatArray, rank: IntArray) -> tuple[sp.csc_array, IntArray]:
    """(m, m): forces along canonical frames in canonical order as forces of the problem, and that order (nc,)."""
    contacts = problem.contacts
    nc, d = points.shape
    slave, master = rank[contacts.bodies].T
    sign = np.where(slave > master, 1.0, -1.0)
    normal = rounded(sign[:, None] * (contacts.frame[:, 0] @ axes.T))
    if d == 2:
        tangents = np.stack([-normal[:, 1], normal[:, 0]], axis=1)[:, None]
    else:
        aside = np.eye(3)[np.abs(normal).argmin(axis=1)]
        first = aside - np.sum(aside * normal, axis=1, keepdims=True) * normal
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        tangents = np.stack([first, np.cross(normal, first)], axis=1)
    blocks = np.zeros((nc, d, d))
    blocks[:, 0, 0] = 1.0
    blocks[:, 1:, 1:] = sign[:, None, None] * np.einsum("aix,ajx->aij", contacts.frame[:, 1:] @ axes.T, tangents)
    keys = np.concatenate([np.stack([np.minimum(slave, master), np.maximum(slave, master)], axis=1), points, normal], axis=1)
    order = _lexical(keys)
    place = np.empty(nc, dtype=int)
    place[order] = np.arange(nc)
    into = np.broadcast_to((d * np.arange(nc)[:, None] + np.arange(d))[:, :, None], blocks.shape)
    of = np.broadcast_to((d * place[:, None] + np.arange(d))[:, None, :], blocks.shape)
    return sp.csc_array((blocks.ravel(), (into.ravel(), of.ravel())), shape=(d * nc, d * nc)), order


def _lexical(keys: FloatArray) -> IntArray:
    """The order (n,) of rows (n, k) by their first entry, then by the next ones."""
    return np.lexsort(keys.T[::-1])


def _by_block(load: FloatArray, dofs: IntArray, sizes: FloatArray, digits: int) -> FloatArray:
    """Loads (n_dofs,) rounded relative to each block's own, of size sizes (n,), in steps of powers of two: what is divided by them
    keeps its bits. A quarter keeps the largest load, whose size is 1, from a step's edge."""
    step = 2.0 ** np.floor(np.log2(np.where(sizes > 0, sizes, 1.0)) + 0.25)
    found = np.empty_like(load)
    found[dofs] = rounded(load[dofs] / step[:, None], digits) * step[:, None]
    return found
