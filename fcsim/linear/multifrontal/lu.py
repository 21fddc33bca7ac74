"""LU of A W + B, with A and B block diagonal over contacts, by fronts on the graph of the joints; see `fcsim.linear.fronts`.

Sources: I. S. Duff, J. K. Reid, ACM Trans. Math. Softw. 9, 1983; J. W. H. Liu, SIAM Review 34, 1992.
"""

from __future__ import annotations

from copy import copy
from functools import partial

import numpy as np
import scipy.linalg as sla
from numpy.typing import DTypeLike, NDArray

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.linear._front_kernels import extend_add, fill, fill_blocks, solve_by_fronts
from fcsim.linear.factors import SingularMatrix
from fcsim.linear.joints import BlockRows
from fcsim.linear.multifrontal.plan import Plan
from fcsim.linear.products import OPERATIONS_A_PIECE
from fcsim.threads import pieces, side_by_side


class Multifrontal:
    """LU of A W + B on the active contacts (nc,) of `rows`, or of W itself; fronts of the given precision.

    They are filled by rows of W, without gaps, and LAPACK, for which matrices are stored by columns, factors their transposes. Where W
    changes here and there alone, the fronts in whose subtrees it does not may be those of an earlier factor, bit by bit (`following`)."""

    _by_fronts: tuple[NDArray[np.floating], IntArray, IntArray, IntArray]
    _complements: list[NDArray[np.floating] | None]

    def __init__(
        self,
        rows: BlockRows,
        AB: tuple[FloatArray, FloatArray] | None,
        active: BoolArray,
        dtype: DTypeLike = np.float64,
        *,
        lasting: bool = False,
    ) -> None:
        """AB: A and B (nc, d, d), None for W itself; lasting: whether complements are kept, for `following`."""
        self._plan, self._dtype, self._lasting = Plan(rows.tree, active, rows.blocks.shape[1]), dtype, lasting
        self._factor(rows, AB, None, np.ones(len(self._plan.fronts), dtype=bool))

    def following(self, rows: BlockRows, entries: IntArray) -> Multifrontal:
        """The factor of a W of the same pattern whose entries are those of this one's but for some, by a factor that is `lasting`."""
        anew = self._plan.with_others(rows.indptr, rows.indices, entries)
        if not anew.any():
            return self
        other = copy(self)
        other._factor(rows, None, self, anew)
        return other

    @property
    def contacts(self) -> IntArray:
        """Those that are eliminated, in that order."""
        return self._plan.contacts

    def _factor(self, rows: BlockRows, AB: tuple[FloatArray, FloatArray] | None, earlier: Multifrontal | None, anew: BoolArray) -> None:
        """Eliminate the fronts `anew` (fronts,) and take the others from `earlier`, None: all are anew."""
        plan, d, dtype = self._plan, rows.blocks.shape[1], self._dtype
        getrf, self._getrs = sla.lapack.get_lapack_funcs(("getrf", "getrs"), dtype=dtype)
        local = np.full(len(plan.front_of), -1)
        flat = None if AB is None else (rows.blocks.ravel(), *(x.ravel() for x in AB))
        # of all fronts in one array, as `solve_by_fronts` asks
        values, pivots = np.zeros(plan.ends[-1], dtype=dtype), np.empty(d * len(plan.contacts), dtype=np.int64)
        complements: list[NDArray[np.floating] | None] = [None] * len(plan.fronts)
        if earlier is not None:
            complements, pivots = list(earlier._complements), earlier._by_fronts[2].copy()
            for i, j in _runs(~anew):
                values[plan.ends[i] : plan.ends[j]] = earlier._by_fronts[0][plan.ends[i] : plan.ends[j]]
        for f in np.flatnonzero(anew).tolist():
            own, border, _, at, begin, children = plan.fronts[f]
            n, b = d * len(own), d * len(border)
            F11, F21 = values[at : at + n * n].reshape(n, n), values[at + n * n : at + n * (n + b)].reshape(b, n)
            F12, F22 = values[at + n * (n + b) : at + n * (n + 2 * b)].reshape(n, b), np.zeros((b, b), dtype=dtype)
            if flat is None:
                fill_blocks(own, border, local, rows.indptr, rows.indices, rows.blocks, F11, F12, F21)
            else:
                fill(own, border, local, rows.indptr, rows.indices, *flat, d, F11, F12, F21)
            for k, place in children:
                extend_add(complements[k], place, len(own), d, F11, F12, F21, F22)
                if not self._lasting:
                    complements[k] = None
            if n:
                lu, own_pivots, info = getrf(F11.T, overwrite_a=True)  # in place: the array is stored by columns
                if info != 0:
                    raise SingularMatrix(f"the block of {len(own)} contacts is singular: zero pivot {info}")
                pivots[d * begin : d * begin + n] = own_pivots
                if b:
                    own_rows = pieces(b, max(1, OPERATIONS_A_PIECE // (n * (n + b))))
                    side_by_side([partial(self._eliminate, lu, own_pivots, F12, F21[i:j], F22[i:j]) for i, j in own_rows])
            complements[f] = F22
        self._complements = complements if self._lasting else []
        self._by_fronts = values, plan.sizes, pivots, plan.borders

    def _eliminate(
        self,
        lu: NDArray[np.floating],
        pivots: IntArray,
        F12: NDArray[np.floating],
        F21: NDArray[np.floating],
        F22: NDArray[np.floating],
    ) -> None:
        """Some rows of F21 F11^-1 and of the complement F22 - F21 F11^-1 F12, in the place of those of F21 and F22."""
        own = pivots.copy()  # SciPy counts them from 1 while LAPACK works, in place
        F21[:] = self._getrs(lu, own, F21.T, overwrite_b=True)[0].T
        F22 -= F21 @ F12

    def solve(self, rhs: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return x (k, d) of the active contacts for rhs (k, d), both in the order of `contacts`."""
        x = rhs.astype(self._dtype).ravel()
        solve_by_fronts(*self._by_fronts, x)
        return x.reshape(rhs.shape)


def _runs(which: BoolArray) -> list[tuple[int, int]]:
    """(begin, end) of each run of True in `which` (n,)."""
    ends = np.flatnonzero(np.diff(np.concatenate([[False], which, [False]])))
    return [(int(i), int(j)) for i, j in ends.reshape(-1, 2)]
