"""What stands for M^-1 in a step's problem: the model's factor, the compliance of joints, and W summed from the parts' compliances."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import cast

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.arrays import BoolArray, FloatArray, IntArray, Matrix
from fcsim.assembly.compliance import SystemFactor
from fcsim.brief import brief
from fcsim.linear.factors import Factor, factorise
from fcsim.linear.late.late_rows import in_blocks
from fcsim.linear.over_ranks.implicit_matrix import ImplicitMatrix, LateMatrix
from fcsim.linear.sparse.behind import with_diagonal_behind, with_units_behind
from fcsim.problem._delassus_kernels import entries_by_body
from fcsim.problem._reduction_kernels import added_to_own_blocks
from fcsim.problem.bodies.late import late_sum, summed, summed_late
from fcsim.problem.bodies.shares import BodyShares, shares_of
from fcsim.problem.delassus_sum import DelassusSum
from fcsim.problem.distributed import BodiesOverRanks, DistributedDelassus
from fcsim.threads import begun
from fcsim.timestep.step_equation._turned_rows_kernels import turned_rows
from fcsim.timestep.step_equation.contact_tangent.leaning import Leaning
from fcsim.timestep.step_equation.over_ranks import layout_of

_MARGIN = 0.05
"""Of A's own stiffness: what A + B keeps of it at least in every direction."""

_CONDITION = 1e6
"""Of I + B_PP C: where larger, A + B is factored as a whole."""


