"""What is left of a condensed step: equations for the border's components that the linearised equations do not give by themselves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.linear._front_kernels import border_matrix
from fcsim.linear.factors import DenseLU, SingularMatrix
from fcsim.linear.krylov import gmres
from fcsim.linear.products import times
from fcsim.solvers.newton.systems._condensed_kernels import known_components, left_over, own_blocks
from fcsim.threads import pieces, side_by_side

APPROXIMATE_FROM = 500
"""Unknowns from which an earlier factor and GMRES pay where a defect is allowed; smaller systems are solved by their own factor."""
ROWS_A_PIECE = 150
"""Of J that one thread fills: a tenth of a millisecond."""
REUSED = 14
"""Iterations of GMRES that an earlier factor may take."""
CHANGED = 0.1
"""Share of the unknowns that may have come or gone since a factor was computed: each costs a solve with it."""


@dataclass(frozen=True, eq=False)
class Factored:
    """The LU of J on the `unknown` components (k, d) of k contacts, with the contacts' own blocks of J (k, d, d)."""

    lu: DenseLU
    unknown: BoolArray
    own: FloatArray

    def solve(self, rhs: FloatArray) -> FloatArray:
        """J^-1 rhs for rhs (n,) or (n, columns)."""
        return self.lu.solve_transposed(rhs)


class _Updated:
    """An approximate inverse of J by the factor of an earlier J0, of which other components were unknown in part.

    Contacts of which the same components are unknown in both (c) have rows D D0^-1 times those of J0, with their own blocks D and D0: most
    of a change of the linearisation, above all of rho, is such a scaling. Unknowns that came (+) are a border, those that went (E) are
    held at zero by multipliers l:

        [J0    J_c+  E] [x ]   [b ]
        [J_+c  J_++  0] [x+] = [b+]     with the rows of J_c+ and b times D0 D^-1.
        [E^T   0     0] [l ]   [0 ]
    """

    def __init__(self, factored: Factored, J: FloatArray, unknown: BoolArray, own: FloatArray) -> None:
        """Raises SingularMatrix where too much has changed."""
        d = unknown.shape[1]
        before, own_before = np.zeros_like(unknown), np.zeros_like(own)
        before[: len(factored.unknown)], own_before[: len(factored.own)] = factored.unknown, factored.own
        common = (before == unknown).all(axis=1)
        stays, stayed = (np.repeat(common, d)[np.flatnonzero(components)] for components in (unknown, before))
        self._stays, self._came = np.flatnonzero(stays), np.flatnonzero(~stays)
        self._stayed, self._went = np.flatnonzero(stayed), np.flatnonzero(~stayed)
        if len(self._came) + len(self._went) > CHANGED * len(J):
            raise SingularMatrix("too many unknowns have come or gone")
        self._factored, self._unknown, self._scaling = factored, unknown, np.zeros_like(own)
        self._scaling[common] = own_before[common] @ _inverse(own[common])
        came, border = len(self._came), len(self._came) + len(self._went)
        columns = np.zeros((len(stayed), border), dtype=J.dtype, order="F")
        columns[self._stayed, :came] = self._scaled(J[:, self._came])[self._stays]
        columns[self._went, np.arange(came, border)] = 1
        self._rows = J[np.ix_(self._came, self._stays)]
        self._columns = factored.solve(columns) if border else columns
        complement = np.zeros((border, border), dtype=J.dtype)
        complement[:came, :came] = J[np.ix_(self._came, self._came)]
        self._complement = DenseLU(complement - self._border_of(self._columns)) if border else None

    def solve(self, rhs: FloatArray) -> FloatArray:
        """J^-1 rhs (n,), approximately."""
        b = np.zeros(len(self._columns), dtype=rhs.dtype)
        b[self._stayed] = self._scaled(rhs[:, None])[self._stays, 0]
        x, solution, came = self._factored.solve(b), np.empty_like(rhs), len(self._came)
        if self._complement is not None:
            defect = -self._border_of(x)
            defect[:came] += rhs[self._came]
            border = self._complement.solve(defect)
            x -= self._columns @ border
            solution[self._came] = border[:came]
        solution[self._stays] = x[self._stayed]
        return solution

    def _border_of(self, x: FloatArray) -> FloatArray:
        """[J_+c x; E^T x] for x (n of J0, ...)."""
        return np.concatenate([self._rows @ x[self._stayed], x[self._went]])

    def _scaled(self, x: FloatArray) -> FloatArray:
        """Rows x (n, columns) of the common contacts times D0 D^-1, 0 in others."""
        spread = np.zeros((*self._unknown.shape, x.shape[1]), dtype=x.dtype)
        spread[self._unknown] = x
        scaled: FloatArray = (self._scaling @ spread)[self._unknown]
        return scaled


