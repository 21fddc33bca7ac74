"""Multifrontal elimination on the graph of the joints: LU of A W + B, with A and B block diagonal over contacts, and Cholesky of W.

Contacts of one joint (the same pair of bodies) are coupled with the same contacts, so the graph that fill-in depends on has a vertex for
each joint and an edge for each two joints of a body. It is ordered by minimum degree; a joint's rows and columns are assembled in a
dense front, eliminated with pivoting inside the joint, and the complement on the joints next to it is passed on to the parent. The
symbolic part takes milliseconds since it never sees an unknown, the rest is LAPACK on fronts; a general sparse LU has to find this
structure among millions of entries (W of the refined wall has 14 million: MUMPS takes 2.7 s). The wall's LU takes 0.6 Gflop instead of
5.9, and fronts in single precision half the time of double ones, for a solve that is corrected by the defect.

`fcsim.block_cholesky` is for the opposite case: contacts of small bodies, each with neighbours of its own.

Sources: I. S. Duff, J. K. Reid, ACM Trans. Math. Softw. 9, 1983; J. W. H. Liu, SIAM Review 34, 1992; a graph of indistinguishable
nodes and minimum degree: A. George, J. W. H. Liu, SIAM Review 31, 1989.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.linear import SingularMatrix
from fcsim.solvers._front_kernels import extend_add, extend_add_lower, fill_lower, fill_transposed, sparse_product, transposed_entries
from fcsim.solvers._kernels import block_rows_of_dense
from fcsim.solvers.newton_system import dofs_of

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

FRONTS_FROM, JOINT, SAVING = 600, 6, 0.2
"""Contact unknowns from which, contacts a joint in the mean from which, and flops over m^3 up to which fronts are worth their overhead."""
SLACK = 0.1
"""A front is merged into its parent where that adds at most this share of rows to it: fewer and larger products."""


@dataclass(frozen=True, eq=False)
class Front:
    """Contacts that are eliminated together and those their complement falls on, both in the order of elimination; -1: no parent."""

    own: IntArray
    border: IntArray
    parent: int


class EliminationTree:
    """Fronts in postorder (children before parents) for a block pattern (indptr, indices) that is symmetric."""

    def __init__(self, indptr: IntArray, indices: IntArray) -> None:
        joint, adjacent = joints(indptr, indices)
        size = np.bincount(joint)
        pivots, borders = merged(*minimum_degree(adjacent, size), size)
        order = postorder(pivots, borders)
        members = np.split(np.argsort(joint, kind="stable"), np.cumsum(size)[:-1])
        sequence = [j for f in order for j in pivots[f]]
        rank = {j: k for k, j in enumerate(sequence)}
        number = {j: k for k, f in enumerate(order) for j in pivots[f]}
        nothing = np.empty(0, dtype=np.int64)
        self.fronts = []
        for f in order:
            border = sorted(borders[f], key=rank.__getitem__)
            self.fronts.append(
                Front(
                    np.concatenate([members[j] for j in pivots[f]]),
                    np.concatenate([members[j] for j in border]) if border else nothing,
                    number[border[0]] if border else -1,
                )
            )
        self.order = np.concatenate([front.own for front in self.fronts]) if self.fronts else nothing

    def flops(self, d: int) -> float:
        """Operations of an elimination of all contacts with d unknowns each."""
        n = d * np.array([len(front.own) for front in self.fronts], dtype=float)
        b = d * np.array([len(front.border) for front in self.fronts], dtype=float)
        return float(np.sum(2 / 3 * n**3 + 2 * n * n * b + 2 * n * b * b))


def _signatures(indptr: IntArray, indices: IntArray) -> NDArray[np.uint64]:
    """A number (nc,) for each set of neighbours: the sum of their random weights modulo 2^64."""
    weight = np.random.default_rng(0).integers(2**63, size=len(indptr) - 1, dtype=np.uint64)
    total = np.concatenate([np.zeros(1, dtype=np.uint64), np.cumsum(weight[indices])])
    return total[indptr[1:]] - total[indptr[:-1]]


def joint_count(indptr: IntArray, indices: IntArray) -> int:
    """Number of joints."""
    return len(np.unique(_signatures(indptr, indices)))


def joints(indptr: IntArray, indices: IntArray) -> tuple[IntArray, list[set[int]]]:
    """Return the joint (nc,) of each contact, contacts with one set of neighbours, and the joints next to each joint."""
    _, first, joint = np.unique(_signatures(indptr, indices), return_index=True, return_inverse=True)
    adjacent = [set(joint[indices[indptr[a] : indptr[a + 1]]].tolist()) - {j} for j, a in enumerate(first)]
    return joint, adjacent


def minimum_degree(adjacent: list[set[int]], size: IntArray) -> tuple[list[int], list[set[int]]]:
    """Return vertices in the order of elimination and the neighbours that each has when it is eliminated; degrees count contacts."""
    graph = [set(neighbours) for neighbours in adjacent]
    degree = [int(sum(size[k] for k in neighbours)) for neighbours in graph]
    waiting = [(count, j) for j, count in enumerate(degree)]  # with degrees of the past, which are skipped
    heapq.heapify(waiting)
    order: list[int] = []
    borders: list[set[int]] = []
    left = set(range(len(graph)))
    while left:
        count, pivot = heapq.heappop(waiting)
        if pivot not in left or count != degree[pivot]:
            continue
        border = graph[pivot]
        left.discard(pivot)
        for j in border:
            graph[j] |= border
            graph[j] -= {j, pivot}
            degree[j] = int(sum(size[k] for k in graph[j]))
            heapq.heappush(waiting, (degree[j], j))
        order.append(pivot)
        borders.append(border)
    return order, borders


def merged(order: list[int], borders: list[set[int]], size: IntArray) -> tuple[list[list[int]], list[set[int]]]:
    """Merge fronts with their parents where the parent's rows are nearly the child's border; return pivots and border of each."""
    front = {pivot: f for f, pivot in enumerate(order)}  # the front that eliminates a vertex
    pivots = [[pivot] for pivot in order]
    rank = {pivot: k for k, pivot in enumerate(order)}
    for f in range(len(order)):
        if not borders[f]:
            continue
        parent = front[min(borders[f], key=rank.__getitem__)]
        rows = set(pivots[parent]) | borders[parent]
        if sum(size[j] for j in rows - borders[f]) <= SLACK * sum(size[j] for j in rows):
            pivots[parent] = pivots[f] + pivots[parent]
            for j in pivots[f]:
                front[j] = parent
            pivots[f] = []
    kept = [f for f in range(len(order)) if pivots[f]]
    return [pivots[f] for f in kept], [borders[f] for f in kept]


def postorder(pivots: list[list[int]], borders: list[set[int]]) -> list[int]:
    """Return the fronts, each after all of its children and next to them."""
    front = {j: f for f, own in enumerate(pivots) for j in own}
    children: list[list[int]] = [[] for _ in pivots]
    roots: list[int] = []
    for f, border in enumerate(borders):
        above = min((front[j] for j in border), default=None)
        (roots if above is None else children[above]).append(f)
    order = []
    stack = roots[::-1]
    while stack:  # a parent before its children, reversed in the end
        f = stack.pop()
        order.append(f)
        stack.extend(children[f])
    return order[::-1]


class BlockRows:
    """W by sorted block rows with the elimination tree of its pattern; SingularMatrix where the pattern is not symmetric."""

    def __init__(self, W: Any, d: int, previous: BlockRows | None = None) -> None:
        """W: dense or sparse; previous: where its pattern is the same, its tree serves again."""
        if isinstance(W, np.ndarray):
            indptr, indices, blocks = block_rows_of_dense(W, d)
            rows = sp.bsr_array((blocks, indices, indptr), shape=W.shape)
        else:
            rows = sp.bsr_array(W, blocksize=(d, d))
            if not rows.has_sorted_indices:
                rows = rows.copy() if rows.data is W.data else rows
                rows.sort_indices()
        self.W = rows
        self.indptr, self.indices, self.blocks = rows.indptr, rows.indices, rows.data
        self.transposed: IntArray
        self.tree: EliminationTree
        if previous is not None and previous.has_pattern(self.indptr, self.indices):
            self.transposed, self.tree = previous.transposed, previous.tree
            return
        self.transposed = np.empty_like(self.indices)  # the entry of block (b, a) for each entry of a block (a, b)
        if not transposed_entries(self.indptr, self.indices, self.transposed):
            raise SingularMatrix("the pattern of W is not symmetric")
        self.tree = EliminationTree(self.indptr, self.indices)

    def product(self, x: FloatArray) -> FloatArray:
        """W x (m,); contacts where x is zero cost nothing."""
        y = np.empty_like(x)
        sparse_product(self.indptr, self.indices, self.blocks.ravel(), self.blocks.shape[1], x, y)
        return y

    def has_pattern(self, indptr: IntArray, indices: IntArray) -> bool:
        """Whether these are the rows' own."""
        return np.array_equal(indptr, self.indptr) and np.array_equal(indices, self.indices)


