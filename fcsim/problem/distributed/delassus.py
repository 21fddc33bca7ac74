"""W as the sum of the ranks' shares: W x is the sum over a rank's own bodies of h C h^T x, put together contact by contact."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator

from fcsim.arrays import FloatArray, IntArray, Matrix
from fcsim.brief import brief
from fcsim.linear._front_kernels import gather_blocks
from fcsim.linear.block_rows import product_by_rows
from fcsim.problem.bodies.late import LateSum
from fcsim.problem.distributed.bodies import BodiesOverRanks
from fcsim.problem.distributed.factor import DistributedFactor
from fcsim.problem.distributed.layout import ContactLayout


class DistributedDelassus(LinearOperator):
    """W (m, m), symmetric; bodies: those behind it, None where that is not known.

    All ranks ask for the same at the same time. Products, diagonal blocks and the factor of W + rho I are what there is of it; `whole` is
    the matrix itself, on every rank, for who needs that.
    """

    __repr__ = brief

    def __init__(self, layout: ContactLayout, share: sp.bsr_array | LateSum, bodies: BodiesOverRanks | None = None) -> None:
        """share: this rank's, on its own contacts: by block rows (bsr, sorted), or what they are made of when they are read."""
        size = layout.nc * layout.dimension
        super().__init__(np.float64, (size, size))
        self.layout, self.bodies, self._share = layout, bodies, share

    @cached_property
    def rows(self) -> sp.bsr_array:
        """This rank's share by block rows."""
        return self._share.rows() if isinstance(self._share, LateSum) else self._share

    def _matvec(self, x: FloatArray) -> FloatArray:
        layout = self.layout
        with layout.together("product with W"):
            own = self.own_product(np.ascontiguousarray(x.ravel()[layout.own_unknowns]))
        return layout.summed(own)

    def own_product(self, x: FloatArray) -> FloatArray:
        """This rank's share times x (k d,), both on its own contacts."""
        if isinstance(self._share, LateSum):
            return self._share.product.times(x)
        Wx: FloatArray = product_by_rows(self.rows, np.zeros_like(x), x) if self.layout.dimension == 3 else self.rows @ x
        return Wx

    def own_product_of_few(self, x: FloatArray) -> FloatArray:
        """As `own_product`, for x that is zero but at few contacts."""
        return self._share.product.of_few(x) if isinstance(self._share, LateSum) else self.own_product(x)

    def own_part(self, contacts: IntArray) -> FloatArray:
        """This rank's share (k d, k d) of the blocks of contacts (k,), all of them its own."""
        place, d = self._place[contacts], self.layout.dimension
        if isinstance(self._share, LateSum):
            return self._share.part(place, place)
        part, columns = np.zeros((d * len(place), d * len(place))), np.full(len(self.layout.own), -1)
        columns[place] = np.arange(len(place))
        gather_blocks(self.rows.indptr, self.rows.indices, self.rows.data, place, columns, part)
        return part

    @cached_property
    def _place(self) -> IntArray:
        """Of a contact (nc,) among this rank's own, -1 for others."""
        place = np.full(self.layout.nc, -1)
        place[self.layout.own] = np.arange(len(self.layout.own))
        return place

    def _rmatvec(self, x: FloatArray) -> FloatArray:
        return self._matvec(x)

    def diagonal_blocks(self) -> FloatArray:
        """The contacts' own blocks W_aa (nc, d, d)."""
        return self._diagonal_blocks

    @cached_property
    def _diagonal_blocks(self) -> FloatArray:
        layout, d = self.layout, self.layout.dimension
        with layout.together("diagonal of W"):
            if isinstance(self._share, LateSum):
                own = self._share.diagonal_blocks()
            else:
                row = np.repeat(np.arange(len(layout.own)), np.diff(self.rows.indptr))
                on = np.flatnonzero(row == self.rows.indices)
                own = np.zeros((len(layout.own), d, d))
                own[row[on]] = self.rows.data[on]
        return layout.summed_blocks(own)

    def diagonal(self) -> FloatArray:
        """The diagonal (m,)."""
        return np.einsum("aii->ai", self.diagonal_blocks()).ravel()

    @cached_property
    def entries(self) -> int:
        """Entries that the ranks' shares have, those of both on a block that two have."""
        world = self.layout.world
        return int(world.gathered(np.array([float(self.rows.nnz)]), np.ones(world.size, dtype=np.int64)).sum())

    def factor(self, rho: float) -> DistributedFactor:
        """The factor of W + rho I; SingularMatrix, on all ranks, where that is not positive definite."""
        return DistributedFactor(self.layout, self._own_blocks, rho, self.matvec)

    def _own_blocks(self) -> sp.bsr_array:
        """`rows` with entries, which nobody needs any more once they are factored."""
        if not isinstance(self._share, LateSum):
            return self._share
        return sp.bsr_array((self._share.entries(), self.rows.indices, self.rows.indptr), shape=self.rows.shape)

    @cached_property
    def whole(self) -> sp.bsr_array:
        """W by block rows, summed over the ranks: the bits that one process would have."""
        layout, d = self.layout, self.layout.dimension
        world, own = layout.world, layout.own
        with layout.together("all of W"):
            rows = self._own_blocks()
            row = np.repeat(own, np.diff(rows.indptr))
        counts = world.gathered(np.array([float(len(row))]), np.ones(world.size, dtype=np.int64)).astype(np.int64)
        place = world.gathered(row * layout.nc + own[rows.indices], counts)
        blocks = world.gathered(rows.data.ravel(), counts * d * d).reshape(-1, d, d)
        places, number = np.unique(place, return_inverse=True)
        data = np.zeros((len(places), d, d))
        begin = 0
        for count in counts.tolist():  # no place twice among a rank's
            data[number[begin : begin + count]] += blocks[begin : begin + count]
            begin += count
        starts = np.searchsorted(places, layout.nc * np.arange(layout.nc + 1))
        return sp.bsr_array((data, (places % layout.nc).astype(np.int32), starts.astype(np.int32)), shape=self.shape)


def whole_delassus(W: Matrix) -> Matrix:
    """W as a matrix on every rank, itself where it is one."""
    return W.whole if isinstance(W, DistributedDelassus) else W
