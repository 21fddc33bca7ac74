"""The symbolic elimination of a block-sparse matrix: in which order contacts go, in which fronts, and what each leaves to which.

One analysis serves both numeric codes, `fronts` (joints of many contacts: LAPACK on large fronts) and `block_factors` (contacts of small
bodies: compiled, small fronts):

1. Contacts with one set of neighbours form a joint (two bodies' contacts with each other mostly): what fill-in depends on is the graph of
   the joints, so that no single unknown is ordered.
2. That graph is ordered by multiple minimum degree, its elimination tree brought into postorder, and columns of nearly equal structure
   are taken together as fronts.
3. Joints are written out as their contacts again.

Contacts that are to go last, since other matrices meet there, are left out of the ordering and put behind it.

Sources: A. George, J. W. H. Liu, SIAM Review 31, 1989 (minimum degree, indistinguishable nodes); J. W. H. Liu, SIAM Review 34, 1992
(elimination trees, fronts); T. A. Davis, Direct Methods for Sparse Linear Systems, SIAM, 2006 (structure of the factor).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.linear import _elimination_tree_kernels as kernels


@dataclass(frozen=True, eq=False)
class EliminationTree:
    """Fronts in postorder: children before parents, subtrees without gaps.

    order  (nc,) contacts as they are eliminated
    first  (fronts + 1,) where each front's own contacts begin in `order`
    starts (fronts + 1,) where each front's border begins in `rows`: the places in `order`, ascending, that its complement falls on
    parent (fronts,) the front that takes the complement, -1 where there is none
    """

    order: IntArray
    first: IntArray
    starts: IntArray
    rows: IntArray
    parent: IntArray

    def __len__(self) -> int:
        return len(self.parent)

    def __iter__(self) -> Iterator[tuple[IntArray, IntArray, int]]:
        """Each front's own contacts, its border's, both as they are eliminated, and its parent."""
        border = self.order[self.rows]
        for f, parent in enumerate(self.parent.tolist()):
            yield self.order[self.first[f] : self.first[f + 1]], border[self.starts[f] : self.starts[f + 1]], parent

    def flops(self, d: int) -> float:
        """Operations of an LU elimination of all contacts with d unknowns each."""
        n, b = d * np.diff(self.first).astype(float), d * np.diff(self.starts).astype(float)
        return float(np.sum(2 / 3 * n**3 + 2 * n * n * b + 2 * n * b * b))


def elimination_tree(indptr: IntArray, indices: IntArray, padding: float, last: BoolArray | None = None) -> EliminationTree:
    """Analyse a block pattern (rows `indptr`, columns `indices`) that is symmetric.

    padding: share of zeros that a front may hold for the sake of fewer, larger ones; last (nc,): contacts that no other one follows on
    its way to the root.
    """
    joint, size = joints(indptr, indices, last)
    pattern = kernels.quotient(indptr, indices, joint, len(size))
    order = minimum_degree(*pattern)
    if last is None:
        return _tree(pattern, joint, size, order, padding)
    behind = np.bincount(joint, weights=last) > 0  # ordered with the others, or without them: which has less fill the graph decides
    orders = np.concatenate([order[~behind[order]], order[behind[order]]]), _others_first(pattern[0], pattern[1], behind)
    return min((_tree(pattern, joint, size, order, padding) for order in orders), key=lambda tree: tree.flops(1))


def _tree(pattern: tuple[IntArray, IntArray], joint: IntArray, size: IntArray, order: IntArray, padding: float) -> EliminationTree:
    """The fronts where joints go in this order, or in one of the same fill."""
    order = order[kernels.postorder(kernels.elimination_tree(*pattern, order))]
    parent = kernels.elimination_tree(*pattern, order)
    starts, rows = kernels.column_structure(*pattern, order, parent)
    size = size[order]
    first = kernels.fronts(parent, starts, rows, size, padding)
    last = first[1:] - 1  # the column of a front whose rows are its border
    front = np.repeat(np.arange(len(last)), np.diff(first))  # of a column
    above = parent[last]
    place = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(size)])  # of a column's contacts in the order of contacts
    border = rows[_ranges(starts[last], starts[last + 1])]
    counts = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(size[border])])
    columns = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(starts[last + 1] - starts[last])])
    return EliminationTree(
        order=np.argsort(np.argsort(order)[joint], kind="stable"),
        first=place[first],
        starts=counts[columns],
        rows=_ranges(place[border], place[border + 1]),
        parent=np.where(above >= 0, front[above], -1),
    )


def _ranges(begin: IntArray, end: IntArray) -> IntArray:
    """begin[0], ..., end[0] - 1, begin[1], ..., end[1] - 1, ..."""
    length = end - begin
    return np.repeat(begin - np.cumsum(length) + length, length) + np.arange(int(length.sum()))


def _signatures(indptr: IntArray, indices: IntArray) -> NDArray[np.uint64]:
    """A number (nc,) for each set of neighbours: the sum of their random weights modulo 2^64."""
    weight = np.random.default_rng(0).integers(2**63, size=len(indptr) - 1, dtype=np.uint64)
    total = np.concatenate([np.zeros(1, dtype=np.uint64), np.cumsum(weight[indices])])
    return total[indptr[1:]] - total[indptr[:-1]]


def joint_count(indptr: IntArray, indices: IntArray) -> int:
    """Number of joints."""
    return len(np.unique(_signatures(indptr, indices)))


def joints(indptr: IntArray, indices: IntArray, apart: BoolArray | None = None) -> tuple[IntArray, IntArray]:
    """The joint (nc,) of each contact, contacts with one set of neighbours, and the number of contacts of each joint, by first contact;
    apart (nc,): contacts that are in no joint with others."""
    signature = _signatures(indptr, indices)
    if apart is not None:
        signature[apart] ^= np.uint64(2**63)  # no weight has this bit: sums of other sets may, as seldom as they are equal
    _, first, joint, size = np.unique(signature, return_index=True, return_inverse=True, return_counts=True)
    by_contact = np.argsort(first)
    number = np.empty_like(by_contact)
    number[by_contact] = np.arange(len(first))
    return number[joint], size[by_contact]


def _others_first(indptr: IntArray, indices: IntArray, last: BoolArray) -> IntArray:
    """`minimum_degree` of the rows that are not last, then those that are."""
    others = np.flatnonzero(~last)
    graph = sp.csr_array((np.ones(len(indices)), indices, indptr), shape=(len(last), len(last)))[others][:, others]
    return np.concatenate([others[minimum_degree(graph.indptr, graph.indices)], np.flatnonzero(last)])


def minimum_degree(indptr: IntArray, indices: IntArray) -> IntArray:
    """The rows of a symmetric pattern in an order of little fill, by SuperLU's multiple minimum degree."""
    n = len(indptr) - 1
    if n < 2:
        return np.arange(n)
    row = np.repeat(np.arange(n), np.diff(indptr))
    graph = sp.csc_matrix((np.where(row == indices, 2.0 * n, 1.0), indices, indptr), shape=(n, n))
    # an incomplete factorisation that drops everything off the diagonal: SuperLU's ordering without its elimination
    options = {"SymmetricMode": True, "Equil": False}
    factor = spla.spilu(graph, 1.0, 1.0, "basic", "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    permutation: FloatArray = factor.perm_c
    return np.argsort(permutation)
