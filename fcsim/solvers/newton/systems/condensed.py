"""Newton's linear system by condensation: what does not change between iterations and steps is eliminated once."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.linear._front_kernels import gather_blocks
from fcsim.linear.block_rows import dofs_of
from fcsim.linear.factors import SingularMatrix, is_symmetric
from fcsim.linear.fronts import MultifrontalCholesky
from fcsim.linear.joints import BlockRows, joint_rows
from fcsim.linear.krylov import gmres
from fcsim.solvers.newton.systems.border import BorderSystem, split_known
from fcsim.solvers.newton.systems.direct import DenseSystem, NewtonSystem, SparseSystem
from fcsim.solvers.newton.systems.multifrontal import MultifrontalSystem

FORCING = 1e-2
"""Defect, relative to the right-hand side, at which a Newton step by an earlier W's factor is accepted."""
INNER = 2e-3
"""The same for the border's system where such a step is a preconditioner's."""
ACCURACY = 1e-4
"""Defect at which a step by this W's factor in single precision is accepted."""
SINGLE_FROM = 1500
"""Contact unknowns from which factor and border are kept in single precision."""
WELL_CONDITIONED, WELL_CONDITIONED_SINGLE = 1e-8, 1e-5
"""Least pivot over the largest from which the factor on all closed contacts is trusted; rank-deficient W gives round-off, 1e-16 or 1e-7."""
UNSETTLED, FEW_SLIDE = 0.05, 0.25
"""Share of the contacts whose status changes from step to step above which a factor to be held would not last: the fronts' LU is cheaper.
At first, share of the closed contacts that may slide: a cold start has more, a warm one less."""
BORDER_UP_TO = 2e9
"""Bytes of the border's columns up to which it is carried: a wall of a thousand bricks would have more."""
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

    def __init__(self, W: Any, d: int, held: BoolArray, dtype: Any = np.float64) -> None:
        self.contacts = np.flatnonzero(held)
        self._trsm, self._trsv = sla.blas.get_blas_funcs(("trsm", "trsv"), dtype=dtype)
        L, info = sla.lapack.dpotrf(_dense_part(W, d, self.contacts, self.contacts).T, lower=True, overwrite_a=True, clean=False)
        if info != 0:
            raise SingularMatrix(f"W of {len(self.contacts)} held contacts is not positive definite")
        self.conditioning = float(np.min(L.diagonal()) / np.max(L.diagonal())) ** 2
        self._L = L.astype(dtype, copy=False)

    def forward(self, X: FloatArray) -> FloatArray:
        """Overwrite X (n, k), in C order, with L^-1 X and return it."""
        return self._trsm(1.0, self._L, X.T, side=1, lower=True, trans_a=True, overwrite_b=True).T

    def backward(self, z: FloatArray) -> FloatArray:
        """Return L^-T z for z (n,)."""
        return self._trsv(self._L, z, lower=True, trans=True)


