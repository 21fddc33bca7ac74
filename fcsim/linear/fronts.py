"""Multifrontal elimination on the graph of the joints: Cholesky of W; LU of A W + B is in `multifrontal`.

In the order of an `EliminationTree` a joint's rows and columns are assembled in a dense front, eliminated with pivoting inside the
joint, and the complement on the joints next to it is passed on to the parent: LAPACK on fronts. A general sparse LU has to find this
structure among millions of entries (W of the refined wall has 14 million: MUMPS takes 2.7 s). The wall's LU takes 0.6 Gflop instead of
5.9, and fronts in single precision half the time of double ones, for a solve that is corrected by the defect.

`fcsim.linear.block_factors` is for the opposite case: contacts of small bodies, each with neighbours of its own.

Sources: I. S. Duff, J. K. Reid, ACM Trans. Math. Softw. 9, 1983; J. W. H. Liu, SIAM Review 34, 1992.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import scipy.linalg as sla
from numpy.typing import DTypeLike, NDArray

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.linear._front_kernels import backward, extend_add_upper, fill_symmetric, forward
from fcsim.linear.block_rows import dofs_of
from fcsim.linear.elimination_tree import EliminationTree
from fcsim.linear.factors import SingularMatrix, mirror
from fcsim.linear.joints import BlockRows


class _Assembly:
    """Goes through the fronts with the contacts that take part (nc,) and keeps the complements that wait for their parents.

    contacts: those that are eliminated, in that order; left: those that are not, though they take part, which stand on the fronts' borders
    alone and are numbered after the others; remainders: complements on them, with the places of their rows in `left`.
    """

    def __init__(self, tree: EliminationTree, taking_part: BoolArray, left: BoolArray | None = None) -> None:
        """left (nc,): contacts that are not eliminated, the tree's last; None: all are."""
        self._tree, self._part, self._left = tree, taking_part, left
        ordered = tree.order[taking_part[tree.order]]
        self.contacts, self.left = (ordered, ordered[:0]) if left is None else (ordered[~left[ordered]], ordered[left[ordered]])
        self._number = np.empty(len(taking_part), dtype=np.int64)
        self._number[self.contacts] = np.arange(len(self.contacts))
        self._number[self.left] = len(self.contacts) + np.arange(len(self.left))
        self._waiting: dict[int, list[tuple[IntArray, NDArray[np.floating]]]] = {}
        self.remainders: list[tuple[IntArray, NDArray[np.floating]]] = []

    def __iter__(self) -> Iterator[tuple[int, IntArray, IntArray, IntArray, list[tuple[IntArray, NDArray[np.floating]]]]]:
        """Yield for each front: the number of its first contact, own and border contacts, the latter's numbers, and the children's
        complements with the places of their rows among own and border."""
        begin = 0
        for f, (own, border, parent) in enumerate(self._tree):
            own, border = own[self._part[own]], border[self._part[border]]
            if self._left is not None:
                own, border = own[~self._left[own]], np.concatenate([own[self._left[own]], border])
                if not len(own) and f not in self._waiting:
                    continue
            n, beyond = len(own), self._number[border]
            children = [
                (np.where(below < begin + n, below - begin, n + np.searchsorted(beyond, below)), S) for below, S in self._waiting.pop(f, ())
            ]
            self._parent, self._beyond = parent, beyond
            yield begin, own, border, beyond, children
            begin += n

    def most_entries(self, d: int) -> int:
        """At most so many entries are in the rows of all fronts' own unknowns."""
        fronts = [(int(np.count_nonzero(self._part[own])), int(np.count_nonzero(self._part[border]))) for own, border, _ in self._tree]
        return sum(d * d * n * (n + b) for n, b in fronts)

    def pass_on(self, complement: NDArray[np.floating]) -> None:
        """Leave the present front's complement for its parent."""
        if len(self._beyond) and self._beyond[0] >= len(self.contacts):
            self.remainders.append((self._beyond - len(self.contacts), complement))
        elif len(self._beyond):
            self._waiting.setdefault(self._parent, []).append((self._beyond, complement))


