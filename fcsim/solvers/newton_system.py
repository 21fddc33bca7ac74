"""Newton's linear system (A W + B) dr = rhs, with A and B block diagonal (nc, d, d), by dense, condensed or sparse elimination.

A contact that opens has A = 0 and B = 1: its dr is known and its rows and columns leave the system before any factorisation.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.linear import DenseLU, SingularMatrix, factorise

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


class NewtonSystem(Protocol):
    """Solves (A W + B) dr = rhs (m,) for one W and changing A, B."""

    def __init__(self, W: Any, dimension: int) -> None: ...

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> FloatArray: ...


def _dofs(contacts: IntArray, d: int) -> IntArray:
    return (contacts[:, None] * d + np.arange(d)).ravel()


def _without_open(W: Any, A: FloatArray, rhs: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
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

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> FloatArray:
        d = self._d
        active, rhs, dr = _without_open(self._W, A, rhs)
        k = len(active)
        if k:
            dofs = _dofs(active, d)
            J = (A[active] @ self._W[np.ix_(dofs, dofs)].reshape(k, d, k * d)).reshape(k * d, k * d)
            own = np.arange(k)
            J.reshape(k, d, k, d)[own, :, own, :] += B[active]
            # the transpose of a C-ordered matrix is what LAPACK can overwrite without a copy
            lu, pivots, info = sla.lapack.dgetrf(J.T, overwrite_a=True)
            if info != 0:
                raise SingularMatrix(f"Newton's matrix of size {k * d} is singular: zero pivot {info}")
            solution, _ = sla.lapack.dgetrs(lu, pivots, rhs.ravel(), trans=1)
            dr[active] = solution.reshape(k, d)
        return dr.ravel()


class CondensedSystem:
    """Elimination of the sticking contacts, whose rows u_a + (W dr)_a = 0 do not change while they stick.

    With S the held contacts and C the other active ones, dr_S = -W_SS^-1 (u_S + W_SC dr_C), and the small system on C takes the
    Schur complement W_CC - W_CS W_SS^-1 W_SC in the place of W. The Cholesky factor L of W_SS and L^-1 W_SC stay valid as long as
    the held contacts stick; a contact that has let go once in a solve is never held again, so that sets change rarely.
    The result is the exact Newton step. W must be symmetric; where W_SS is not positive definite the dense LU takes over.
    """

    def __init__(self, W: FloatArray, dimension: int) -> None:
        self._W, self._d = W, dimension
        self._dense = DenseSystem(W, dimension)
        nc = W.shape[0] // dimension
        self._fickle = np.zeros(nc, dtype=bool)
        self._held: IntArray | None = None
        self._symmetric = bool(np.allclose(W, W.T, rtol=0, atol=1e-10 * np.abs(W).max(initial=0.0)))
        self._column = np.full(nc, -1)  # where a free contact's columns stand in _Y

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> FloatArray:
        stick = ~np.any(B, axis=(1, 2))
        if not self._symmetric or not stick.any():
            return self._dense.solve(A, B, rhs)
        if self._held is None or not stick[self._held].all():
            if self._held is not None:
                self._fickle[self._held[~stick[self._held]]] = True
            try:
                self._hold(np.flatnonzero(stick & ~self._fickle))
            except SingularMatrix:
                self._held = None
                return self._dense.solve(A, B, rhs)
        elif np.count_nonzero(stick & ~self._fickle) > len(self._held) + 0.2 * len(stick):
            self._hold(np.flatnonzero(stick & ~self._fickle))
        return self._condensed(A, B, rhs)

    def _hold(self, held: IntArray) -> None:
        d = self._d
        self._held = held
        self._held_dofs = _dofs(held, d)
        W_SS = self._W[np.ix_(self._held_dofs, self._held_dofs)]
        factor, info = sla.lapack.dpotrf(W_SS, lower=True, overwrite_a=True, clean=False)
        if info != 0:
            raise SingularMatrix(f"W of {len(held)} sticking contacts is not positive definite")
        self._L = factor
        self._column[:] = -1
        self._Y = np.empty((len(self._held_dofs), 0), order="F")
        self._free = np.empty(0, dtype=np.int64)
        self._schur = np.empty((0, 0))

    def _extend(self, contacts: IntArray) -> None:
        """Bring more free contacts into the Schur complement."""
        d = self._d
        new = contacts[self._column[contacts] < 0]
        if not len(new):
            return
        dofs = _dofs(new, d)
        Y, _ = sla.lapack.dtrtrs(self._L, np.asfortranarray(self._W[np.ix_(self._held_dofs, dofs)]), lower=True, overwrite_b=True)
        old_dofs, k = _dofs(self._free, d), len(self._free) * d
        schur = np.empty((k + len(dofs), k + len(dofs)))
        schur[:k, :k] = self._schur
        schur[k:, :k] = self._W[np.ix_(dofs, old_dofs)] - Y.T @ self._Y
        schur[:k, k:] = schur[k:, :k].T
        schur[k:, k:] = self._W[np.ix_(dofs, dofs)] - Y.T @ Y
        self._schur = schur
        self._Y = np.concatenate([self._Y, Y], axis=1)
        self._column[new] = len(self._free) + np.arange(len(new))
        self._free = np.concatenate([self._free, new])

    def _condensed(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> FloatArray:
        d, held = self._d, self._held
        assert held is not None
        active, reduced, dr = _without_open(self._W, A, rhs)
        is_held = np.zeros(len(A), dtype=bool)
        is_held[held] = True
        free_place = np.flatnonzero(~is_held[active])
        held_place = np.flatnonzero(is_held[active])  # held is sorted, and so is active
        target = np.linalg.solve(A[held], reduced[held_place][:, :, None])  # (W dr)_a of the held contacts
        z, _ = sla.lapack.dtrtrs(self._L, target.reshape(-1), lower=True)
        free = active[free_place]
        if len(free):
            self._extend(free)
            k = len(free)
            columns = _dofs(self._column[free], d)
            known = (self._Y.T @ z)[columns].reshape(k, d)  # W_CS W_SS^-1 target
            right = reduced[free_place] - np.einsum("aij,aj->ai", A[free], known)
            J = (A[free] @ self._schur[np.ix_(columns, columns)].reshape(k, d, k * d)).reshape(k * d, k * d)
            own = np.arange(k)
            J.reshape(k, d, k, d)[own, :, own, :] += B[free]
            dr_free = DenseLU(J).solve(right.ravel())
            dr[free] = dr_free.reshape(k, d)
            expanded = np.zeros(self._Y.shape[1])
            expanded[columns] = dr_free
            z = z - self._Y @ expanded
        x, _ = sla.lapack.dtrtrs(self._L, z, lower=True, trans=1)
        dr[held] = x.reshape(-1, d)
        return dr.ravel()


class SparseSystem:
    """Sparse LU (MUMPS where petsc4py is there, SuperLU otherwise) of A W + B on the active contacts, for block-sparse W."""

    def __init__(self, W: Any, dimension: int) -> None:
        self._W, self._d = sp.bsr_array(W, blocksize=(dimension, dimension)), dimension

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> FloatArray:
        d = self._d
        active, rhs, dr = _without_open(self._W, A, rhs)
        k = len(active)
        if k:
            dofs = _dofs(active, d)
            W = sp.csr_array(self._W)[dofs][:, dofs]
            block_diagonal = sp.bsr_array((A[active], np.arange(k), np.arange(k + 1)), shape=(k * d, k * d), blocksize=(d, d))
            shift = sp.bsr_array((B[active], np.arange(k), np.arange(k + 1)), shape=(k * d, k * d), blocksize=(d, d))
            dr[active] = factorise(sp.csr_array(block_diagonal @ W + shift)).solve(rhs.ravel()).reshape(k, d)
        return dr.ravel()


SYSTEMS: dict[str, type[NewtonSystem]] = {"dense": DenseSystem, "condensed": CondensedSystem, "sparse": SparseSystem}