def joint_rows(W: Any, d: int, previous: BlockRows | None = None) -> BlockRows | None:
    """Sparse W by block rows where its contacts come in joints that leave most of a dense elimination's work out, else None."""
    if W.shape[0] < FRONTS_FROM:
        return None
    rows = sp.bsr_array(W, blocksize=(d, d))
    if previous is not None and previous.has_pattern(rows.indptr, rows.indices):
        return BlockRows(rows, d, previous)
    nc = rows.shape[0] // d
    if len(rows.indices) < JOINT * nc or joint_count(rows.indptr, rows.indices) * JOINT > nc:
        return None
    try:
        joined = BlockRows(rows, d)
    except SingularMatrix:
        return None
    return joined if joined.tree.flops(d) <= SAVING * (nc * d) ** 3 else None


class _Assembly:
    """Goes through the fronts with the contacts that take part (nc,) and keeps the complements that wait for their parents."""

    def __init__(self, tree: EliminationTree, taking_part: BoolArray) -> None:
        self._fronts, self._part = tree.fronts, taking_part
        self.contacts = tree.order[taking_part[tree.order]]
        self._number = np.empty(len(taking_part), dtype=np.int64)
        self._number[self.contacts] = np.arange(len(self.contacts))
        self._waiting: dict[int, list[tuple[IntArray, Any]]] = {}

    def __iter__(self) -> Iterator[tuple[int, IntArray, IntArray, IntArray, list[tuple[IntArray, Any]]]]:
        """Yield for each front: the number of its first contact, own and border contacts, the latter's numbers, and the children's
        complements with the places of their rows among own and border."""
        begin = 0
        for f, front in enumerate(self._fronts):
            own, border = front.own[self._part[front.own]], front.border[self._part[front.border]]
            n, beyond = len(own), self._number[border]
            children = [
                (np.where(below < begin + n, below - begin, n + np.searchsorted(beyond, below)), S) for below, S in self._waiting.pop(f, ())
            ]
            self._parent, self._beyond = front.parent, beyond
            yield begin, own, border, beyond, children
            begin += n

    def pass_on(self, complement: Any) -> None:
        """Leave the present front's complement for its parent."""
        if len(self._beyond):
            self._waiting.setdefault(self._parent, []).append((self._beyond, complement))


