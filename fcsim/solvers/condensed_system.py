"""Newton's linear system by condensation: what does not change between iterations and steps is eliminated once."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.linear import SingularMatrix, is_symmetric
from fcsim.solvers._front_kernels import gather_blocks
from fcsim.solvers.krylov import gmres
from fcsim.solvers.multifrontal import BlockRows, MultifrontalCholesky, joint_rows
from fcsim.solvers.newton_system import DenseSystem, NewtonSystem, SparseSystem, dofs_of
from fcsim.solvers.normal_elimination import NormalElimination

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

FORCING = 1e-2
"""Defect, relative to the right-hand side, at which a Newton step by an earlier W's factor is accepted."""
INNER = 1e-2
"""The same for the border's system where such a step is only a preconditioner's."""
CORRECTIONS = 8
"""Iterations of GMRES with an earlier W's factor before factoring anew."""


def _dense_part(W: Any, d: int, rows: IntArray, columns: IntArray) -> FloatArray:
    """The blocks of W, dense or by block rows, of contacts `rows` and `columns` as a dense array in C order."""
    if isinstance(W, np.ndarray):
        return W[np.ix_(dofs_of(rows, d), dofs_of(columns, d))]
    part = np.zeros((d * len(rows), d * len(columns)))
    place = np.full(W.shape[0] // d, -1)
    place[columns] = np.arange(len(columns))
    gather_blocks(W.indptr, W.indices, W.data, rows, place, part)
    return part


class _DenseCholesky:
    """L L^T of a symmetric W on the held contacts, as `MultifrontalCholesky`."""

    def __init__(self, W: Any, d: int, held: BoolArray) -> None:
        self.contacts = np.flatnonzero(held)
        self._L, info = sla.lapack.dpotrf(_dense_part(W, d, self.contacts, self.contacts).T, lower=True, overwrite_a=True, clean=False)
        if info != 0:
            raise SingularMatrix(f"W of {len(self.contacts)} sticking contacts is not positive definite")

    def forward(self, X: FloatArray) -> FloatArray:
        """Overwrite X (n, k), in C order, with L^-1 X and return it."""
        return sla.blas.dtrsm(1.0, self._L, X.T, side=1, lower=True, trans_a=True, overwrite_b=True).T

    def backward(self, z: FloatArray) -> FloatArray:
        """Return L^-T z for z (n,)."""
        return sla.blas.dtrsv(self._L, z, lower=True, trans=True)


class CondensedSystem:
    """Elimination of what does not change between iterations: sticking contacts, then the normal rows of closed ones.

    S are the contacts held when W_SS = L L^T was factored, the border are all others met so far. A free contact a of the border has
    the unknown x_a = dr_a, a released one (it was held, but sticks no longer) the unknown x_a = (W dr)_a. With the columns
    P = L^-1 [W_SC, -E_R] of free (C) and released (R) contacts, z = L^-1 t and t the held contacts' W dr (0 at released ones),

        (W dr)_C = P_C^T z + (W_CC - P_C^T P_C) x_C - P_C^T P_R x_R,        dr_R = -P_R^T z + P_R^T P_C x_C + P_R^T P_R x_R.

    So a change of sets costs columns, not a factorisation; W_SS is factored anew only when the border has grown too large for that.
    The matrix of this response is kept; while the free contacts stay the same, `NormalElimination` keeps them shorter by a third.
    W must be symmetric; where W_SS is not positive definite the LU of the whole takes over. Of a sparse W whose contacts come in joints the
    factor is multifrontal, else dense. The step is Newton's to round-off until `follow` brings another W: then factor and columns belong
    to an earlier one and are the preconditioner of GMRES on the true system, down to a defect of FORCING ||rhs||; where that does not
    pay all is factored anew.
    """

    def __init__(self, W: Any, dimension: int) -> None:
        self._d = dimension
        self._rows: BlockRows | None = None
        self._factor: _DenseCholesky | MultifrontalCholesky | None = None
        self._set(W)
        self._symmetric: bool | None = None  # not looked at yet
        self._held: IntArray | None = None
        self._followed = False

    def _set(self, W: Any) -> None:
        """Take W, dense or as sparse rows, with what solves where the condensation cannot."""
        self._rows = None if isinstance(W, np.ndarray) else joint_rows(W, self._d, self._rows)
        self._W = W if isinstance(W, np.ndarray) else sp.bsr_array(W, blocksize=(self._d, self._d)) if self._rows is None else self._rows.W
        self._whole: NewtonSystem | None = None

    def _product(self, x: FloatArray) -> FloatArray:
        """W x (m,)."""
        return self._W @ x if self._rows is None else self._rows.product(x)

    def _solve_whole(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        if self._whole is None:
            self._whole = (DenseSystem if isinstance(self._W, np.ndarray) else SparseSystem)(self._W, self._d)
        return self._whole.solve(A, B, rhs)

    def follow(self, W: Any) -> bool:
        if self._held is None or W.shape != self._W.shape:
            return False
        self._set(W)
        self._followed, self._symmetric = True, None
        return True

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        stick = ~np.any(B, axis=(1, 2))
        if not stick.any():
            return self._solve_whole(A, B, rhs)
        try:
            if self._held is not None and self._followed:
                corrected = self._corrected(A, B, rhs, stick)
                if corrected is not None:
                    return corrected
                self._held = None
            if self._symmetric is None:
                self._symmetric = is_symmetric(self._W)
            if not self._symmetric:
                return self._solve_whole(A, B, rhs)
            if self._held is None or self._outgrown(stick):
                self._hold(stick)
            dr = self._condensed(A, B, rhs)
            return dr, self._product(dr)
        except SingularMatrix:
            self._held = None
            return self._solve_whole(A, B, rhs)

    def _corrected(self, A: FloatArray, B: FloatArray, rhs: FloatArray, stick: BoolArray) -> tuple[FloatArray, FloatArray] | None:
        """GMRES with an earlier W's factor and border as preconditioner; None where it does not pay."""
        if self._outgrown(stick):
            return None
        shape = rhs.shape
        images: list[FloatArray] = []  # W times the steps

        def product(x: FloatArray) -> FloatArray:
            images.append(self._product(x))
            Wx = images[-1].reshape(shape)
            return (np.einsum("aij,aj->ai", A, Wx) + np.einsum("aij,aj->ai", B, x.reshape(shape))).ravel()

        def precondition(x: FloatArray) -> FloatArray:
            return self._condensed(A, B, x.reshape(shape), INNER)

        try:
            found = gmres(product, precondition, rhs.ravel(), FORCING * float(np.linalg.norm(rhs)), CORRECTIONS)
        except SingularMatrix:
            return None
        if found is None:
            return None
        dr, y = found
        return dr, np.tensordot(y, images, 1) if len(y) else np.zeros_like(dr)

    def _outgrown(self, stick: BoolArray) -> bool:
        """Whether many border contacts stick, or were released: factoring anew then costs less than carrying them."""
        held = self._is_held
        released = np.count_nonzero(self._released | (held & ~stick))
        carried = int(np.count_nonzero(stick & ~held) + released)
        return bool(carried > 80 + 0.2 * np.count_nonzero(held))

    def _hold(self, held: BoolArray) -> None:
        """Factor W on the held contacts (nc,) and start with an empty border."""
        self._PT = self._response = np.empty((0, 0))  # the old ones make room for the new
        self._held, self._factor = None, None
        self._normals: NormalElimination | None = None
        d = self._d
        self._factor = _DenseCholesky(self._W, d, held) if self._rows is None else MultifrontalCholesky(self._rows, held)
        self._held = self._factor.contacts
        self._followed = False
        self._is_held = held
        self._place = np.full(len(held), -1)  # of a held contact in W_SS
        self._place[self._held] = np.arange(len(self._held))
        self._released = np.zeros(len(held), dtype=bool)
        self._border = np.empty(0, dtype=np.int64)
        self._column = np.full(len(held), -1)  # of a border contact in P
        # P^T and the response of ((W dr)_C, dr_R) to x, with room for columns to come
        self._PT = np.empty((0, d * len(self._held)))
        self._response = np.empty((0, 0))

    def _extend(self, contacts: IntArray) -> None:
        """Give the contacts columns in the border."""
        d = self._d
        new = contacts[self._column[contacts] < 0]
        if not len(new):
            return
        assert self._factor is not None
        released = self._is_held[new]
        self._released[new[released]] = True
        assert self._held is not None
        columns = np.ascontiguousarray(_dense_part(self._W, d, new, self._held).T)  # W_SC, as W is symmetric
        if released.any():
            own = dofs_of(np.flatnonzero(released), d)
            columns[:, own] = 0
            columns[dofs_of(self._place[new[released]], d), own] = -1
        P = self._factor.forward(columns)
        k, end = len(self._border) * d, (len(self._border) + len(new)) * d
        self._reserve(end)
        self._PT[k:end] = P.T
        response = self._response[:end, :end]
        if k:
            response[:k, k:] = self._PT[:k] @ P
            response[k:, :k] = response[:k, k:].T
        response[k:, k:] = P.T @ P  # by the symmetric product
        border = np.concatenate([self._border, new])
        free = np.flatnonzero(~self._released[border])
        rows, fresh, held = dofs_of(free, d), k + dofs_of(np.flatnonzero(~released), d), dofs_of(np.flatnonzero(self._released[border]), d)
        # signs of the class's formulas, on the new rows and columns only
        response[np.ix_(fresh, rows)] = _dense_part(self._W, d, new[~released], border[free]) - response[np.ix_(fresh, rows)]
        if k:
            old = rows[rows < k]
            response[np.ix_(old, fresh)] = response[np.ix_(fresh, old)].T
        if len(held):
            response[np.ix_(fresh, held)] *= -1
            response[np.ix_(rows[rows < k], held[held >= k])] *= -1
        self._column[new] = len(self._border) + np.arange(len(new))
        self._border = border
        self._normals = None

    def _reserve(self, columns: int) -> None:
        """Make room for so many columns of the border and half as many again."""
        have = len(self._PT)
        if columns <= have:
            return
        used, room = len(self._border) * self._d, columns + columns // 2
        PT, response = np.empty((room, self._PT.shape[1])), np.empty((room, room))
        PT[:used] = self._PT[:used]
        response[:used, :used] = self._response[:used, :used]
        self._PT, self._response = PT, response

    def _condensed(self, A: FloatArray, B: FloatArray, rhs: FloatArray, tolerance: float = 0.0) -> FloatArray:
        """The step by the factor and border that are there; tolerance: relative defect of the border's system, 0: round-off."""
        d, held = self._d, self._held
        assert held is not None and self._factor is not None
        open_contact = ~np.any(A, axis=(1, 2))
        open_free = open_contact & ~self._is_held  # an open contact that was held stays in the system as a released one
        dr = np.where(open_free[:, None], rhs, 0.0)
        coupling = self._product(dr.ravel()).reshape(-1, d) if np.any(dr) else np.zeros_like(rhs)
        sticking = ~np.any(B, axis=(1, 2))
        self._extend(np.flatnonzero(np.where(self._is_held, ~sticking, ~open_free)))
        kept = ~self._released[held]
        t = np.zeros((len(held), d))
        t[kept] = np.linalg.solve(A[held[kept]], rhs[held[kept]][:, :, None])[:, :, 0]
        t -= coupling[held]
        z = self._factor.forward(t.reshape(-1, 1))[:, 0]
        border = self._border[~open_free[self._border]]
        released = self._released[border]
        # Alart-Curnier's and Jean-Moreau's normal rows of a closed contact are (A_NN, 0, 0) and (0, 0, 0)
        whole = released | (A[border, 0, 0] == 0) | A[border, 0, 1:].any(axis=1) | B[border, 0].any(axis=1)
        closed, whole, released = border[~whole], border[whole], released[whole]
        if len(border):
            PT = self._PT[: d * len(self._border)]
            Pz = PT @ z
            known = coupling[closed] + Pz[dofs_of(self._column[closed], d)].reshape(-1, d)
            known_whole = Pz[dofs_of(self._column[whole], d)].reshape(-1, d)
            known_whole = np.where(released[:, None], -known_whole, coupling[whole] + known_whole)
            # a released contact's unknown is W dr and its response dr: A and B change places
            outer = np.where(released[:, None, None], B[whole], A[whole])
            inner = np.where(released[:, None, None], A[whole], B[whole])
            normals = self._normals
            if normals is None or not (np.array_equal(normals.closed, closed) and np.array_equal(normals.whole, whole)):
                normals = self._normals = NormalElimination(self._response, closed, whole, released, self._column, d)
            right = rhs[whole] - np.einsum("aij,aj->ai", outer, known_whole)
            x_closed, x_whole = normals.solve(
                A[closed], B[closed], rhs[closed], known, outer, inner, right, tolerance * float(np.linalg.norm(rhs))
            )
            expanded = np.zeros(len(PT))
            expanded[dofs_of(self._column[closed], d)] = x_closed.ravel()
            expanded[dofs_of(self._column[whole], d)] = x_whole.ravel()
            z = z - PT.T @ expanded
            dr[closed] = x_closed
            dr[whole[~released]] = x_whole[~released]
        dr[held] = self._factor.backward(z).reshape(-1, d)
        return dr.ravel()
