"""Newton's linear system of a regularised problem in the bodies' velocities, for W = H^T M^-1 H + diag(own): n unknowns instead of m.

With D = diag(shift + own) > 0 the matrices C = A D + B of single contacts are regular, sticking contacts (B = 0) included. From
A (H^T dv + D dr) + B dr = rhs and M dv = H dr,

    dr = C^-1 (rhs - A H^T dv),        (M + H C^-1 A H^T) dv = H C^-1 rhs,

a matrix with the pattern of the bodies' graph whatever the number of contacts between them: its elimination costs n^3 where that of the
contacts costs m^3, and rank-deficient W, of four and more points a face, does no harm. This is the elimination of the reactions from the
saddle-point matrix of the global form (see `kkt`), which the regularisation allows; Sherman, Morrison and Woodbury's identity for W.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray
from fcsim.linear import storage
from fcsim.linear.block_factors.analysis import Analysis, Plan, analysed
from fcsim.linear.block_factors.lu import BlockLU
from fcsim.linear.factors import DenseLU, SingularMatrix
from fcsim.problem import Delassus
from fcsim.problem.motion import Motion
from fcsim.solvers.newton.systems._velocity_kernels import (
    add_shares,
    add_shares_to_rows,
    by_contacts,
    contacts_eliminated,
    graph_of,
    places,
)

SPARSE_STEPS = 12
"""Small steps of what the elimination by fronts takes beside its operations: with 110 velocities it costs what a dense one does, of 150 to
250, as of 42 blocks, half of it and less, its analysis included, wherever it does not fill in."""
IRREGULAR = 2.0
"""Times the time of a dense operation that one of the sparse elimination takes."""


class Bodies:
    """H^T by contacts, and M: h (nc, d, k) on `unknowns` (nc, k), filled up with -1 and zeros; what eliminates the bodies' matrix.

    mass: M, dense, where that is eliminated dense, else None; flops: operations of an elimination, those of a sparse one counted
    `IRREGULAR` times.
    """

    def __init__(self, motion: Motion, dimension: int) -> None:
        HT, d = motion.HT, dimension
        m, n = HT.shape
        self.HT, self.own = HT, np.zeros(m) if motion.own is None else motion.own
        self.unknowns: IntArray
        self.unknowns, self.h = by_contacts(HT.indptr, HT.indices, HT.data, d, n)
        self.flops, self.mass = 2 / 3 * n**3, None
        M = motion.M
        if storage.eliminated_dense(n, 0, SPARSE_STEPS):  # whatever the pattern
            self.mass = M.toarray()
            return
        graph = graph_of(self.unknowns, M.indptr, M.indices, M.data, n)
        if storage.fills_in(n, len(graph[1])):
            self.mass = M.toarray()
            return
        self.analysis, self.places, self.values = self._analysed(*graph)
        self.flops = IRREGULAR * self.analysis.flops

    def _analysed(self, indptr: IntArray, indices: IntArray, values: FloatArray) -> tuple[Analysis, IntArray, FloatArray]:
        """Fronts of the bodies' matrix, where its pattern has the contacts' shares, and M in it."""
        analysis = analysed(indptr, indices)
        return analysis, places(analysis.indptr, analysis.indices, self.unknowns), values

    @cached_property
    def H(self) -> sp.csr_array:
        """H (n, m) by rows."""
        return sp.csr_array(self.HT.T)

    @property
    def places_count(self) -> int:
        """Entries of all contacts' shares of the bodies' matrix."""
        return self.unknowns.size * self.unknowns.shape[1]

    def solve(self, K: FloatArray, right: FloatArray) -> FloatArray:
        """(M + H diag(K) H^T)^-1 right (n,), K (nc, d, d); raises SingularMatrix."""
        return self.factored(K)[0](right)

    def factored(self, K: FloatArray) -> tuple[Callable[[FloatArray], FloatArray], int]:
        """What multiplies (n,) by (M + H diag(K) H^T)^-1, K (nc, d, d), and the sign of the determinant; raises SingularMatrix."""
        if self.mass is not None:
            S = self.mass.copy()
            add_shares(S, self.unknowns, self.h, K)
            dense = DenseLU(S.T, overwrite=True)
            return dense.solve_transposed, dense.sign
        values = self.values.copy()
        add_shares_to_rows(values, self.places, self.h, K)
        factor = BlockLU(self.analysis, values.reshape(-1, 1, 1))
        return factor.solve, factor.sign

    @cached_property
    def order(self) -> IntArray:
        """The contacts (nc,), those between the same bodies one after the other, so that what they have in common is read once."""
        return np.lexsort((self.unknowns.max(axis=1), self.unknowns[:, 0]))

    def arrays(self) -> tuple[object, ...]:
        """What compiled iterations read of the contacts in `order`, and where they put their factors: see `newton_in_velocities`."""
        n, order, none = self.HT.shape[1], self.order, np.empty(0)
        unknowns, h = self.unknowns[order], self.h[order]
        of_contacts = faces_of(unknowns), unknowns, h, n
        if self.mass is not None:
            return *of_contacts, self.mass, np.empty((0, 0, 0), dtype=np.int64), none, *NO_FRONTS
        return *of_contacts, np.empty((0, 0)), self.places[order], self.values, *_room(self.analysis)

    def fronts(self, M: sp.csr_array) -> tuple[object, ...]:
        """What compiled paths read, whose matrix is always sparse: see `follow_in_velocities`; M (n, n)."""
        if self.mass is None:
            analysis, where, values = self.analysis, self.places, self.values
        else:
            analysis, where, values = self._analysed(*graph_of(self.unknowns, M.indptr, M.indices, M.data, M.shape[0]))
        return self.unknowns, self.h, where, values, *_room(analysis)


def faces_of(unknowns: IntArray) -> IntArray:
    """Where contacts with the same unknowns (nc, k), which follow one another, begin, and nc."""
    another = np.any(unknowns[1:] != unknowns[:-1], axis=1)
    return np.concatenate([[0], np.flatnonzero(another) + 1, [len(unknowns)]])


def _room(analysis: Analysis) -> tuple[Plan, tuple[IntArray | FloatArray, ...]]:
    """What `factorise_single` and `solve_single` read, and where they put factors: (plan, (order, first, starts, rows, offsets, values,
    borders, pivots))."""
    order, first, starts, rows, offsets = analysis.fronts
    room = np.empty(offsets[-1]), np.empty(int(np.diff(first) @ np.diff(starts))), np.empty(len(order), dtype=np.int64)
    return analysis.plan, (order, first, starts, rows, offsets, *room)


_NONE, _NOTHING = np.empty(0, dtype=np.int64), np.empty(0)
NO_FRONTS = (_NONE, _NONE, _NONE, _NONE, _NONE, np.empty((0, 3), dtype=np.int64), 0), (*(_NONE,) * 5, _NOTHING, _NOTHING, _NONE)
"""In their place where the bodies' matrix is eliminated dense."""


