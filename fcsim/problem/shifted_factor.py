"""W + rho I and its factor: what splitting methods, eigenvalue estimates and proximal steps need of W.

Dense W by LAPACK; sparse W by fronts of single contacts (`BlockCholesky`), above many entries by MUMPS where petsc4py is there.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp

from fcsim.arrays import FloatArray, Matrix
from fcsim.linear._elimination_tree_kernels import has_symmetric_pattern
from fcsim.linear.block_factors.analysis import Analysis
from fcsim.linear.block_factors.cholesky import BlockCholesky
from fcsim.linear.block_rows import compressed_blocks
from fcsim.linear.factors import MUMPS_FROM, Factor, Mumps, SingularMatrix, SuperLU, factorise
from fcsim.runtime import has_petsc

COMPRESSED_FROM, COMPRESSION = 20_000, 1e-9
"""Unknowns from which W + rho I is factored by compressed blocks, and to which accuracy: a third of the time at 100 000."""


class ShiftedInverse:
    """(W + rho I)^-1 of a dense symmetric W: by its Cholesky factor, after some use by the inverse itself, a quicker product."""

    name = "dense Cholesky (LAPACK)"

    def __init__(self, A: FloatArray, patience: int = 40) -> None:
        self._factor, info = sla.lapack.dpotrf(A, lower=True, clean=False)
        if info != 0:
            raise SingularMatrix(f"matrix of size {len(A)} is not positive definite")
        self._patience = patience
        self._inverse: FloatArray | None = None

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Return A^-1 rhs."""
        if self._inverse is None and self._patience > 0:
            self._patience -= 1
            return sla.lapack.dpotrs(self._factor, rhs, lower=True)[0]
        if self._inverse is None:
            lower = np.tril(sla.lapack.dpotri(self._factor, lower=True)[0])
            self._inverse = lower + np.tril(lower, -1).T
        return self._inverse @ rhs


def plus_diagonal(W: Matrix, shift: FloatArray, d: int) -> Matrix:
    """Return W + diag(shift), shift (nc,) one number a contact: dense for a dense W, by block rows for a sparse one."""
    if isinstance(W, np.ndarray):
        shifted = W.copy()
        shifted.flat[:: len(W) + 1] += np.repeat(shift, d)
        return shifted
    if W.format == "bsr" and W.blocksize == (d, d):
        row = np.repeat(np.arange(len(W.indptr) - 1), np.diff(W.indptr))
        own = np.flatnonzero(row == W.indices)
        if np.array_equal(row[own], np.arange(len(W.indptr) - 1)):  # each diagonal block stands there once
            W = W.copy()
            W.data[own] += shift[:, None, None] * np.eye(d)
            return W
    return sp.bsr_array(sp.csr_array(W) + sp.diags_array(np.repeat(shift, d), format="csr"), blocksize=(d, d))


def complete_rows(W: Matrix, d: int) -> sp.bsr_array:
    """W by sorted block rows with every diagonal block, and with each block its mirror image; itself where it is so stored."""
    rows = W if not isinstance(W, np.ndarray) and W.format == "bsr" and W.blocksize == (d, d) else None
    if rows is None or not rows.has_canonical_format:
        csr = W if isinstance(W, np.ndarray) else sp.csr_array(W, copy=True)  # the caller's stays as it is
        if not isinstance(csr, np.ndarray):
            csr.sum_duplicates()
        indptr, column, blocks = compressed_blocks(csr, d)
        rows = sp.bsr_array((blocks, column, indptr), shape=W.shape)
        rows.sort_indices()
    nc = rows.shape[0] // d
    row = np.repeat(np.arange(nc), np.diff(rows.indptr))
    if np.count_nonzero(row == rows.indices) == nc and has_symmetric_pattern(rows.indptr, rows.indices):
        return rows
    own = np.arange(nc)
    places = np.unique(np.concatenate([row * nc + rows.indices, rows.indices.astype(np.int64) * nc + row, own * (nc + 1)]))
    blocks = np.zeros((len(places), d, d))
    blocks[np.searchsorted(places, row * nc + rows.indices)] = rows.data
    return sp.bsr_array((blocks, places % nc, np.searchsorted(places, np.arange(nc + 1) * nc)), shape=W.shape)


def shifted_factor(W: Matrix, d: int, rho: float, symmetric: bool, analysed: Callable[[], tuple[sp.bsr_array, Analysis]]) -> Factor:
    """The factor of W + rho I: Cholesky where symmetric and positive definite, LU otherwise; SingularMatrix where that fails.

    analysed: gives a sparse W by `complete_rows`, and the analysis of their pattern.
    """
    if isinstance(W, np.ndarray):
        shifted = W + rho * np.eye(len(W))
        if symmetric:
            try:
                return ShiftedInverse(shifted)
            except SingularMatrix:  # W slightly indefinite
                pass
        return factorise(shifted)
    # MUMPS pays off for many entries only, and its factors differ in the last bits from run to run
    many, shift = W.nnz > MUMPS_FROM and has_petsc(), np.full(W.shape[0] // d, rho)
    if symmetric:
        try:
            if many:
                compression = COMPRESSION if W.shape[0] > COMPRESSED_FROM else 0.0
                return Mumps(plus_diagonal(W, shift, d), positive_definite=True, compression=compression)
            rows, analysis = analysed()
            return BlockCholesky(analysis, rows.data, rho)
        except SingularMatrix:  # W slightly indefinite
            pass
    shifted = plus_diagonal(W, shift, d)
    return factorise(sp.csr_array(shifted)) if many else SuperLU(shifted, symmetric_pattern=True)