@dataclass(frozen=True, eq=False)
class StepCompliance:
    """The `MassFactor` of a step (see `fcsim.problem.reduction`): products with the few entries of H are all that a step adds.

    joint: (m,) the diagonal of C, u = H^T v + C r + w; None = rigid. The problem has an unknown of its own, C r, after the bodies'
    for each entry that is not zero, with C^-1 on the diagonal of M and 1 in H: so the problem that solvers and FCLIB files see is an
    ordinary one, and W = H^T M^-1 H + C.
    summed: W of this H where it is known already, from another right side of the step.
    bent: the geometric stiffness B of contacts on the bodies' unknowns, None = none: M is A + B with A of the factor. With P the unknowns
    that B touches, (A + B)^-1 = A^-1 - A^-1 P X P^T A^-1, X = (I + B_PP C)^-1 B_PP, C = P^T A^-1 P: A's factors stay the bodies' own.
    Where mass alone holds a body C is so large that this loses digits: then A + B is factored as a whole.
    leaning: gaps that do not close along their normals, see `Leaning`: M is (A + B) T. None = none.
    over_ranks_from: entries that the bodies' shares of W have from which it is left distributed where ranks share the model;
    over_ranks_elastic: only where every contact has a deformable body.
    late: whether W's entries may be summed as late as when they are read, see `summed_late`.
    ahead: an H whose W is being summed on another thread, and what waits for that, see `beginning`.
    """

    factor: SystemFactor
    joint: FloatArray | None = None
    summed: Matrix | None = None
    bent: sp.csr_array | None = None
    leaning: Leaning | None = None
    over_ranks_from: float = np.inf
    over_ranks_elastic: bool = False
    ahead: tuple[sp.sparray, Callable[[], Matrix]] | None = None
    late: bool = False

    __repr__ = brief

    @cached_property
    def _soft(self) -> IntArray:
        """Which contact unknowns have a compliance."""
        return np.flatnonzero(self.joint) if self.joint is not None else np.empty(0, dtype=np.int64)

    @property
    def unknowns(self) -> int:
        """Number of the problem's unknowns."""
        model = self.factor.model
        return (len(model.free_dofs) if model.driven == "eliminated" else model.n_dofs) + len(self._soft)

    def matrix(self) -> sp.csr_array:
        """M of the problem."""
        matrix = self.factor.matrix()
        if self.bent is not None:
            matrix = sp.csr_array(matrix + self.bent)
        if self.leaning is not None:
            matrix = sp.csr_array(matrix - (matrix @ self.leaning.H) @ self.leaning.to_straight)
        if self.joint is None:
            return matrix
        return with_diagonal_behind(matrix, 1 / self.joint[self._soft])

    def problem_matrix(self) -> Matrix:
        """M of the problem: its products alone where ranks have a body together, made when it is read where materials are linear."""
        factor = self.factor
        if self.bent is not None or self.leaning is not None or self.joint is not None:
            return self.matrix()
        if factor.over_ranks:
            return cast(Matrix, ImplicitMatrix(self.unknowns, factor.product, factor.matrix))
        if not factor.nonlinear_groups:
            return cast(Matrix, LateMatrix(self.unknowns, factor.product, factor.matrix))
        return self.matrix()

    def with_joints(self, H: sp.sparray) -> sp.sparray:
        """The problem's H (n, m) from that of the bodies' unknowns."""
        if self.joint is None:
            return H
        return with_units_behind(sp.csr_array(H), self._soft)

    def load(self, f: FloatArray) -> FloatArray:
        """The problem's f (n,) from that of the bodies' unknowns."""
        return f if self.joint is None else np.concatenate([f, np.zeros(len(self._soft))])

    def bodies(self, v: FloatArray) -> FloatArray:
        """The bodies' unknowns of the problem's v (n,)."""
        return v if self.joint is None else v[: len(v) - len(self._soft)]

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Return M^-1 rhs for rhs (n,) of the problem's unknowns."""
        own = len(rhs) - len(self._soft)
        v = self.factor.solve(rhs[:own]) if self._whole is None else self._whole.solve(rhs[:own])
        if self.bent is not None and self._whole is None:
            pushed = np.zeros(own)
            pushed[self._touched] = self._correction @ v[self._touched]
            v = v - self.factor.solve(pushed)
        v = v if self.leaning is None else self.leaning.lean(v)
        return v if self.joint is None else np.concatenate([v, self.joint[self._soft] * rhs[own:]])

    @cached_property
    def _touched(self) -> IntArray:
        """The unknowns P."""
        B = sp.coo_array(self.bent)
        return np.union1d(B.row, B.col)

    @cached_property
    def _compliance_there(self) -> FloatArray:
        """C (k, k)."""
        d, k = self.factor.model.dimension, len(self._touched)
        C = self._sum(_chosen(self._touched, self.unknowns - len(self._soft), d), d)
        return (C if isinstance(C, np.ndarray) else C.toarray())[:k, :k]

    @cached_property
    def _B(self) -> FloatArray:
        """B_PP (k, k)."""
        assert self.bent is not None  # none is asked for else
        return self.bent[self._touched][:, self._touched].toarray()

    @cached_property
    def _nearly_one(self) -> tuple[FloatArray, NDArray[np.int32], float]:
        """The factors of I + B_PP C by LAPACK, its pivots, and one over its condition number."""
        matrix = np.eye(len(self._B)) + self._B @ self._compliance_there
        if not matrix.size:  # LAPACK complains on the terminal
            return matrix, np.empty(0, dtype=np.int32), 1.0
        size = np.linalg.norm(matrix, 1)
        factors, pivots, _ = sla.lapack.dgetrf(matrix, overwrite_a=True)
        return factors, pivots, float(sla.lapack.dgecon(factors, size)[0])

    @cached_property
    def _correction(self) -> FloatArray:
        """X (k, k)."""
        factors, pivots, _ = self._nearly_one
        if not factors.size:
            return factors
        X: FloatArray = sla.lapack.dgetrs(factors, pivots, self._B)[0]
        return X

    @cached_property
    def _whole(self) -> Factor | None:
        """The factor of A + B, None where the correction serves."""
        if self.bent is None or self._nearly_one[2] * _CONDITION > 1:
            return None
        return factorise(sp.csr_array(self.factor.matrix() + self.bent))

    @property
    def positive(self) -> bool:
        """Whether the symmetric part of A + B is positive definite, as A is."""
        if self.bent is None:
            return True
        try:
            L = np.linalg.cholesky(self._compliance_there)
            np.linalg.cholesky((1 - _MARGIN) * np.eye(len(L)) + 0.5 * (L.T @ (self._B + self._B.T) @ L))
        except np.linalg.LinAlgError:
            return False
        return True

    def delassus(self, H: sp.sparray, dimension: int) -> Matrix:
        """Return W = H^T M^-1 H (m, m) for H (n, m) on the problem's unknowns."""
        if self.summed is not None:
            return self.summed
        if self.ahead is not None and H is self.ahead[0]:
            return self.ahead[1]()
        if self.leaning is not None:
            return self._leant(H, dimension)
        given, H = H, sp.csc_array(H if self.joint is None else sp.csr_array(H)[: H.shape[0] - len(self._soft)])
        if self.bent is None:
            distributed = self._distributed(H, given, dimension) if self.over_ranks_from < np.inf and self.joint is None else None
            late = self.late and self.joint is None
            matrix = self._sum(H, dimension, late=late) if distributed is None else distributed
        elif self._whole is not None:
            matrix = H.T @ self._whole.solve(H.toarray())
        else:
            m, k = H.shape[1], len(self._touched)
            wide = self._sum(sp.csc_array(sp.hstack([H, _chosen(self._touched, H.shape[0], dimension)])), dimension)
            wide = wide if isinstance(wide, np.ndarray) else sp.csr_array(wide)
            matrix = _corrected(wide[:m, :m], wide[:m, m : m + k], self._correction, wide[m : m + k, :m], dimension)
        return matrix if self.joint is None else _with_diagonal(matrix, self.joint, dimension)

    def shares(self, H: sp.sparray, dimension: int) -> Callable[[], BodyShares] | None:
        """What makes the bodies' shares of W of H (n, m); None where contacts have compliances or stiffnesses of their own, or ranks share
        the model."""
        model = self.factor.model
        if self.joint is not None or self.bent is not None or self.leaning is not None or model.shares is not None:
            return None

        def make() -> BodyShares:
            on_compliances = self._on_compliances(sp.csc_array(H))
            compliances = tuple(self.factor.compliances(self._asked(on_compliances)))
            return shares_of(on_compliances, *self.factor.places, len(model.bodies), dimension, compliances)

        return make

    def beginning(self, H: sp.sparray, dimension: int) -> StepCompliance:
        """The same, which begins W of H (n, m) on another thread, so that it is summed while the rest of the problem is made. Not
        where ranks share the model: their exchanges have one order."""
        if self.summed is not None or self.factor.model.shares is not None:
            return self
        return replace(self, ahead=(H, begun(partial(self.delassus, H, dimension))))

    def _leant(self, H: sp.sparray, dimension: int) -> FloatArray:
        """H^T T^-1 (A + B)^-1 H, T^-1 = I + H_c Y E^T."""
        assert self.leaning is not None
        m, wide = H.shape[1], sp.csc_array(sp.hstack([H, self.leaning.E]))
        W = replace(self, leaning=None, over_ranks_from=np.inf).delassus(wide, dimension)
        W = W if isinstance(W, np.ndarray) else W.toarray()
        W = W[: wide.shape[1], : wide.shape[1]]
        leant: FloatArray = W[:m, :m] + (H.T @ self.leaning.H) @ (self.leaning.inverse @ W[m:, :m])
        return leant

    def _sum(self, H: sp.sparray, dimension: int, *, late: bool = False) -> Matrix:
        """H^T A^-1 H for H (n, m) on the bodies' unknowns, from their compliances."""
        model, H = self.factor.model, self._on_compliances(H)
        W = DelassusSum(H, *self.factor.places, len(model.bodies), dimension, rigid=len(model.rigid) == len(model.bodies))
        if late and model.shares is None:
            return summed_late(W, tuple(self.factor.compliances(self._asked(H))))
        for first, compliances, kind in self.factor.compliances(self._asked(H)):
            W.add(first, compliances, kind)
        if model.shares is not None:
            model.shares.world.summed("W", W.values)
        return W.matrix()

    def _distributed(self, H: sp.csc_array, given: sp.sparray, dimension: int) -> Matrix | None:
        """The same as the ranks' own bodies' shares; None where W is small, its contacts are not all ranks', or there is one process;
        given: the problem's H, so that no other one is kept for who asks for h of all bodies."""
        shares = self.factor.model.shares
        if shares is None or dimension != self.factor.model.dimension:
            return None
        H, rank = self._on_compliances(H), self.factor.ranks()
        make_h = partial(self._entries_by_body, given, dimension)
        known = layout_of(self.factor, shares, H, given, dimension, make_h)
        layout, count = known.layout, len(rank)
        if known.entries < self.over_ranks_from or not all(len(some) for some in layout.contacts):
            return None
        if self.over_ranks_elastic and not known.elastic:
            return None
        with shares.world.together("W"):
            kept_as = known if self.factor.rotation is None else None  # turned H has entries that the problem's has not
            W = DelassusSum(H, known.own, self.factor.places[1], count, dimension, known.blocks, layout.own, kept_as)
            runs = tuple(self.factor.compliances(self._asked(H)))
            late = late_sum(W, runs)
            share = in_blocks(summed(W, runs), dimension) if late is None else late
        made_of = () if kept_as is None else (layout, *self.factor.places)
        return cast(Matrix, DistributedDelassus(layout, share, BodiesOverRanks(make_h, known.bodies, runs, rank, layout.nc, made_of)))

    def _entries_by_body(
        self, H: sp.sparray, dimension: int, some: IntArray | None = None
    ) -> tuple[IntArray, IntArray, IntArray, IntArray, FloatArray]:
        """h of all bodies and the contacts `some` (k,), None: all of them, see `entries_by_body`."""
        on, count = self._on_compliances(sp.csc_array(H)), len(self.factor.ranks())
        some = np.arange(H.shape[1] // dimension) if some is None else some
        return entries_by_body(on.indptr, on.indices, on.data, *self.factor.places, count, dimension, some)

    def _asked(self, H: sp.csc_array) -> BoolArray:
        """Which rows (n,) of H have entries, as `SystemFactor.compliances` asks; none where no body has a factor of its own, which alone
        reads it."""
        touched = np.zeros(H.shape[0], dtype=bool)
        if self.factor.nonlinear_groups:
            touched[H.indices] = True
        return touched

    def _on_compliances(self, H: sp.csc_array) -> sp.csc_array:
        """H on the dofs (n_dofs,), in the axes of the bodies' compliances."""
        model = self.factor.model
        if model.driven == "eliminated":
            rows = model.free_dofs[H.indices].astype(H.indices.dtype)
            H = sp.csc_array((H.data, rows, H.indptr), shape=(model.n_dofs, H.shape[1]))
        return H if self.factor.rotation is None else self._in_frames(H)

    def _in_frames(self, H: sp.csc_array) -> sp.csc_array:
        """H along the supports' axes as they are in the axes of the bodies' compliances."""
        model = self.factor.model
        axes = model.axes_matrix
        H = H if axes is None else sp.csc_array(axes.T @ H)
        sizes = np.diff(model.node_offset[: len(model.deformable) + 1])
        if not H.has_sorted_indices:
            H = H.sorted_indices()
        body = np.repeat(np.arange(len(sizes)), sizes)
        indptr, indices, data = turned_rows(tuple(range(model.dimension)), H.indptr, H.indices, H.data, body, self.factor.rotation)
        turned = sp.csc_array((data, indices, indptr), shape=H.shape)
        return turned if axes is None else sp.csc_array(axes @ turned)


def _chosen(rows: IntArray, n: int, d: int) -> sp.csc_array:
    """Columns of the identity (n, k), filled up to whole blocks of d."""
    k = len(rows)
    return sp.csc_array((np.ones(k), (rows, np.arange(k))), shape=(n, k + -k % d))


def _corrected(W: Matrix, left: sp.sparray, X: FloatArray, right: sp.sparray, d: int) -> Matrix:
    """W - left X right (m, m) for left (m, k), right (k, m), of which few rows and columns are not zero."""
    if isinstance(W, np.ndarray):
        corrected: FloatArray = W - left @ X @ right
        return corrected
    rows = np.flatnonzero(np.diff(sp.csr_array(left).indptr))
    columns = np.flatnonzero(np.diff(sp.csc_array(right).indptr))
    tile = left[rows].toarray() @ X @ right[:, columns].toarray()
    places = np.repeat(rows, len(columns)), np.tile(columns, len(rows))
    return sp.bsr_array(sp.csr_array(W) - sp.csr_array((tile.ravel(), places), shape=W.shape), blocksize=(d, d))


def _with_diagonal(W: Matrix, diagonal: FloatArray, d: int) -> Matrix:
    """W + diag, in the storage of W, whose values change where it has all blocks."""
    if isinstance(W, np.ndarray):
        W[np.diag_indices_from(W)] += diagonal
        return W
    if W.format == "bsr" and W.blocksize == (d, d) and added_to_own_blocks(W.indptr, W.indices, W.data, diagonal):
        return W
    return sp.bsr_array(W + sp.diags_array(diagonal), blocksize=(d, d))
