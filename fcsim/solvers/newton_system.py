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


def _is_symmetric(W: FloatArray) -> bool:
    """Whether W x = W^T x for a random x, to round-off: an asymmetry would have to be orthogonal to x to hide."""
    x = np.random.default_rng(0).standard_normal(len(W))
    Wx = W @ x
    return bool(float(np.linalg.norm(Wx - W.T @ x)) <= 1e-10 * float(np.linalg.norm(Wx)))


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
            dr[active] = DenseLU(J.T, overwrite=True).solve_transposed(rhs.ravel()).reshape(k, d)
        return dr.ravel()


class CondensedSystem:
    """Elimination of the sticking contacts, whose rows u_a + (W dr)_a = 0 do not change while they stick.

    S are the contacts held when W_SS = L L^T was factored, the border are all others met so far. A free contact a of the border has
    the unknown dr_a, a released one (it was held, but sticks no longer) the unknown s_a = (W dr)_a. With the columns
    P = L^-1 [W_SC, -E_R] of free (C) and released (R) contacts, z = L^-1 t and t the held contacts' W dr (0 at released ones),

        (W dr)_C = P_C^T z + (W_CC - P_C^T P_C) dr_C - P_C^T P_R s_R,        dr_R = -P_R^T z + P_R^T P_C dr_C + P_R^T P_R s_R,

    so a change of sets costs columns, not a factorisation; W_SS is factored anew only when the border has grown too large for that.
    The result is the exact Newton step. W must be symmetric; where W_SS is not positive definite the dense LU takes over.
    """

    def __init__(self, W: FloatArray, dimension: int) -> None:
        self._W, self._d = W, dimension
        self._dense = DenseSystem(W, dimension)
        self._symmetric = _is_symmetric(W)
        self._held: IntArray | None = None

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> FloatArray:
        stick = ~np.any(B, axis=(1, 2))
        if not self._symmetric or not stick.any():
            return self._dense.solve(A, B, rhs)
        try:
            if self._held is None or self._outgrown(stick):
                self._hold(np.flatnonzero(stick))
        except SingularMatrix:
            self._held = None
            return self._dense.solve(A, B, rhs)
        return self._condensed(A, B, rhs)

    def _outgrown(self, stick: BoolArray) -> bool:
        """Whether many border contacts stick, or were released: factoring anew then costs less than carrying them."""
        held = self._is_held
        released = np.count_nonzero(self._released | (held & ~stick))
        carried = int(np.count_nonzero(stick & ~held) + released)
        return bool(carried > 30 + 0.1 * np.count_nonzero(held))

    def _hold(self, held: IntArray) -> None:
        """Factor W on the held contacts and start with an empty border."""
        d, nc = self._d, len(self._W) // self._d
        dofs = _dofs(held, d)
        factor, info = sla.lapack.dpotrf(self._W[np.ix_(dofs, dofs)].T, lower=True, overwrite_a=True, clean=False)
        if info != 0:
            raise SingularMatrix(f"W of {len(held)} sticking contacts is not positive definite")
        self._L, self._held, self._held_dofs = factor, held, dofs
        self._is_held = np.zeros(nc, dtype=bool)
        self._is_held[held] = True
        self._place = np.full(nc, -1)  # of a held contact in W_SS
        self._place[held] = np.arange(len(held))
        self._released = np.zeros(nc, dtype=bool)
        self._border = np.empty(0, dtype=np.int64)
        self._column = np.full(nc, -1)  # of a border contact in P
        self._P = np.empty((len(dofs), 0), order="F")
        self._gram = np.empty((0, 0))  # P^T P, with W_CC - P_C^T P_C for pairs of free contacts

    def _extend(self, contacts: IntArray) -> None:
        """Give the contacts columns in the border."""
        d = self._d
        new = contacts[self._column[contacts] < 0]
        if not len(new):
            return
        released = self._is_held[new]
        self._released[new[released]] = True
        dofs = _dofs(new, d)
        columns = np.asfortranarray(self._W[np.ix_(self._held_dofs, dofs)])
        if released.any():
            own = _dofs(np.flatnonzero(released), d)
            columns[:, own] = 0
            columns[_dofs(self._place[new[released]], d), own] = -1
        P, _ = sla.lapack.dtrtrs(self._L, columns, lower=True, overwrite_b=True)
        k = len(self._border) * d
        gram = np.empty((k + len(dofs), k + len(dofs)))
        gram[:k, :k] = self._gram
        gram[k:, :k] = P.T @ self._P
        gram[k:, k:] = P.T @ P
        free_new = _dofs(np.flatnonzero(~released), d)
        old_free = np.flatnonzero(~self._released[self._border])
        free_old = _dofs(old_free, d)
        gram[np.ix_(k + free_new, free_old)] = (
            self._W[np.ix_(dofs[free_new], _dofs(self._border[old_free], d))] - gram[np.ix_(k + free_new, free_old)]
        )
        gram[:k, k:] = gram[k:, :k].T
        gram[np.ix_(k + free_new, k + free_new)] = (
            self._W[np.ix_(dofs[free_new], dofs[free_new])] - gram[np.ix_(k + free_new, k + free_new)]
        )
        self._gram = gram
        self._P = P if not k else np.concatenate([self._P, P], axis=1)
        self._column[new] = len(self._border) + np.arange(len(new))
        self._border = np.concatenate([self._border, new])

    def _condensed(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> FloatArray:
        d, held = self._d, self._held
        assert held is not None
        open_contact = ~np.any(A, axis=(1, 2))
        open_free = open_contact & ~self._is_held  # an open contact that was held stays in the system as a released one
        dr = np.where(open_free[:, None], rhs, 0.0)
        coupling = (self._W @ dr.ravel()).reshape(-1, d) if np.any(dr) else np.zeros_like(rhs)
        sticking = ~np.any(B, axis=(1, 2))
        self._extend(np.flatnonzero(np.where(self._is_held, ~sticking, ~open_free)))
        kept = ~self._released[held]
        t = np.zeros((len(held), d))
        t[kept] = np.linalg.solve(A[held[kept]], rhs[held[kept]][:, :, None])[:, :, 0]
        t -= coupling[held]
        z, _ = sla.lapack.dtrtrs(self._L, t.reshape(-1), lower=True)
        border = self._border[~open_free[self._border]]
        if len(border):
            k = len(border)
            columns = _dofs(self._column[border], d)
            gram = self._gram[np.ix_(columns, columns)].reshape(k, d, k, d)
            known = (self._P.T @ z)[columns].reshape(k, d)
            released = self._released[border]
            # rows: A (W dr) + B dr of a contact, with signs as in the class's formulas
            outer = np.where(released[:, None, None], B[border], A[border])
            inner = np.where(released[:, None, None], A[border], B[border])
            cross = np.where(released[:, None] == released[None, :], 1.0, np.where(released[:, None], 1.0, -1.0))
            J = (outer @ (gram * cross[:, None, :, None]).reshape(k, d, k * d)).reshape(k, d, k, d)
            own = np.arange(k)
            J[own, :, own, :] += inner
            # of a free contact (W dr)_a also holds what the open ones do; a released one's s_a likewise
            right = rhs[border] - np.einsum("aij,aj->ai", outer, np.where(released[:, None], -known, known + coupling[border]))
            unknown = DenseLU(J.reshape(k * d, k * d).T, overwrite=True).solve_transposed(right.ravel())
            expanded = np.zeros(self._P.shape[1])
            expanded[columns] = unknown
            z = z - self._P @ expanded
            free = border[~released]
            dr[free] = unknown.reshape(k, d)[~released]
        x, _ = sla.lapack.dtrtrs(self._L, z, lower=True, trans=1)
        dr[held] = x.reshape(-1, d)
        return dr.ravel()


class SparseSystem:
    """Sparse LU (MUMPS where petsc4py is there, SuperLU otherwise) of A W + B on the active contacts, for block-sparse W."""

    def __init__(self, W: Any, dimension: int) -> None:
        self._W, self._d = sp.csr_array(W), dimension

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> FloatArray:
        d = self._d
        active, rhs, dr = _without_open(self._W, A, rhs)
        k = len(active)
        if k:
            dofs = _dofs(active, d)
            W = self._W[dofs][:, dofs]
            block_diagonal = sp.bsr_array((A[active], np.arange(k), np.arange(k + 1)), shape=(k * d, k * d), blocksize=(d, d))
            shift = sp.bsr_array((B[active], np.arange(k), np.arange(k + 1)), shape=(k * d, k * d), blocksize=(d, d))
            dr[active] = factorise(sp.csr_array(block_diagonal @ W + shift)).solve(rhs.ravel()).reshape(k, d)
        return dr.ravel()


SYSTEMS: dict[str, type[NewtonSystem]] = {"dense": DenseSystem, "condensed": CondensedSystem, "sparse": SparseSystem}
