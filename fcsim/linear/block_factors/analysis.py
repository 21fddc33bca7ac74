"""What the pattern of a block-sparse matrix alone decides of its factors."""

from __future__ import annotations

import threading
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import IntArray
from fcsim.linear.block_factors._lu_kernels import mirrored
from fcsim.linear.block_factors._single_factor_kernels import planned
from fcsim.linear.elimination_tree import elimination_tree

Plan = tuple[IntArray, IntArray, IntArray, IntArray, IntArray, IntArray, int]
"""Of `_single_factor_kernels.planned`."""
PADDING = 0.15
"""Share of zeros in a front: they are small, so that their number counts."""


class Analysis:
    """What the pattern of a matrix alone decides: the elimination tree and where the fronts' panels, own columns with all rows, begin.

    flops: operations of an LU (twice those of the Cholesky factor); entries: those of the factor.
    """

    def __init__(self, A: sp.bsr_array) -> None:
        """A (m, m) symmetric, by square blocks (bsr), every diagonal block stored; of two mirror images the values of one are read."""
        self.indptr, self.indices = A.indptr.astype(np.int64), A.indices.astype(np.int64)
        self.size, self.dimension = A.shape[0], A.blocksize[0]
        tree = elimination_tree(self.indptr, self.indices, PADDING)
        own, border = self.dimension * np.diff(tree.first), self.dimension * np.diff(tree.starts)
        self.offsets = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(own * (own + border))])
        self.flops, self.entries = tree.flops(self.dimension), int(self.offsets[-1])  # of an LU; of the factor
        self.fronts = tree.order, tree.first, tree.starts, tree.rows, self.offsets

    @cached_property
    def mirror(self) -> IntArray:
        """For each entry (a, b) the place of (b, a), where rows are sorted and the pattern is symmetric."""
        return mirrored(self.indptr, self.indices)

    @cached_property
    def plan(self) -> Plan:
        """`planned` of a matrix of single unknowns."""
        order, first, starts, rows, _ = self.fronts
        found: Plan = planned(self.indptr, self.indices, self.mirror, order, first, starts, rows)
        return found


_RECENT, _UP_TO = 4, 300_000
_recent: dict[tuple[bytes, bytes], Analysis] = {}
_changing = threading.Lock()


def analysed(indptr: IntArray, indices: IntArray) -> Analysis:
    """The analysis of a pattern of single unknowns, sorted rows with their diagonal; one of the last few patterns is not analysed anew: as
    long as the same bodies touch, the problems of all steps have one. (A large pattern is not kept: its memory is another's.)"""
    key = (indptr.tobytes(), indices.tobytes()) if len(indices) <= _UP_TO else None
    known = None if key is None else _recent.get(key)
    if known is None:
        n = len(indptr) - 1
        known = Analysis(sp.bsr_array((np.ones((len(indices), 1, 1)), indices, indptr), shape=(n, n)))
        if key is not None:
            with _changing:
                while len(_recent) >= _RECENT:
                    del _recent[next(iter(_recent))]
                _recent[key] = known
    return known
