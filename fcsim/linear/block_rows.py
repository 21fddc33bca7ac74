"""W by block rows of (3, 3), the storage of Gauss-Seidel sweeps, from whatever storage a problem has; 2D problems are embedded."""

from __future__ import annotations

from functools import partial

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray, Matrix
from fcsim.linear._block_rows_kernels import block_rows_of_columns, block_rows_of_dense, block_rows_of_rows, product, rows_of_product
from fcsim.threads import pieces_by_work, side_by_side

BLOCKS_A_PIECE = 20_000
"""Of rows of W that one thread multiplies: a megabyte, a tenth of a millisecond."""


def product_by_rows(W: sp.bsr_array, q: FloatArray, r: FloatArray) -> FloatArray:
    """u = W r + q (m,) for block rows (bsr) of (3, 3), by pieces of rows side by side: twice as quick as SciPy's for any block."""
    q, r = np.ascontiguousarray(q).reshape(-1, 3), np.ascontiguousarray(r).reshape(-1, 3)
    if len(W.indices) < 2 * BLOCKS_A_PIECE:
        return product(W.indptr, W.indices, W.data, q, r).ravel()
    u = np.empty_like(q)
    ranges = pieces_by_work(W.indptr, BLOCKS_A_PIECE)
    side_by_side([partial(rows_of_product, W.indptr, W.indices, W.data, q, r, begin, end, u) for begin, end in ranges])
    return u.ravel()


def compressed_blocks(W: Matrix, dimension: int) -> tuple[IntArray, IntArray, FloatArray]:
    """Return W by block rows: indptr (nc + 1,), block columns, blocks (nnz, d, d); blocks of zeros are left out of a dense W.

    Block rows that W has already are not copied.
    """
    d = dimension
    if isinstance(W, np.ndarray):
        return block_rows_of_dense(np.ascontiguousarray(W), d)
    if W.format == "bsr":
        W = W if W.blocksize == (d, d) else sp.bsr_array(W, blocksize=(d, d))
        return W.indptr.astype(np.int64), W.indices.astype(np.int64), np.ascontiguousarray(W.data)
    if W.format == "csc":
        return block_rows_of_columns(W.indptr, W.indices, W.data, d)
    W = W if W.format == "csr" else sp.csr_array(W)
    return block_rows_of_rows(W.indptr, W.indices, W.data, d)


def block_rows(W: Matrix, dimension: int) -> tuple[IntArray, IntArray, FloatArray]:
    """Return `compressed_blocks` with blocks (nnz, 3, 3).

    A 2D problem is embedded: its second tangent gets a unit compliance and no velocity, so its reaction stays zero.
    """
    indptr, column, blocks = compressed_blocks(W, dimension)
    if dimension == 2:
        row = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))
        embedded = np.zeros((len(blocks), 3, 3))
        embedded[:, :2, :2] = blocks
        embedded[row == column, 2, 2] = 1
        blocks = embedded
    return indptr, column, blocks


def embed_vector(x: FloatArray, dimension: int) -> FloatArray:
    """Return flat x (m,) as (nc, 3), a zero second tangent added in 2D."""
    if dimension == 3:
        return x.reshape(-1, 3).copy()
    rows = np.zeros((len(x) // dimension, 3))
    rows[:, :dimension] = x.reshape(-1, dimension)
    return rows


def embed_blocks(W: FloatArray) -> FloatArray:
    """Return one-contact matrices (nc, d, d) as (nc, 3, 3), a unit second tangent added in 2D."""
    d = W.shape[1]
    if d == 3:
        return np.ascontiguousarray(W)
    blocks = np.zeros((len(W), 3, 3))
    blocks[:, :d, :d] = W
    if d == 2:
        blocks[:, 2, 2] = 1
    return blocks


def dofs_of(contacts: IntArray, d: int) -> IntArray:
    """The rows (d k,) of contacts (k,) in W."""
    return (contacts[:, None] * d + np.arange(d)).ravel()
