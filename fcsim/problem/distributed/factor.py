"""The factor of W + rho I over ranks: fronts of the contacts that one rank alone knows, and the complement on the interface.

Contacts between bodies of two ranks separate the others: W has no block between contacts that only one rank knows and those that only
another one knows. So each rank eliminates its own by fronts; what that leaves on the interface is summed over the ranks and factored by
all, and of its inverse each rank keeps, and multiplies by, its share of the rows.

Sources: J. S. Przemieniecki, AIAA J. 1, 1963 (substructures); P. Amestoy, I. S. Duff, J.-Y. L'Excellent, Comput. Methods Appl. Mech.
Eng. 184, 2000 (fronts of separate subtrees on separate processes); single precision with refinement in double: A. Buttari et al., Int. J.
High Perform. Comput. Appl. 21, 2007.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
from numpy.typing import DTypeLike, NDArray

from fcsim.arrays import FloatArray
from fcsim.linear.block_rows import dofs_of
from fcsim.linear.factors import SingularMatrix, mirror, probes
from fcsim.linear.fronts import MultifrontalCholesky
from fcsim.linear.joints import BlockRows
from fcsim.problem.distributed.layout import ContactLayout

CLOSE = 0.05
"""Share of a vector up to which x - (W + rho I)^-1 (W + rho I) x may be left by a factor in single precision; else double is taken."""


class DistributedFactor:
    """W + rho I = L L^T; exact: whether `solve` gives the solution itself, or, in single precision, a step of refinement on its way."""

    name = "multifrontal Cholesky over ranks"

    def __init__(
        self, layout: ContactLayout, rows: Callable[[], sp.bsr_array], rho: float, product: Callable[[FloatArray], FloatArray]
    ) -> None:
        """rows: what makes those of `DistributedDelassus`; product: x -> W x for x (m,)."""
        self.layout, self._rho, self.exact = layout, rho, False
        with layout.together("analysis of W"):
            analysed = BlockRows(rows(), layout.dimension, last=layout.at_interface)
        try:
            self._factorise(analysed, np.float32)
            x = probes(layout.nc * layout.dimension)[0]
            near = bool(np.linalg.norm(x - self.solve(product(x) + rho * x)) <= CLOSE * np.linalg.norm(x))
        except SingularMatrix:
            near = False
        if not near:
            self.exact = True
            self._factorise(analysed, np.float64)

    def _factorise(self, rows: BlockRows, dtype: DTypeLike) -> None:
        """SingularMatrix, on all ranks, where the matrix is not positive definite."""
        layout, world = self.layout, self.layout.world
        k = layout.dimension * len(layout.interface)
        complement = np.zeros((k, k))
        with layout.together("fronts of W"):
            self._own = MultifrontalCholesky(rows, np.ones(len(layout.own), dtype=bool), dtype, shift=self._rho, left=layout.at_interface)
            global_order = dofs_of(np.searchsorted(layout.interface, layout.own[self._own.left]), layout.dimension)
            mirror(self._own.complement)
            complement[np.ix_(global_order, global_order)] = self._own.complement
            del self._own.complement
        self._dtype = dtype
        self._left, self._inner = global_order, dofs_of(self._own.contacts, layout.dimension)
        world.summed("complement of W", complement)
        complement.flat[:: k + 1] += self._rho
        cuts = [k * number // world.size for number in range(world.size + 1)]
        self._rows_of_ranks = np.diff(cuts)
        self._inverse = self._inverse_rows(complement, cuts[world.number], cuts[world.number + 1], dtype)

    def _inverse_rows(self, complement: FloatArray, begin: int, end: int, dtype: DTypeLike) -> NDArray[np.floating]:
        """Rows begin, ..., end - 1 of the inverse; SingularMatrix where there is none."""
        if not len(complement):
            return np.empty((0, 0), dtype=dtype)
        try:
            factor = sla.cho_factor(complement.astype(dtype, copy=False), lower=True, overwrite_a=True, check_finite=False)
        except np.linalg.LinAlgError:
            raise SingularMatrix(f"W + rho I of {self.layout.nc} contacts is not positive definite") from None
        units = np.zeros((len(complement), end - begin), dtype=dtype)
        units[np.arange(begin, end), np.arange(end - begin)] = 1
        return np.ascontiguousarray(sla.cho_solve(factor, units, overwrite_b=True, check_finite=False).T)

    def solve(self, rhs: FloatArray) -> FloatArray:
        """(W + rho I)^-1 rhs (m,), to round-off where `exact`; of rhs only what is this rank's own, the interface's and `free` counts."""
        layout, n = self.layout, len(self._inner)
        with layout.together("solution"):
            x = np.zeros((len(layout.own_unknowns), 1), dtype=self._dtype)
            own = rhs[layout.own_unknowns]
            x[:n, 0] = own[self._inner]
            x = self._own.forward(x)[:, 0]
            given = np.empty(layout.dimension * len(layout.interface))
            given[self._left] = x[n:]
        known = layout.interface_unknowns_of(layout.world.number)
        right = rhs[dofs_of(layout.interface, layout.dimension)] + layout.summed_at_interface(given[known])
        part = (self._inverse @ right.astype(self._dtype)).astype(np.float64)
        interface = layout.world.gathered(part, self._rows_of_ranks)
        x[n:] = interface[self._left]
        inner = np.empty(len(own))
        inner[self._inner] = self._own.backward(x)[:n]
        alone = np.repeat(~layout.at_interface, layout.dimension)
        solution = layout.joined(inner[alone], interface)
        free = dofs_of(layout.free, layout.dimension)
        solution[free] = rhs[free] / self._rho
        return solution