class Remainder:
    """outer (known + G x) + inner x = rhs on the unknown components of x (k, d), with outer and inner block diagonal (k, d, d).

    factored: the LU that was computed here, or the earlier one as long as that serves: where few of the unknown components have changed
    it is GMRES' preconditioner.
    """

    def __init__(
        self, G: FloatArray, outer: FloatArray, inner: FloatArray, unknown: BoolArray, earlier: Factored | None, *, inexact: bool
    ) -> None:
        """G (k d, k d); inexact: whether a defect will be accepted."""
        self.factored = earlier
        self._G, self._outer, self._inner, self._unknown = G, outer, inner, unknown
        dofs = np.flatnonzero(unknown)
        self._J: FloatArray | None = None  # None where the factor has taken its place, or nothing is unknown
        self._approximate: _Updated | None = None
        if len(dofs):
            J = self._J = np.empty((len(dofs), len(dofs)), dtype=G.dtype)
            A, B, d = outer.ravel(), inner.ravel(), unknown.shape[1]
            rows = pieces(len(dofs), ROWS_A_PIECE)
            side_by_side([partial(border_matrix, G, A, B, dofs, d, begin, end, J) for begin, end in rows])
            self._own = own_blocks(G, outer, inner, unknown)
            if inexact and earlier is not None and len(dofs) > APPROXIMATE_FROM:
                self._approximate = _updated(earlier, J, unknown, self._own)

    def complete(self, x: FloatArray, known: FloatArray, rhs: FloatArray, contacts: IntArray, target: float) -> None:
        """Fill in the unknown components (k, d) of x, which are zero; rhs (nc, d), of which the rows `contacts` (k,) count; target: norm
        of the defect that is accepted, 0: round-off."""
        if not self._unknown.any():
            return
        response = known + times(self._G, x.ravel()).reshape(x.shape) if x.any() else known
        left = left_over(self._outer, self._inner, response, x, rhs, contacts, self._unknown)
        x[self._unknown] = self._solve(left, target)

    def _solve(self, rhs: FloatArray, target: float) -> FloatArray:
        J = self._J
        if J is not None:
            if target and self._approximate is not None:
                found = gmres(partial(times, J), self._approximate.solve, rhs, target, REUSED)
                if found is not None:
                    return found[0]
            self._approximate = self._J = None
            self.factored = Factored(DenseLU(J.T, overwrite=True), self._unknown, self._own)
        assert self.factored is not None
        return self.factored.solve(rhs)


def _updated(factored: Factored, J: FloatArray, unknown: BoolArray, own: FloatArray) -> _Updated | None:
    """The earlier factor brought up to date; None where that cannot be."""
    try:
        return _Updated(factored, J, unknown, own)
    except SingularMatrix:
        return None


def _inverse(blocks: FloatArray) -> FloatArray:
    """The inverses of blocks (k, d, d); SingularMatrix where one is singular."""
    try:
        return np.linalg.inv(blocks)
    except np.linalg.LinAlgError as error:
        raise SingularMatrix(str(error)) from None


def split_known(A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, BoolArray]:
    """`known_components`; SingularMatrix where the block of a sticking contact is singular."""
    x, unknown, regular = known_components(A, B, rhs)
    if not regular:
        raise SingularMatrix("the block of a sticking contact is singular")
    return x, unknown
