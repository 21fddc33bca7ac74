"""How W is stored for all stages: dense or in sorted block rows, as its size and density ask for."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from fcsim.linear.block_rows import compressed_blocks
from fcsim.problem import LocalProblem
from fcsim.problem.delassus import SMALL

SPARSE_BELOW = 0.15
"""Density of W below which sparse elimination is cheaper than dense."""


def entries(W: Any) -> int:
    """Entries of W that are not zero."""
    return int(np.count_nonzero(W.data if sp.issparse(W) else W))


def fitting_storage(problem: LocalProblem, count: int) -> LocalProblem:
    """Return the problem with W of `count` entries stored dense or in sorted block rows, converted once for all stages."""
    W, d = problem.W, problem.dimension
    sparse = problem.m > SMALL and count < SPARSE_BELOW * problem.m**2
    if sparse and sp.issparse(W) and W.format == "bsr":
        # a copy even of block rows: a factorisation would sort the caller's in place, and later products would differ in the last bits
        W = sp.bsr_array(W, blocksize=(d, d), copy=True)
        W.sort_indices()
    elif sparse:
        indptr, column, blocks = compressed_blocks(W, d)
        W = sp.bsr_array((blocks, column.astype(np.int32), indptr.astype(np.int32)), shape=W.shape)
    elif sp.issparse(W):
        W = W.toarray()
    if W is problem.W:
        return problem
    motion = None if problem.motion is None else problem.motion.stored_as(problem.W, W)
    return LocalProblem(W, problem.q, problem.mu, dimension=d, motion=motion)
