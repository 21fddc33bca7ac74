"""Joints of contacts: W by block rows with the elimination tree on the graph of the joints, the symbolic part of `multifrontal`.

Contacts of one joint (the same pair of bodies) are coupled with the same contacts, so the graph that fill-in depends on has a vertex for
each joint and an edge for each two joints of a body. It is ordered by minimum degree in milliseconds, since no unknown is ever seen.

Sources: J. W. H. Liu, SIAM Review 34, 1992 (elimination trees); A. George, J. W. H. Liu, SIAM Review 31, 1989 (minimum degree,
indistinguishable nodes).
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.arrays import FloatArray, IntArray
from fcsim.linear._block_rows_kernels import block_rows_of_dense, product
from fcsim.linear._front_kernels import has_symmetric_pattern
from fcsim.linear.factors import SingularMatrix

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
        self.tree: EliminationTree
        if previous is not None and previous.has_pattern(self.indptr, self.indices):
            self.tree = previous.tree
            return
        if not has_symmetric_pattern(self.indptr, self.indices):
            raise SingularMatrix("the pattern of W is not symmetric")
        self.tree = EliminationTree(self.indptr, self.indices)

    def product(self, x: FloatArray) -> FloatArray:
        """W x (m,); contacts where x is zero cost next to nothing."""
        if self.blocks.shape[1] != 3:
            return self.W @ x
        blocks = x.reshape(-1, 3)
        return product(self.indptr, self.indices, self.blocks, np.zeros_like(blocks), blocks).ravel()

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