def _complement(rows: BlockRows, assembly: _Assembly, local: IntArray, dtype: DTypeLike) -> NDArray[np.floating]:
    """W on the contacts that are left and all complements on them; local (nc,): scratch that is -1 everywhere."""
    d, left = rows.blocks.shape[1], assembly.left
    k = d * len(left)
    whole, none = np.zeros((k, k), dtype=dtype), np.zeros((k, 0), dtype=dtype)
    fill_symmetric(left, left[:0], local, rows.indptr, rows.indices, rows.blocks, whole, none)
    while assembly.remainders:
        place, S = assembly.remainders.pop()
        extend_add_upper(S, place, 0, d, np.zeros((0, 0), dtype=dtype), np.zeros((0, k), dtype=dtype), whole)
    return whole


class MultifrontalCholesky:
    """L L^T of a symmetric W on the held contacts (nc,) of `rows`, unknowns in the order of `contacts`; fronts of the given precision.

    conditioning: the least pivot over the largest; left (k,): the contacts on which W's complement is left, their unknowns after the
    others; complement (k d, k d): W there less what the eliminated ones take, its upper triangle, in their order.
    """

    def __init__(
        self, rows: BlockRows, held: BoolArray, dtype: DTypeLike = np.float64, *, shift: float = 0.0, left: BoolArray | None = None
    ) -> None:
        """shift: added to the diagonal of what is eliminated; left (nc,): those among the held contacts that are not, the last of the
        tree of `rows`; None: all are."""
        d = rows.blocks.shape[1]
        potrf = sla.lapack.get_lapack_funcs("potrf", dtype=dtype)
        self._trsm, syrk = sla.blas.get_blas_funcs(("trsm", "syrk"), dtype=dtype)
        local = np.full(len(held), -1)
        assembly = _Assembly(rows.tree, held, left)
        self.contacts, self.left = assembly.contacts, assembly.left
        self._fronts = []
        values, end = np.zeros(assembly.most_entries(d), dtype=dtype), 0  # of all fronts in one array, for kernels that go through them
        pivots = [np.empty(0)]
        for begin, own, border, beyond, children in assembly:
            n, b = len(own), len(border)
            middle, begin_of_next = end + d * d * n * n, end + d * d * n * (n + b)
            F11, F12 = values[end:middle].reshape(d * n, d * n), values[middle:begin_of_next].reshape(d * n, d * b)
            end = begin_of_next
            F22 = np.zeros((d * b, d * b), dtype=dtype)
            fill_symmetric(own, border, local, rows.indptr, rows.indices, rows.blocks, F11, F12)
            for place, S in children:
                extend_add_upper(S, place, n, d, F11, F12, F22)
            if n:
                F11.flat[:: d * n + 1] += shift
                L, info = potrf(F11.T, lower=True, overwrite_a=True, clean=False)
                if info != 0:
                    raise SingularMatrix(f"W of {len(self.contacts)} held contacts is not positive definite")
                F21 = F12.T
                if b:
                    F21 = self._trsm(1.0, L, F21, side=1, lower=True, trans_a=True, overwrite_b=True)
                    F22 = syrk(-1.0, F21, 1.0, F22.T, lower=True, overwrite_c=True).T
                pivots.append(L.diagonal().astype(float) ** 2)
                self._fronts.append((slice(d * begin, d * (begin + n)), dofs_of(beyond, d), L, F21))
            assembly.pass_on(F22)
        sizes = np.array([(own.stop - own.start, len(border)) for own, border, _, _ in self._fronts], dtype=np.int64).reshape(-1, 2)
        borders = np.concatenate([np.empty(0, dtype=np.int64), *(border for _, border, _, _ in self._fronts)])
        self._by_fronts = values, sizes, borders
        every = np.concatenate(pivots)
        self.conditioning = float(every.min() / every.max()) if len(every) else 1.0
        self.complement = _complement(rows, assembly, local, dtype)

    @property
    def fronts(self) -> Sequence[tuple[slice, IntArray, NDArray[np.floating], NDArray[np.floating]]]:
        """Each front's own unknowns, its border's, ascending, L on the own ones (what is above its diagonal is not used) and L_bo."""
        return self._fronts

    def forward(self, X: FloatArray) -> FloatArray:
        """Overwrite X (n, k), in C order, with L^-1 X and return it; columns that are zero so far cost nothing."""
        if X.shape[1] == 1:
            forward(*self._by_fronts, X[:, 0])
            return X
        for own, border, L, F21 in self._fronts:
            part = X[own]
            columns = np.flatnonzero(part.any(axis=0))
            if not len(columns):
                continue
            whole = len(columns) > 0.8 * X.shape[1]
            part = part if whole else part[:, columns]
            part = self._trsm(1.0, L, part.T, side=1, lower=True, trans_a=True, overwrite_b=True).T
            if whole:
                X[own] = part
                if len(border):
                    X[border] -= F21 @ part
            else:
                X[own, columns] = part
                if len(border):
                    X[np.ix_(border, columns)] -= F21 @ part
        return X

    def backward(self, z: FloatArray) -> FloatArray:
        """Return L^-T z for z (n,)."""
        x = z.copy()
        backward(*self._by_fronts, x)
        return x


