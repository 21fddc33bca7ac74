"""W = sum of the bodies' shares h C h^T as a source of products, blocks and, when they are read, entries."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from fcsim.arrays import FloatArray, IntArray, Matrix
from fcsim.linear.late.late_rows import LateRows
from fcsim.linear.storage import REAL, REFERENCE, Work
from fcsim.problem.bodies._shares_kernels import diagonal_of_shares, mirrored, rows_of_shares
from fcsim.problem.bodies.product import ShareProduct
from fcsim.problem.bodies.shares import BodyShares, Run
from fcsim.problem.delassus_sum import DelassusSum


class LateSum:
    """The shares of bodies with symmetric compliances, which are summed when entries are asked for: a `Source`."""

    def __init__(self, sum_of: DelassusSum, shares: BodyShares) -> None:
        """sum_of: nothing has been added to it; shares: of the same h."""
        self._sum, self.shares = sum_of, shares
        self._last: tuple[FloatArray, FloatArray] | None = None

    @cached_property
    def product(self) -> ShareProduct:
        """What multiplies by the bodies."""
        return ShareProduct(self.shares)

    def rows(self) -> LateRows:
        """W by block rows."""
        return LateRows.of(self, *self._sum.short_pattern, 3 * self.shares.nc, 3)

    def affine(self, x: FloatArray, q: FloatArray) -> FloatArray:
        """W x + q (m,); W x of the last x is kept: who checks an answer asks for the product that a method has ended with."""
        if q.any():
            return self.product.affine(x, q)
        last = self._last  # read once: threads may ask side by side
        if last is None or not np.array_equal(last[0], x):
            last = self._last = x.copy(), self.product.affine(x, q)
        return last[1].copy()

    def diagonal_blocks(self) -> FloatArray:
        """W_aa (nc, d, d)."""
        return self._diagonal_blocks.copy()

    @cached_property
    def _diagonal_blocks(self) -> FloatArray:
        blocks = np.zeros((self.shares.nc, 3, 3))
        for run in self.shares.runs:
            diagonal_of_shares(*self.shares.h, *run, blocks)
        return blocks

    @cached_property
    def _ends_of_runs(self) -> IntArray:
        """The first body of each run, and the one behind its last (2, runs)."""
        runs = self.shares.runs
        return np.array([[begin for begin, _, _ in runs], [begin + len(kind) for begin, _, kind in runs]], dtype=np.int64)

    def part(self, rows: IntArray, columns: IntArray) -> FloatArray:
        """W of the contacts `rows` and `columns` (3 rows, 3 columns)."""
        values, place = np.zeros((3 * len(rows), 3 * len(columns))), np.full(self.shares.nc, -1)
        place[columns] = np.arange(len(columns))
        wanted, lower = place, rows is columns or np.array_equal(rows, columns)
        if not lower:
            wanted = np.full(self.shares.nc, -1)
            wanted[rows] = np.arange(len(rows))
        bodies, runs = self.product.bodies_of(rows), self.shares.runs
        firsts, ends = np.searchsorted(bodies, self._ends_of_runs).tolist()
        for (begin, C, kind), first, end in zip(runs, firsts, ends, strict=True):
            if first < end:  # few of a rank's runs, which others' bodies part from one another, are at a patch
                rows_of_shares(*self.shares.h, begin, C, kind, bodies[first:end] - begin, wanted, place, lower, values)
        if lower:
            mirrored(values)
        return values

    def finite(self) -> bool:
        """Whether all of h and C is finite."""
        arrays = (self.shares.weights, *(C for _, C, _ in self.shares.runs))
        return all(bool(np.isfinite(array.sum()) or np.isfinite(array).all()) for array in arrays)

    def entries(self) -> FloatArray:
        """The blocks (nnz, 3, 3) of W, summed anew each time: who wants them twice keeps them."""
        for run in self.shares.runs:
            self._sum.add(*run)
        blocks: FloatArray = self._sum.values.reshape(-1, 3, 3)
        del self._sum.values
        return blocks


def late_sum(sum_of: DelassusSum, runs: tuple[Run, ...]) -> LateSum | None:
    """W as what is summed when its entries are read, where products by bodies cost less than with them, and W has blocks of (3, 3); else
    None. The order of sums, and so the last bits of products, follow from that alone."""
    if sum_of.dense or sum_of.dimension != 3:
        return None
    shares = BodyShares(*sum_of.bodies, runs, sum_of.nc, sum_of.dimension)
    dearer = REFERENCE.seconds(shares.work) > REFERENCE.seconds(Work(bytes=REAL * sum_of.size))
    return None if dearer else LateSum(sum_of, shares)


def summed(sum_of: DelassusSum, runs: tuple[Run, ...]) -> Matrix:
    """W with its entries."""
    for run in runs:
        sum_of.add(*run)
    return sum_of.matrix()


def summed_late(sum_of: DelassusSum, runs: tuple[Run, ...]) -> Matrix:
    """W, whose entries are summed when they are read where `late_sum` says so."""
    late = late_sum(sum_of, runs)
    return summed(sum_of, runs) if late is None else late.rows()
