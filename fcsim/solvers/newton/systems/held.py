"""The held contacts of a condensed elimination: those that were closed when W was factored on them, and that factor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import DTypeLike

from fcsim.arrays import BoolArray, FloatArray, IntArray, Matrix
from fcsim.linear._front_kernels import gather_blocks
from fcsim.linear.block_rows import dofs_of
from fcsim.linear.factors import DenseCholesky, SingularMatrix
from fcsim.linear.fronts import MultifrontalCholesky
from fcsim.linear.joints import BlockRows
from fcsim.linear.late.late_rows import source_of


class HeldFactor(Protocol):
    """L of W_SS = L L^T; conditioning: the least pivot over the largest."""

    conditioning: float

    def forward(self, X: FloatArray) -> FloatArray: ...

    def backward(self, z: FloatArray) -> FloatArray: ...


@dataclass(frozen=True, eq=False)
class Held:
    """W_SS = L L^T on the held contacts S.

    contacts (s,) in the factor's order; is_held (nc,); place (nc,) of a contact among `contacts`, -1 for others; dtype: the factor's
    precision; with_sliding: whether sliding contacts were held with the sticking ones.
    """

    factor: HeldFactor
    contacts: IntArray
    is_held: BoolArray
    place: IntArray
    dtype: DTypeLike
    with_sliding: bool


def hold(
    W: Matrix, rows: BlockRows | None, d: int, contacts: BoolArray, *, with_sliding: bool, dtype: DTypeLike, conditioning: float
) -> Held | None:
    """Factor W on contacts (nc,), by fronts where `rows` says that they come in joints, else dense; None where that cannot be trusted.

    conditioning: least pivot over the largest that counts as positive definite.
    """
    held = np.flatnonzero(contacts)
    if not len(held):
        return None
    factor: HeldFactor
    try:
        if rows is None:
            factor = DenseCholesky(dense_part(W, d, held, held).T, overwrite=True, dtype=dtype)
        else:
            factor = fronts = MultifrontalCholesky(rows, contacts, dtype)
            held = fronts.contacts
    except SingularMatrix:
        return None
    if factor.conditioning < conditioning:
        return None
    place = np.full(len(contacts), -1)
    place[held] = np.arange(len(held))
    return Held(factor, held, contacts, place, dtype, with_sliding)


def dense_part(W: Matrix, d: int, rows: IntArray, columns: IntArray) -> FloatArray:
    """The blocks of W, dense or by block rows, of contacts `rows` and `columns` as a dense array in C order."""
    if isinstance(W, np.ndarray):
        return W[np.ix_(dofs_of(rows, d), dofs_of(columns, d))]
    if (source := source_of(W)) is not None:
        return source.part(rows, columns)
    part = np.zeros((d * len(rows), d * len(columns)))
    place = np.full(W.shape[0] // d, -1)
    place[columns] = np.arange(len(columns))
    gather_blocks(W.indptr, W.indices, W.data, rows, place, part)
    return part
