"""Newton's linear system (A W + B) dr = rhs, with A and B block diagonal (nc, d, d), and its solution by dense or sparse LU.

A contact that opens has A = 0 and B = 1: its dr is known and its rows and columns leave the system before any factorisation.
What uses the structure of the contacts or an earlier factor is in `condensed_system` and `multifrontal_system`.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp

from fcsim import runtime
from fcsim.arrays import FloatArray, IntArray
from fcsim.linear.block_rows import dofs_of
from fcsim.linear.factors import MUMPS_FROM, DenseLU, Factor, Mumps, SuperLU


class NewtonSystem(Protocol):
    """Solves (A W + B) dr = rhs (nc, d) for one W and changing A, B."""

    def __init__(self, W: Any, dimension: int) -> None: ...

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return dr and W dr (m,); raises SingularMatrix."""
        ...

    def follow(self, W: Any) -> bool:
        """Go on with another W near the present one; False where nothing is kept that would serve."""
        ...


def without_open(W: Any, A: FloatArray, rhs: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the active contacts, their right-hand side and dr with the open contacts' part filled in."""
    d = A.shape[1]
    open_contact = ~np.any(A, axis=(1, 2))
    active = np.flatnonzero(~open_contact)
    dr = np.where(open_contact[:, None], rhs, 0.0)
    if np.any(dr):
        coupling = (W @ dr.ravel()).reshape(-1, d)
        rhs = rhs - np.einsum("aij,aj->ai", A, coupling)
    return active, rhs[active], dr


class DenseSystem:
    """LU of A W + B on the active contacts."""

    def __init__(self, W: FloatArray, dimension: int) -> None:
        self._W, self._d = W, dimension

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        d = self._d
        active, rhs, dr = without_open(self._W, A, rhs)
        k = len(active)
        if k:
            dofs = dofs_of(active, d)
            J = (A[active] @ self._W[np.ix_(dofs, dofs)].reshape(k, d, k * d)).reshape(k * d, k * d)
            own = np.arange(k)
            J.reshape(k, d, k, d)[own, :, own, :] += B[active]
            dr[active] = DenseLU(J.T, overwrite=True).solve_transposed(rhs.ravel()).reshape(k, d)
        return dr.ravel(), self._W @ dr.ravel()

    def follow(self, W: FloatArray) -> bool:
        return False


class SparseSystem:
    """Sparse LU of A W + B on the active contacts, for block-sparse W: SuperLU, or MUMPS for many entries where petsc4py is there."""

    def __init__(self, W: Any, dimension: int) -> None:
        self._W, self._d = sp.csr_array(W), dimension

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        d = self._d
        active, rhs, dr = without_open(self._W, A, rhs)
        k = len(active)
        if k:
            dofs = dofs_of(active, d)
            W = self._W[dofs][:, dofs]
            block_diagonal = sp.bsr_array((A[active], np.arange(k), np.arange(k + 1)), shape=(k * d, k * d), blocksize=(d, d))
            shift = sp.bsr_array((B[active], np.arange(k), np.arange(k + 1)), shape=(k * d, k * d), blocksize=(d, d))
            J = sp.csr_array(block_diagonal @ W + shift)
            factor: Factor = Mumps(J) if J.nnz > MUMPS_FROM and runtime.has_petsc() else SuperLU(J, symmetric_pattern=True)
            dr[active] = factor.solve(rhs.ravel()).reshape(k, d)
        return dr.ravel(), self._W @ dr.ravel()

    def follow(self, W: Any) -> bool:
        return False
