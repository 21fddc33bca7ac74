"""W = sum of the bodies' shares h C h^T as a source of products, blocks and, when they are read, entries."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray, Matrix
from fcsim.linear.late.late_rows import LateRows
from fcsim.linear.products import product
from fcsim.linear.storage import REAL, REFERENCE, Work
from fcsim.problem.by_bodies._shares_kernels import diagonal_of_shares, gather_by_bodies, rows_of_shares, spread_by_contacts
from fcsim.problem.delassus_sum import DelassusSum

Share = tuple[int, FloatArray, IntArray]
"""What `DelassusSum.add` takes of symmetric C."""


class BodiesShares:
    """The shares of bodies with symmetric compliances, given as to `DelassusSum.add`, which sums them when entries are asked for."""

    def __init__(self, sum_of: DelassusSum, shares: list[Share]) -> None:
        self._sum, self._shares = sum_of, shares

    @property
    def work(self) -> Work:
        """Of a product, with the compliances alone: flops, and bytes that are read."""
        return sum((Work(flops=2 * len(kind) * C.shape[1] ** 2, bytes=REAL * C.size) for _, C, kind in self._shares), Work())

    def affine(self, x: FloatArray, q: FloatArray) -> FloatArray:
        """sum h (C (h^T x)) + q (m,): all bodies that share a C at once."""
        u = q.copy()
        for begin, C, kind in self._shares:
            Y = gather_by_bodies(*self._sum.bodies, begin, len(kind), C.shape[1], x)
            spread_by_contacts(*self._sum.bodies, begin, _times(Y, C, kind), u)
        return u

    def diagonal_blocks(self) -> FloatArray:
        """W_aa (nc, d, d)."""
        blocks = np.zeros((self._sum.nc, 3, 3))
        for begin, C, kind in self._shares:
            diagonal_of_shares(*self._sum.bodies, begin, C, kind, blocks)
        return blocks

    def part(self, rows: IntArray, columns: IntArray) -> FloatArray:
        """W of the contacts `rows` and `columns` (3 rows, 3 columns)."""
        values, place = np.zeros((3 * len(rows), 3 * len(columns))), np.full(self._sum.nc, -1)
        place[columns] = np.arange(len(columns))
        wanted = np.full(self._sum.nc, -1)
        wanted[rows] = np.arange(len(rows))
        for begin, C, kind in self._shares:
            rows_of_shares(*self._sum.bodies, begin, C, kind, wanted, place, values)
        return values

    def finite(self) -> bool:
        """Whether all of h and C is finite."""
        weights = self._sum.bodies[-1]
        return all(bool(np.isfinite(array.sum()) or np.isfinite(array).all()) for array in (weights, *(C for _, C, _ in self._shares)))

    def entries(self) -> FloatArray:
        """The blocks (nnz, 3, 3) of W."""
        for begin, C, kind in self._shares:
            self._sum.add(begin, C, kind)
        return self._sum.values.reshape(-1, 3, 3)


def _times(Y: FloatArray, C: FloatArray, kind: IntArray) -> FloatArray:
    """Y (nb, n) with each row times its C[kind]."""
    Z = np.empty_like(Y)
    if len(C) == 1:
        product(Y, C[0], Z)
    elif len(C) == len(kind):
        np.matmul(Y[:, None, :], C[kind], out=Z[:, None, :])
    else:
        for k in np.unique(kind):  # the parts of a model, few of many bodies
            Z[kind == k] = Y[kind == k] @ C[k]
    return Z


def summed_late(sum_of: DelassusSum, shares: list[Share]) -> Matrix:
    """W, whose entries are summed when they are read where products by bodies cost less than with them, and W has blocks of (3, 3). The
    order of sums, and so the last bits of products, follow from that alone."""
    by_bodies, by_entries = BodiesShares(sum_of, shares), Work(bytes=REAL * sum_of.size)
    if sum_of.dense or sum_of.dimension != 3 or REFERENCE.seconds(by_bodies.work) > REFERENCE.seconds(by_entries):
        for share in shares:
            sum_of.add(*share)
        return sum_of.matrix()
    return LateRows.of(by_bodies, *sum_of.pattern, 3 * sum_of.nc, 3)