class Multifrontal:
    """LU of A W + B on the active contacts (nc,) of `rows`; fronts of the given precision, of the transposed matrix."""

    def __init__(self, rows: BlockRows, A: FloatArray, B: FloatArray, active: BoolArray, dtype: Any = np.float64) -> None:
        d = A.shape[1]
        getrf, self._getrs = sla.lapack.get_lapack_funcs(("getrf", "getrs"), dtype=dtype)
        gemm = sla.blas.get_blas_funcs("gemm", dtype=dtype)
        self._dtype = dtype
        local = np.full(len(active), -1)
        W, A, B = rows.blocks.ravel(), A.ravel(), B.ravel()
        assembly = _Assembly(rows.tree, active)
        self.contacts = assembly.contacts
        self._fronts = []
        for begin, own, border, beyond, children in assembly:
            n, b = len(own), len(border)
            F11, F12, F21, F22 = (np.zeros((d * k, d * m), dtype=dtype, order="F") for k, m in ((n, n), (n, b), (b, n), (b, b)))
            fill_transposed(own, border, local, rows.indptr, rows.indices, W, A, B, d, F11, F12, F21)
            for place, S in children:
                extend_add(S, place, n, d, F11, F12, F21, F22)
            if n:
                lu, pivots, info = getrf(F11, overwrite_a=True)
                if info != 0:
                    raise SingularMatrix(f"the block of {n} contacts is singular: zero pivot {info}")
                if b:
                    F12 = self._getrs(lu, pivots, F12, overwrite_b=True)[0]
                    F22 = gemm(-1.0, F21, F12, 1.0, F22, overwrite_c=True)
                self._fronts.append((slice(d * begin, d * (begin + n)), dofs_of(beyond, d), lu, pivots, F12.T, F21.T))
            assembly.pass_on(F22)

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Return x (k, d) of the active contacts for rhs (k, d), both in the order of `contacts`."""
        x = rhs.astype(self._dtype).ravel()
        for own, border, _, _, left, _ in self._fronts:
            x[border] -= left @ x[own]
        for own, border, lu, pivots, _, right in reversed(self._fronts):
            x[own] = self._getrs(lu, pivots, x[own] - right @ x[border], trans=1)[0]
        return x.reshape(rhs.shape)


class MultifrontalCholesky:
    """L L^T of a symmetric W on the held contacts (nc,) of `rows`, unknowns in the order of `contacts`; fronts of the given precision.

    conditioning: the least pivot over the largest.
    """

    def __init__(self, rows: BlockRows, held: BoolArray, dtype: Any = np.float64) -> None:
        d = rows.blocks.shape[1]
        potrf = sla.lapack.get_lapack_funcs("potrf", dtype=dtype)
        self._trsm, self._trsv, syrk = sla.blas.get_blas_funcs(("trsm", "trsv", "syrk"), dtype=dtype)
        local = np.full(len(held), -1)
        assembly = _Assembly(rows.tree, held)
        self.contacts = assembly.contacts
        self._fronts = []
        pivots = [np.empty(0)]
        for begin, own, border, beyond, children in assembly:
            n, b = len(own), len(border)
            F11, F21, F22 = (np.zeros((d * k, d * m), dtype=dtype, order="F") for k, m in ((n, n), (b, n), (b, b)))
            fill_lower(own, border, local, rows.indptr, rows.indices, rows.blocks, F11, F21)
            for place, S in children:
                extend_add_lower(S, place, n, d, F11, F21, F22)
            if n:
                L, info = potrf(F11, lower=True, overwrite_a=True, clean=False)
                if info != 0:
                    raise SingularMatrix(f"W of {len(self.contacts)} held contacts is not positive definite")
                if b:
                    F21 = self._trsm(1.0, L, F21, side=1, lower=True, trans_a=True, overwrite_b=True)
                    F22 = syrk(-1.0, F21, 1.0, F22, lower=True, overwrite_c=True)
                pivots.append(L.diagonal().astype(float) ** 2)
                self._fronts.append((slice(d * begin, d * (begin + n)), dofs_of(beyond, d), L, F21))
            assembly.pass_on(F22)
        every = np.concatenate(pivots)
        self.conditioning = float(every.min() / every.max()) if len(every) else 1.0

    def forward(self, X: FloatArray) -> FloatArray:
        """Overwrite X (n, k), in C order, with L^-1 X and return it; columns that are zero so far cost nothing."""
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
        for own, border, L, F21 in reversed(self._fronts):
            x[own] = self._trsv(L, x[own] - F21.T @ x[border], lower=True, trans=True)
        return x
