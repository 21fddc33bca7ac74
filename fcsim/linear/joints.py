"""W by block rows with the elimination tree of its contacts, and whether they come in joints that make fronts worth their overhead.

Contacts of one joint (the same pair of bodies) are coupled with the same contacts; there are many to a joint of deformable bodies.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray, Matrix
from fcsim.linear._block_rows_kernels import block_rows_of_dense
from fcsim.linear._elimination_tree_kernels import has_symmetric_pattern
from fcsim.linear.block_rows import product_by_rows
from fcsim.linear.elimination_tree import EliminationTree, elimination_tree, joint_count
from fcsim.linear.factors import SingularMatrix
from fcsim.linear.late.late_rows import LateRows, in_blocks
from fcsim.linear.sparse.short_indices import with_short_indices

FRONTS_FROM, JOINT, SAVING = 600, 6, 0.2
"""Contact unknowns from which, contacts a joint in the mean from which, and flops over m^3 up to which fronts are worth their overhead."""
PADDING = 0.08
"""Share of zeros in a front: they are large, so that operations count (a tenth fewer on walls than with 0.15)."""


@dataclass(frozen=True, eq=False)
class Pattern:
    """The pattern of block rows with its elimination tree, which serves every W that has it."""

    indptr: IntArray
    indices: IntArray
    tree: EliminationTree

    def is_that_of(self, rows: sp.bsr_array) -> bool:
        """Whether block rows (bsr) have this pattern."""
        same = rows.indices is self.indices or np.array_equal(rows.indices, self.indices)
        return same and np.array_equal(rows.indptr, self.indptr)


class BlockRows:
    """W by sorted block rows with the elimination tree of its pattern; SingularMatrix where the pattern is not symmetric."""

    def __init__(self, W: Matrix, d: int, earlier: Pattern | None = None, last: BoolArray | None = None) -> None:
        """W: dense or sparse; earlier: where W has this pattern, it is not analysed again; last (nc,): see `elimination_tree`."""
        if isinstance(W, np.ndarray):
            indptr, indices, blocks = block_rows_of_dense(W, d)
            rows = with_short_indices(sp.bsr_array((blocks, indices, indptr), shape=W.shape))
        else:
            rows = in_blocks(W, d)
            if not rows.has_sorted_indices:
                rows = rows.copy() if rows is W or rows.data is W.data else rows
                rows.sort_indices()
        self.W = rows
        self.indptr, self.indices = rows.indptr, rows.indices
        if earlier is not None and earlier.is_that_of(rows):
            self.pattern = earlier
            return
        if not has_symmetric_pattern(self.indptr, self.indices):
            raise SingularMatrix("the pattern of W is not symmetric")
        self.pattern = Pattern(self.indptr, self.indices, elimination_tree(self.indptr, self.indices, PADDING, last))

    @property
    def blocks(self) -> FloatArray:
        return self.W.data

    @property
    def tree(self) -> EliminationTree:
        return self.pattern.tree

    def product(self, x: FloatArray) -> FloatArray:
        """W x (m,); contacts where x is zero cost next to nothing."""
        if isinstance(self.W, LateRows):
            return self.W.affine(x, np.zeros_like(x))
        if self.blocks.shape[1] != 3:
            Wx: FloatArray = self.W @ x
            return Wx
        return product_by_rows(self.W, np.zeros_like(x), x)


def joint_rows(W: Matrix, d: int, earlier: Pattern | None = None) -> BlockRows | None:
    """Sparse W by block rows where its contacts come in joints that leave most of a dense elimination's work out, else None."""
    if isinstance(W, np.ndarray) or W.shape[0] < FRONTS_FROM:
        return None
    rows = in_blocks(W, d)
    if earlier is not None and earlier.is_that_of(rows):
        return BlockRows(rows, d, earlier)
    nc = rows.shape[0] // d
    if len(rows.indices) < JOINT * nc or joint_count(rows.indptr, rows.indices) * JOINT > nc:
        return None
    try:
        joined = BlockRows(rows, d)
    except SingularMatrix:
        return None
    return joined if joined.tree.flops(d) <= SAVING * (nc * d) ** 3 else None
