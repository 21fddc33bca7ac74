"""What stands for M^-1 where links hold bodies: the saddle point [[M, -G], [-G^T, -C]] by its Schur complement.

With S = G^T M^-1 G + C, l = - S^-1 (G^T M^-1 f + b) and v = M^-1 (f + G l). For the contacts W becomes W - V S^-1 V^T, V = H^T M^-1 G. The
problem that solvers and files see has for each compliant row an unknown of its own, C l, with 1 / C on the diagonal of M and 1 in G.

Where S has lost too much to round-off, as of bodies that only links hold in statics, the saddle point is factored as a whole instead.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from fcsim.arrays import BoolArray, FloatArray, IntArray, Matrix
from fcsim.linear.factors import SingularMatrix
from fcsim.timestep.links.saddle_point import SaddlePoint
from fcsim.timestep.step_equation.compliance import StepCompliance

SPARSE_FROM, FILLED = 200, 0.1
"""Rows from which S is factored sparse, where at most this share of its entries are not zero: chains, trusses."""

PIVOT = 1e-10
"""Of a scaled row: what the rows before it must leave of it, else rows are redundant."""

REDUNDANT = 1e-11
"""Eigenvalues of the scaled S below this share of the largest are rows that others say already."""

TRUSTED = 1e-7
"""Of the largest eigenvalue of the scaled S: where smaller ones count, half of the digits of what they say are lost."""


HELD = 1e-6
"""What links leave of a free motion: where less, the rest is the difference of two large numbers. What they leave of the motion of contacts
decides for W and v alike: bodies that only contact holds besides fly so far freely that W r + q and H^T v + w, small differences, agree
only where both come from the same factors."""


_TOUCHED = 1e-12  # of a contact's motion: what links change less is not theirs

NOTHING = 1e-13
"""Of a contact's own entry of W: what links leave less of is round-off. With it, of either sign, solvers would look for the reaction that
moves what links hold (a wheel on a pin that is pressed on a wall); without, they see that there is none."""


class _Inverse:
    """S^-1 of a symmetric S >= 0, dense or sparse, on its range where rows are redundant.

    rank: of S; trusted: whether what is left of the digits suffices."""

    def __init__(self, S: Matrix) -> None:
        scale = np.sqrt(S.diagonal())
        self._scale = 1 / np.where(scale > 0, scale, 1.0)  # rows that nothing can move stay out
        self._factor: Callable[[FloatArray], FloatArray] | None = None
        self.rank, self.trusted = len(scale), True
        if not isinstance(S, np.ndarray):
            D = sp.diags_array(self._scale)
            self._factor = _sparse_factor(D @ S @ D)
            S = S if self._factor is not None else S.toarray()
        if self._factor is None:
            scaled = S * self._scale[:, None] * self._scale
            try:
                factor = sla.cho_factor(scaled)
                if (least := np.diag(factor[0]).min() ** 2) > PIVOT:
                    self._factor, self.trusted = partial(sla.cho_solve, factor), bool(least > TRUSTED)
            except np.linalg.LinAlgError:
                pass
        if self._factor is None:
            values, self._vectors = np.linalg.eigh(scaled)
            kept = values > REDUNDANT * max(values.max(initial=0.0), 1.0)
            self._values = np.where(kept, 1 / np.where(kept, values, 1.0), 0.0)
            self.rank = int(np.count_nonzero(kept))
            self.trusted = not np.any(kept & (values <= TRUSTED * values.max(initial=0.0)))

    def __call__(self, rhs: FloatArray) -> FloatArray:
        """S^-1 rhs for rhs (p,) or (p, k)."""
        scale = self._scale if rhs.ndim == 1 else self._scale[:, None]
        if self._factor is not None:
            solved: FloatArray = scale * self._factor(scale * rhs)
            return solved
        values = self._values if rhs.ndim == 1 else self._values[:, None]
        found: FloatArray = scale * (self._vectors @ (values * (self._vectors.T @ (scale * rhs))))
        return found


@dataclass(frozen=True, eq=False)
class LinkedCompliance:
    """The `MassFactor` of a step with links. base: without them; G (n, p) on the bodies' unknowns of its problem; compliance (p,) C;
    summed: W of this H and G where it is known already; whole: whether M is positive definite only where G leaves a motion, so that its
    inverse is not to be asked for; H (n, m): the contacts' on the base's unknowns, None = there are none."""

    base: StepCompliance
    G: sp.csr_array
    compliance: FloatArray
    summed: Matrix | None = None
    whole: bool = False
    H: sp.sparray | None = None

    @property
    def unknowns(self) -> int:
        """Number of the problem's unknowns."""
        return self.base.unknowns + len(self._soft)

    @cached_property
    def _soft(self) -> IntArray:
        return np.flatnonzero(self.compliance)

    @cached_property
    def _on_base(self) -> sp.csr_array:
        """G on the base's unknowns."""
        more = self.base.unknowns - self.G.shape[0]
        return sp.csr_array(sp.vstack([self.G, sp.csr_array((more, self.G.shape[1]))])) if more else self.G

    @cached_property
    def matrix_of_links(self) -> sp.csr_array:
        """The problem's G (n, p)."""
        k = len(self._soft)
        if not k:
            return self._on_base
        own = sp.csr_array((np.ones(k), (np.arange(k), self._soft)), shape=(k, self.G.shape[1]))
        return sp.csr_array(sp.vstack([self._on_base, own]))

    def matrix(self) -> sp.csr_array:
        """M of the problem."""
        M = self.base.matrix()
        return sp.csr_array(sp.block_diag([M, sp.diags_array(1 / self.compliance[self._soft])], format="csr")) if len(self._soft) else M

    def with_joints(self, H: sp.sparray) -> sp.sparray:
        """The problem's H (n, m) from that of the bodies' unknowns."""
        H = self.base.with_joints(H)
        return sp.csr_array(sp.vstack([H, sp.csr_array((len(self._soft), H.shape[1]))])) if len(self._soft) else H

    def load(self, f: FloatArray) -> FloatArray:
        """The problem's f (n,) from that of the bodies' unknowns."""
        return np.concatenate([self.base.load(f), np.zeros(len(self._soft))])

    def bodies(self, v: FloatArray) -> FloatArray:
        """The bodies' unknowns of the problem's v (n,)."""
        return self.base.bodies(v[: len(v) - len(self._soft)])

    @cached_property
    def _inverse(self) -> _Inverse:
        d, p = self.base.factor.model.dimension, self.G.shape[1]
        wide = sp.csc_array(sp.hstack([self.G, sp.csr_array((self.G.shape[0], -p % d))], format="csc"))
        S = replace(self.base, summed=None, joint=None).delassus(wide, d)
        if isinstance(S, np.ndarray) or p < SPARSE_FROM or S.nnz > FILLED * p**2:
            S = _dense(S)[:p, :p]
            S = 0.5 * (S + S.T)
            S[np.diag_indices_from(S)] += self.compliance
            return _Inverse(S)
        S = sp.csc_array(S)[:p, :p]
        return _Inverse(0.5 * (S + S.T) + sp.diags_array(self.compliance))

    @cached_property
    def _whole(self) -> SaddlePoint | None:
        """The saddle point; None where it is singular."""
        try:
            return SaddlePoint(self.base.matrix(), self._on_base, self.compliance)
        except SingularMatrix:
            return None

    @cached_property
    def _saddle(self) -> SaddlePoint | None:
        """The saddle point where S is not to be trusted, or has lost rows that G has; None else."""
        if self.whole and self._whole is not None:
            return self._whole
        inverse = self._inverse
        if (inverse.trusted and inverse.rank == self.compliance.size) or self._whole is None:
            return None
        return None if inverse.trusted and self._whole.rank == inverse.rank else self._whole

    @cached_property
    def _flies(self) -> bool:
        """Whether links leave contacts that they move more than HELD of a free motion, by that of a force on all of them."""
        if self.H is None or not self.H.shape[1]:
            return False
        free, found = (np.abs(motion) for motion in self._pushed(sp.csr_array(self.H)))
        linked = np.abs(free - found) > _TOUCHED * free
        return bool(np.any(found[linked] >= HELD * free[linked]))

    def _pushed(self, H: sp.csr_array) -> tuple[FloatArray, FloatArray]:
        """How contacts (m,) move under a force on each of them, of different sizes: without links, and with them by S."""
        free = self.base.solve(H @ (1.0 + np.arange(H.shape[1]) % 3))
        found = free - self.base.solve(self._on_base @ self._inverse(self._on_base.T @ free))
        return H.T @ free, H.T @ found

    def _with_contacts(self, H: sp.sparray, d: int) -> Matrix:
        """[H, G]^T M^-1 [H, G] of the base in blocks of d, G filled up to whole blocks."""
        n, p = self._on_base.shape
        wide = sp.csc_array(sp.hstack([H, self._on_base, sp.csr_array((n, -p % d))], format="csc"))
        base = replace(self.base, summed=None)
        if base.joint is not None:
            base = replace(base, joint=np.concatenate([base.joint, np.zeros(wide.shape[1] - H.shape[1])]))
        return base.delassus(wide, d)

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Return (v, l) of [[M, -G], [-G^T, -C]] (v, l) = rhs, rhs (n + p,)."""
        k, p = len(self._soft), self.G.shape[1]
        f, soft, b = np.split(rhs, [len(rhs) - p - k, len(rhs) - p])
        s = self.compliance[self._soft] * soft
        known = b.copy()
        known[self._soft] += s
        found = None if self._saddle is None else self._saddle.solve(f, known)
        if found is None:
            free = self.base.solve(f)
            multiplier = -self._inverse(self._on_base.T @ free + known)
            found = free + self.base.solve(self._on_base @ multiplier), multiplier
            flight, way = (abs(self._on_base).T @ np.abs(v) for v in (free, found[0]))
            lost = HELD * float(flight.max(initial=0.0)) > float(way.max(initial=0.0))
            if lost and not self._flies and self._whole is not None:
                found = self._whole.solve(f, known)
        v, multiplier = found
        return np.concatenate([v, s + self.compliance[self._soft] * multiplier[self._soft], multiplier])

    def delassus(self, H: sp.sparray, dimension: int) -> Matrix:
        """Return W - V S^-1 V^T (m, m) for H (n + p, m), zero on the links' own unknowns."""
        if self.summed is not None:
            return self.summed
        m, p = H.shape[1], self.G.shape[1]
        own = sp.csr_array(H)[: self._on_base.shape[0]]
        if self._saddle is not None:
            return self._saddle.delassus(own)
        whole = self._with_contacts(own, dimension)
        whole = whole if isinstance(whole, np.ndarray) else sp.csr_array(whole)
        W, V = whole[:m, :m], _dense(whole[:m, m : m + p])
        touched = np.flatnonzero(np.abs(V).max(axis=1, initial=0.0) > 0)
        tile = V[touched] @ self._inverse(V[touched].T)
        tile = 0.5 * (tile + tile.T)
        before = W.diagonal()
        lost = np.any(before[touched] - np.diag(tile) < HELD * before[touched])
        if lost and not self._flies and self._whole is not None:
            return _without_noise(self._whole.delassus(own), before)
        if isinstance(W, np.ndarray):
            W = W.copy()
            W[np.ix_(touched, touched)] -= tile
            return _without_noise(W, before)
        rows, columns = np.repeat(touched, len(touched)), np.tile(touched, len(touched))
        left = _without_noise(sp.csr_array(W) - sp.csr_array((tile.ravel(), (rows, columns)), shape=(m, m)), before)
        return sp.bsr_array(left, blocksize=(dimension, dimension))

    def shares(self, H: sp.sparray, dimension: int) -> None:
        """None: links couple the bodies."""


def _without_noise(W: Matrix, before: FloatArray) -> Matrix:
    """W (m, m) without the rows and columns of what links hold, see `NOTHING`; before (m,): its diagonal without links."""
    moves: BoolArray = W.diagonal() > NOTHING * before
    if moves.all():
        return W
    if isinstance(W, np.ndarray):
        return np.where(np.outer(moves, moves), W, 0.0)
    kept = sp.diags_array(moves.astype(float))
    return sp.csr_array(kept @ W @ kept)


def _sparse_factor(S: Matrix) -> Callable[[FloatArray], FloatArray] | None:
    """The solve of a sparse S of unit diagonal; None where a pivot vanishes."""
    options = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    try:
        factor = spla.splu(sp.csc_matrix(S), **options)
    except RuntimeError:
        return None
    return factor.solve if factor.U.diagonal().min() > PIVOT else None


def _dense(A: Matrix) -> FloatArray:
    return A if isinstance(A, np.ndarray) else A.toarray()