def inverse_blocks(factor: MultifrontalCholesky, cuts: IntArray) -> NDArray[np.floating]:
    """The diagonal blocks of Z = (L L^T)^-1 in the factor's precision, one after the other, each by rows, without Z.

    cuts (blocks + 1,): the unknown at which each block begins, in the factor's order, and their number; no block lies in two fronts.
    No contact is left.
    With a front's own unknowns o, its border b and G = L_bo L_oo^-1,

        Z_bo = -Z_bb G,        Z_oo = (L_oo L_oo^T)^-1 + G^T Z_bb G,

    and Z_bb is known from the parent, since a front's border lies among the parent's own and border unknowns: from the root down, at about
    the cost of an LU elimination (K. Takahashi, J. Fagan, M.-S. Chin, Proc. 8th PICA Conf., 1973; Y. E. Campbell, T. A. Davis, Univ. of
    Florida TR-95-021, 1995).
    """
    fronts = factor.fronts
    size = np.diff(cuts)
    starts = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(size * size)])
    dtype = fronts[0][2].dtype if fronts else np.dtype(float)
    blocks = np.empty(starts[-1], dtype=dtype)
    trsm, gemm = sla.blas.get_blas_funcs(("trsm", "gemm"), dtype=dtype)
    potri = sla.lapack.get_lapack_funcs("potri", dtype=dtype)
    first = np.array([own.start for own, _, _, _ in fronts], dtype=np.int64)
    parent = [int(np.searchsorted(first, border[0], side="right")) - 1 if len(border) else -1 for _, border, _, _ in fronts]
    children = np.bincount([p for p in parent if p >= 0], minlength=len(fronts))
    known: dict[int, NDArray[np.floating]] = {}  # Z on own and border of the fronts whose children have not all had it
    for f in range(len(fronts) - 1, -1, -1):
        own, border, L, L_bo = fronts[f]
        n, p = own.stop - own.start, parent[f]
        Z = potri(L, lower=True)[0]
        mirror(Z.T)
        Z_bb = Z_bo = np.empty((0, 0), dtype=dtype)
        if p >= 0:
            above, outside = fronts[p][0], fronts[p][1]
            place = np.where(border < above.stop, border - above.start, above.stop - above.start + np.searchsorted(outside, border))
            Z_bb = known[p][np.ix_(place, place)]
            children[p] -= 1
            if not children[p]:
                del known[p]
        if len(border):
            G = trsm(1.0, L, L_bo, side=1, lower=True)
            Z_bo = gemm(-1.0, Z_bb.T, G)  # Z_bb is symmetric, its transpose stands by columns
            Z = gemm(-1.0, G, Z_bo, 1.0, Z, trans_a=True, overwrite_c=True)
        begin, stop = np.searchsorted(cuts, (own.start, own.stop))
        for block in range(begin, stop):
            part = slice(cuts[block] - own.start, cuts[block + 1] - own.start)
            blocks[starts[block] : starts[block + 1]] = Z[part, part].ravel()
        if children[f]:
            known[f] = whole = np.empty((n + len(border), n + len(border)), dtype=dtype)
            whole[:n, :n] = Z
            if len(border):
                whole[n:, :n], whole[:n, n:], whole[n:, n:] = Z_bo, Z_bo.T, Z_bb
    return blocks