class CondensedSystem:
    """Elimination of what does not change between iterations: closed contacts, of which sliding ones are released again.

    S are the contacts held when W_SS = L L^T was factored: all that were closed. The border are those met since then that do not stick:
    a released contact a (held, but sliding or open now) has the unknown x_a = (W dr)_a, a free one (not held, but closed now) the unknown
    x_a = dr_a. With the columns P = L^-1 [W_SC, -E_R] of free (C) and released (R) contacts, z = L^-1 t and t the held contacts' W dr
    (0 at released ones),

        (W dr)_C = P_C^T z + (W_CC - P_C^T P_C) x_C - P_C^T P_R x_R,        dr_R = -P_R^T z + P_R^T P_C x_C + P_R^T P_R x_R.

    So a change of sets costs columns, not a factorisation; W_SS is factored anew only when the border has grown too large for that.
    The matrix of this response is kept. Of a released contact's x the linearised equations give all that sticks, and the normal component
    where it is closed: its tangential components alone are left to `BorderSystem`.
    W must be symmetric; where it is not positive definite on the closed contacts, those that stick are held, and where it is not on these
    the LU of the whole takes over; of joints it does also as long as the sets are far from settled. Of a sparse W whose contacts come in
    joints the factor is multifrontal, else dense. Large factors and columns are kept in single precision, and others belong to an earlier
    W once `follow` has brought a new one: they are then the preconditioner of GMRES on the true system. Where that does not pay all is
    factored anew, in double precision if that was not it.
    """

    def __init__(self, W: Any, dimension: int) -> None:
        self._d = dimension
        self._dtype: Any = np.float32 if W.shape[0] >= SINGLE_FROM else np.float64
        self._rows: BlockRows | None = None
        self._factor: _DenseCholesky | MultifrontalCholesky | None = None
        self._set(W)
        self._symmetric: bool | None = None  # not looked at yet
        self._held: IntArray | None = None
        self._holds_sliding = True
        self._status: IntArray | None = None  # of the contacts at the last step
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
        if self._whole is None and self._rows is not None:
            self._whole = MultifrontalSystem(self._rows, self._d)
        elif self._whole is None:
            self._whole = (DenseSystem if isinstance(self._W, np.ndarray) else SparseSystem)(self._W, self._d)
        return self._whole.solve(A, B, rhs)

    @property
    def by_joints(self) -> bool:
        """Whether the factor is multifrontal on the joints of W."""
        return self._rows is not None

    def follow(self, W: Any) -> bool:
        if self._held is None or W.shape != self._W.shape:
            return False
        self._set(W)
        self._followed, self._symmetric = True, None
        return True

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        closed = A.any(axis=(1, 2))
        sticking = closed & ~B.any(axis=(1, 2))
        if not closed.any():
            return self._solve_whole(A, B, rhs)
        settled = self._settled(closed, sticking)
        if self._held is not None and not self._outgrown(closed, sticking):
            found = self._by_what_is_held(A, B, rhs)
            if found is not None:
                return found
        self._held = None
        columns, rows = (self._d * np.count_nonzero(contacts) for contacts in (closed & ~sticking, closed))
        if columns * rows * np.dtype(self._dtype).itemsize > BORDER_UP_TO or (self._rows is not None and not settled):
            return self._solve_whole(A, B, rhs)
        if self._symmetric is None:
            self._symmetric = is_symmetric(self._W)
        if not self._symmetric:
            return self._solve_whole(A, B, rhs)
        while True:
            held, trusted = (closed, WELL_CONDITIONED) if self._holds_sliding else (sticking, 0.0)
            single = self._dtype is np.float32
            if self._hold(held, WELL_CONDITIONED_SINGLE if single else trusted):
                found = self._by_what_is_held(A, B, rhs)
                if found is not None:
                    return found
                if not single:
                    break
            elif not single:
                if not self._holds_sliding:
                    break
                self._holds_sliding = False
            self._dtype = np.float64
        self._held = None
        return self._solve_whole(A, B, rhs)

    def _settled(self, closed: BoolArray, sticking: BoolArray) -> bool:
        """Whether few contacts have another status than in the last step; without one, whether few of the closed contacts slide."""
        before, self._status = self._status, closed + 2 * sticking
        if before is None:
            return bool(np.count_nonzero(closed & ~sticking) <= FEW_SLIDE * np.count_nonzero(closed))
        return bool(np.count_nonzero(self._status != before) <= UNSETTLED * len(closed))

    def _by_what_is_held(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """The step by the factor and border that are there; None where they cannot give it."""
        try:
            if self._followed or self._dtype is np.float32:
                return self._corrected(A, B, rhs)
            dr = self._condensed(A, B, rhs)
        except SingularMatrix:
            return None
        return dr, self._product(dr)

    def _corrected(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """GMRES with factor and border as preconditioner; None where it does not pay."""
        shape = rhs.shape
        images: list[FloatArray] = []  # W times the steps

        def product(x: FloatArray) -> FloatArray:
            images.append(self._product(x))
            Wx = images[-1].reshape(shape)
            return (np.einsum("aij,aj->ai", A, Wx) + np.einsum("aij,aj->ai", B, x.reshape(shape))).ravel()

        def precondition(x: FloatArray) -> FloatArray:
            return self._condensed(A, B, x.reshape(shape), INNER if self._followed else 0.0, same=bool(images))

        accuracy = FORCING if self._followed else ACCURACY
        found = gmres(product, precondition, rhs.ravel(), accuracy * float(np.linalg.norm(rhs)), CORRECTIONS)
        if found is None:
            return None
        dr, y = found
        return dr, np.tensordot(y, images, 1) if len(y) else np.zeros_like(dr)

    def _outgrown(self, closed: BoolArray, sticking: BoolArray) -> bool:
        """Whether many closed contacts are not held, or stick and are in the border all the same: factoring anew then costs less."""
        assert self._held is not None
        carried = np.count_nonzero(np.where(self._is_held, sticking & (self._column >= 0), closed if self._holds_sliding else sticking))
        return bool(carried > 80 + 0.2 * len(self._held))

    def _hold(self, held: BoolArray, conditioning: float) -> bool:
        """Factor W on the held contacts (nc,) and start with an empty border; False where W is not positive definite there.

        conditioning: least pivot over the largest that counts as positive."""
        self._PT = self._response = np.empty((0, 0))  # the old ones make room for the new
        self._held, self._factor = None, None
        self._border_system = BorderSystem()
        if not held.any():
            return False
        d = self._d
        dtype = self._dtype
        try:
            self._factor = _DenseCholesky(self._W, d, held, dtype) if self._rows is None else MultifrontalCholesky(self._rows, held, dtype)
        except SingularMatrix:
            return False
        if self._factor.conditioning < conditioning:
            return False
        self._held = self._factor.contacts
        self._followed = False
        self._is_held = held
        self._place = np.full(len(held), -1)  # of a held contact in W_SS
        self._place[self._held] = np.arange(len(self._held))
        self._released = np.zeros(len(held), dtype=bool)
        self._border = np.empty(0, dtype=np.int64)
        self._column = np.full(len(held), -1)  # of a border contact in P
        # P^T and the response of ((W dr)_C, dr_R) to x, with room for columns to come
        self._PT = np.empty((0, d * len(self._held)), dtype=dtype)
        self._response = np.empty((0, 0), dtype=dtype)
        return True

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
        columns = np.ascontiguousarray(_dense_part(self._W, d, new, self._held).T, dtype=self._dtype)  # W_SC, as W is symmetric
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

    def _reserve(self, columns: int) -> None:
        """Make room for so many columns of the border and half as many again."""
        have = len(self._PT)
        if columns <= have:
            return
        used, room = len(self._border) * self._d, columns + columns // 2
        PT, response = (np.empty((room, k), dtype=self._dtype) for k in (self._PT.shape[1], room))
        PT[:used] = self._PT[:used]
        response[:used, :used] = self._response[:used, :used]
        self._PT, self._response = PT, response

    def _condensed(self, A: FloatArray, B: FloatArray, rhs: FloatArray, tolerance: float = 0.0, same: bool = False) -> FloatArray:
        """The step by the factor and border that are there; tolerance: relative defect of the border's system, 0: round-off.

        same: A and B are those of the last call."""
        d, held = self._d, self._held
        assert held is not None and self._factor is not None
        A, B, rhs = (x.astype(self._dtype, copy=False) for x in (A, B, rhs))
        closed = A.any(axis=(1, 2))
        open_free = ~(closed | self._is_held)  # an open contact that was held stays in the system as a released one
        dr = np.where(open_free[:, None], rhs, 0)
        coupling = np.zeros_like(rhs)
        if np.any(dr):
            coupling += self._product(dr.ravel().astype(float, copy=False)).reshape(-1, d)
        sticking = closed & ~B.any(axis=(1, 2))
        self._extend(np.flatnonzero(np.where(self._is_held, ~sticking, closed)))
        kept = ~self._released[held]
        t = np.zeros_like(rhs, shape=(len(held), d))
        t[kept] = np.linalg.solve(A[held[kept]], rhs[held[kept]][:, :, None])[:, :, 0]
        t -= coupling[held]
        z = self._factor.forward(t.reshape(-1, 1))[:, 0]
        border = self._border
        if len(border):
            PT = self._PT[: d * len(border)]
            released = self._released[border]
            known = (PT @ z).reshape(-1, d)
            known[released] *= -1
            known[~released] += coupling[border[~released]]
            x, unknown = np.zeros_like(known), np.repeat(~open_free[border][:, None], d, axis=1)
            own = border[released]
            x[released], unknown[released] = split_known(A[own], B[own], rhs[own])
            # a released contact's unknown is W dr and its response dr: A and B change places
            outer, inner = A[border], B[border]
            outer[released], inner[released] = B[own], A[own]
            target = tolerance * float(np.linalg.norm(rhs))
            self._border_system.complete(x, unknown, self._response, known, outer, inner, rhs[border], target, same)
            z -= x.ravel() @ PT
            dr[border[~released]] += x[~released]
        dr[held] = self._factor.backward(z).reshape(-1, d)
        return dr.ravel().astype(float, copy=False)
