"""The border of a condensed elimination: contacts whose status is another than when W was factored on the held ones.

A released contact a (held, but sliding or open now) has the unknown x_a = (W dr)_a, a free one (not held, but closed now) the unknown
x_a = dr_a. With the columns P = L^-1 [W_SC, -E_R] of free (C) and released (R) contacts, z = L^-1 t and t the held contacts' W dr
(0 at released ones),

    (W dr)_C = P_C^T z + (W_CC - P_C^T P_C) x_C - P_C^T P_R x_R,        dr_R = -P_R^T z + P_R^T P_C x_C + P_R^T P_R x_R.

So a change of sets costs columns, not a factorisation. The matrix of this response to x is kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike

from fcsim.arrays import BoolArray, FloatArray, IntArray, Matrix
from fcsim.linear.block_rows import dofs_of
from fcsim.linear.products import product
from fcsim.solvers.newton.systems.held import Held, dense_part


class _Columns:
    """Storage for P^T and the response, with room for columns to come, which the borders that grow from one another share.

    taken: columns written so far. Only the border that has all of them may write the next ones in place; another one copies first.
    """

    def __init__(self, room: int, held: int, dtype: DTypeLike) -> None:
        self.PT, self.response = np.empty((room, held), dtype=dtype), np.empty((room, room), dtype=dtype)
        self.taken = 0


@dataclass(frozen=True, eq=False)
class Border:
    """contacts (k,) in the order in which they came; released (k,): whether each is held; column (nc,) of a contact, -1 for others."""

    contacts: IntArray
    released: BoolArray
    column: IntArray
    _columns: _Columns
    _d: int

    @property
    def dtype(self) -> DTypeLike:
        """The precision of columns and response."""
        return self._columns.PT.dtype

    @property
    def PT(self) -> FloatArray:
        """P^T (d k, d s)."""
        return self._columns.PT[: self._d * len(self.contacts)]

    @property
    def response(self) -> FloatArray:
        """The matrix (d k, d k) of ((W dr)_C, dr_R) by x."""
        size = self._d * len(self.contacts)
        return self._columns.response[:size, :size]


def empty_border(held: Held, d: int, dtype: DTypeLike) -> Border:
    """The border without contacts, to be kept in the precision `dtype`, which may be less than the factor's."""
    nothing = np.empty(0, dtype=np.int64)
    columns = _Columns(0, d * len(held.contacts), dtype)
    return Border(nothing, np.empty(0, dtype=bool), np.full(len(held.is_held), -1), columns, d)


def extended(border: Border, held: Held, W: Matrix, contacts: IntArray) -> Border:
    """The border with columns for `contacts` too; W dense or by block rows."""
    d = border._d
    new = contacts[border.column[contacts] < 0]
    if not len(new):
        return border
    released = held.is_held[new]
    P = np.ascontiguousarray(dense_part(W, d, new, held.contacts).T, dtype=held.dtype)  # W_SC, as W is symmetric
    if released.any():
        own = dofs_of(np.flatnonzero(released), d)
        P[:, own] = 0
        P[dofs_of(held.place[new[released]], d), own] = -1
    P = held.factor.forward(P).astype(border.dtype, copy=False)
    k, end = len(border.contacts) * d, (len(border.contacts) + len(new)) * d
    columns = _with_room(border, end)
    columns.PT[k:end] = P.T
    every, is_released = np.concatenate([border.contacts, new]), np.concatenate([border.released, released])
    response = columns.response[:end, :end]
    if k:
        product(columns.PT[:k], P, response[:k, k:])
        response[k:, :k] = response[:k, k:].T
    response[k:, k:] = P.T @ P  # by the symmetric product
    _sign(response, k, W, every, is_released, d)
    column = border.column.copy()
    column[new] = len(border.contacts) + np.arange(len(new))
    return Border(every, is_released, column, columns, d)


def _sign(response: FloatArray, k: int, W: Matrix, contacts: IntArray, released: BoolArray, d: int) -> None:
    """Make of P^T P in rows and columns from k on the response by the formulas above: signs, and W_CC of free contacts."""
    free, first = np.flatnonzero(~released), k // d
    fresh = free[free >= first]
    rows, new, held = dofs_of(free, d), dofs_of(fresh, d), dofs_of(np.flatnonzero(released), d)
    response[np.ix_(new, rows)] = dense_part(W, d, contacts[fresh], contacts[free]) - response[np.ix_(new, rows)]
    old = rows[rows < k]
    if k:
        response[np.ix_(old, new)] = response[np.ix_(new, old)].T
    if len(held):
        response[np.ix_(new, held)] *= -1
        response[np.ix_(old, held[held >= k])] *= -1


def _with_room(border: Border, end: int) -> _Columns:
    """The border's columns with those up to `end` taken, in larger storage where there is no room or another border has grown there."""
    columns, used = border._columns, border._d * len(border.contacts)
    if end > len(columns.PT) or columns.taken > used:
        larger = _Columns(end + end // 2, columns.PT.shape[1], columns.PT.dtype)
        larger.PT[:used], larger.response[:used, :used] = columns.PT[:used], columns.response[:used, :used]
        columns = larger
    columns.taken = end
    return columns