def bodies_of(operator: Delassus) -> Bodies:
    """The bodies behind W, made once for an operator and its shifts, which has a `Motion`."""
    whole = operator if operator.unshifted is None else operator.unshifted
    return whole.derived(_bodies)


def _bodies(operator: Delassus) -> Bodies:
    assert operator.motion is not None
    return Bodies(operator.motion, operator.dimension)


class VelocitySystem:
    """LU of M + H C^-1 A H^T, dense for few bodies, else by fronts; the operator needs a `Motion`, and every contact unknown a positive
    shift or a compliance of its own."""

    def __init__(self, operator: Delassus) -> None:
        self.operator, self._bodies = operator, bodies_of(operator)

    def shifted(self, shift: FloatArray) -> VelocitySystem:
        return VelocitySystem(self.operator.shifted(shift))

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        bodies = self._bodies
        own = bodies.own + self.operator.by_unknown
        if not own.any():
            raise SingularMatrix("without a shift the contacts' own equations are singular where they stick")
        K, c, singular = contacts_eliminated(A, B, own.reshape(rhs.shape), rhs)
        if singular >= 0:
            raise SingularMatrix(f"contact {singular}: its own equations are singular")
        Wdr = bodies.HT @ bodies.solve(K, bodies.H @ c.ravel())
        dr = (c - np.einsum("aij,aj->ai", K, Wdr.reshape(rhs.shape))).ravel()
        return dr, Wdr + own * dr
