"""Newton on regularised problems (W + alpha D, q - alpha D r_k) of one W, alpha and r_k changing all the time.

The matrix of a Newton iteration on the contacts that are not open is filled by one pass over W, in the storage that SuperLU or LAPACK
reads: for the many small factorisations of a proximal method selecting rows and columns costs more than the factorisation.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numba import njit
from numpy.typing import NDArray

from fcsim.arrays import FloatArray
from fcsim.linear.factors import DenseLU, SingularMatrix
from fcsim.problem import LocalProblem, diagonal_blocks
from fcsim.solvers.base import Iterate, Monitor
from fcsim.solvers.newton.iterations import NewtonOptions, newton, newton_iterations
from fcsim.solvers.newton.systems.direct import without_open
from fcsim.solvers.scaling import contact_compliance

IntArray = NDArray[np.int32]

SUPERLU_UP_TO = 500_000
"""Entries of a sparse W up to which the system is filled here and factored by SuperLU."""
DENSE_UP_TO = 400
"""Unknowns of a dense W up to which the LU of the whole costs less than a condensed elimination that serves one alpha only."""
ADAPTED = {"AC": "adaptive", "NM": "spectral norm"}
"""The rule for rho by formulation where a constant one has failed."""
INNER_ITERATIONS = 15
"""Newton iterations after which a regularised problem counts as too hard."""
RHO_FACTOR = 10.0
"""Times the contact's own stiffness: through the other contacts of its bodies a contact of a pile is stiffer than by itself (measured)."""


@njit(cache=True)
def _active_rows(
    W: FloatArray,
    starts: IntArray,
    columns: IntArray,
    shift: FloatArray,
    A: FloatArray,
    B: FloatArray,
    active: IntArray,
    place: IntArray,
    values: FloatArray,
    indices: IntArray,
    pointers: IntArray,
) -> int:
    """Fill the rows (CSR) of A (W + shift I) + B on the active contacts, place -1 for the others; return the number of entries."""
    d = W.shape[1]
    n = 0
    for row in range(len(active)):
        a = active[row]
        for i in range(d):
            pointers[row * d + i] = n
            for k in range(starts[a], starts[a + 1]):
                b = columns[k]
                if place[b] < 0:
                    continue
                for j in range(d):
                    value = 0.0
                    for l in range(d):
                        value += A[a, i, l] * W[k, l, j]
                    if b == a:
                        value += A[a, i, j] * shift[a] + B[a, i, j]
                    values[n] = value
                    indices[n] = place[b] * d + j
                    n += 1
    pointers[len(active) * d] = n
    return n


@njit(cache=True)
def _active_matrix(W: FloatArray, shift: FloatArray, A: FloatArray, B: FloatArray, active: IntArray, J: FloatArray) -> None:
    """Fill J = A (W + shift I) + B on the active contacts, of a dense W."""
    d = A.shape[1]
    for row in range(len(active)):
        a = active[row]
        for i in range(d):
            line = J[row * d + i]
            line[:] = 0.0
            for l in range(d):
                factor = A[a, i, l]
                if factor != 0.0:
                    own = W[a * d + l]
                    for column in range(len(active)):
                        for j in range(d):
                            line[column * d + j] += factor * own[active[column] * d + j]
            for j in range(d):
                line[row * d + j] += A[a, i, j] * shift[a] + B[a, i, j]


class ShiftedMatrix(Protocol):
    """W + diag(shift), one number a contact (nc,), and Newton's linear system with it."""

    @property
    def diagonal_blocks(self) -> FloatArray:
        """The contacts' own blocks (nc, d, d)."""
        ...

    def regularise(self, shift: FloatArray) -> None:
        """Go on with another shift (nc,)."""
        ...

    def __matmul__(self, r: FloatArray) -> FloatArray: ...

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return dr with (A (W + diag(shift)) + B) dr = rhs, A, B, rhs as in `NewtonSystem`, and (W + diag(shift)) dr; SingularMatrix."""
        ...


class DenseShiftedSystem:
    """Of a dense W: LU on the contacts that are not open."""

    def __init__(self, W: FloatArray, dimension: int) -> None:
        self._W, self._d = np.ascontiguousarray(W), dimension
        self._blocks = diagonal_blocks(self._W, dimension)
        self.regularise(np.zeros(len(W) // dimension))

    def regularise(self, shift: FloatArray) -> None:
        self._shift, self._by_dof = shift, np.repeat(shift, self._d)

    @property
    def diagonal_blocks(self) -> FloatArray:
        return self._blocks + self._shift[:, None, None] * np.eye(self._d)

    def __matmul__(self, r: FloatArray) -> FloatArray:
        return self._W @ r + self._by_dof * r

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        active, rhs, dr = without_open(self, A, rhs)
        if len(active):
            J = np.empty((rhs.size, rhs.size))
            _active_matrix(self._W, self._shift, A, B, active, J)
            dr[active] = DenseLU(J.T, overwrite=True).solve_transposed(rhs.ravel()).reshape(rhs.shape)
        return dr.ravel(), self @ dr.ravel()


class ShiftedSystem:
    """Of a sparse W: SuperLU on the contacts that are not open."""

    def __init__(self, W: Any, dimension: int) -> None:
        d = self._d = dimension
        W = sp.bsr_array(W, blocksize=(d, d))
        n = W.shape[0] // d
        row = np.repeat(np.arange(n), np.diff(W.indptr))
        absent = np.setdiff1d(np.arange(n), row[row == W.indices])  # diagonal blocks that W does not store
        rows, columns = np.concatenate([row, absent]), np.concatenate([W.indices, absent])
        sort = np.lexsort((columns, rows))
        self._blocks = np.concatenate([W.data, np.zeros((len(absent), d, d))])[sort]
        self._columns = columns[sort].astype(np.int32)
        self._starts = np.searchsorted(rows[sort], np.arange(n + 1)).astype(np.int32)
        self._own = np.flatnonzero(rows[sort] == self._columns)
        self._values = np.empty(self._blocks.size)
        self._indices = np.empty(self._blocks.size, dtype=np.int32)
        self.regularise(np.zeros(n))

    def regularise(self, shift: FloatArray) -> None:
        self._shift = shift
        blocks = self._blocks.copy()
        blocks[self._own] += shift[:, None, None] * np.eye(self._d)
        m = self._d * len(shift)
        self._operator = sp.bsr_array((blocks, self._columns, self._starts), shape=(m, m))

    @property
    def diagonal_blocks(self) -> FloatArray:
        blocks: FloatArray = self._operator.data[self._own]
        return blocks

    def __matmul__(self, r: FloatArray) -> FloatArray:
        product: FloatArray = self._operator @ r
        return product

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        d = self._d
        active, rhs, dr = without_open(self, A, rhs)
        if len(active):
            place = np.full(len(A), -1, dtype=np.int32)
            place[active] = np.arange(len(active))
            k = len(active) * d
            pointers = np.empty(k + 1, dtype=np.int32)
            values, indices = self._values, self._indices
            n = _active_rows(self._blocks, self._starts, self._columns, self._shift, A, B, active, place, values, indices, pointers)
            # the rows are the columns of the transposed matrix
            transposed = sp.csc_array((values[:n], indices[:n], pointers), shape=(k, k))
            try:
                options = {"SymmetricMode": True}
                factor = spla.splu(transposed, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01, options=options)
            except RuntimeError as error:
                raise SingularMatrix(f"matrix of size {k} is singular: {error}") from None
            dr[active] = factor.solve(rhs.ravel(), trans="T").reshape(-1, d)
        return dr.ravel(), self @ dr.ravel()


class ShiftedSpace:
    """A Newton space with u = (W + diag(shift)) r + q."""

    def __init__(self, system: ShiftedMatrix, q: FloatArray, r: FloatArray) -> None:
        self._system = system
        self.u = system @ r + q

    def step(self, A: FloatArray, B: FloatArray, F: FloatArray) -> tuple[FloatArray, FloatArray]:
        dr, self._du = self._system.solve(A, B, -F)
        return dr, self._du

    def gradient(self, A: FloatArray, B: FloatArray, F: FloatArray) -> tuple[FloatArray, FloatArray]:
        raise SingularMatrix("regularised problems are solved without a safeguard")

    def move(self, t: float) -> None:
        self.u = self.u + t * self._du


def shifted_matrix(problem: LocalProblem) -> ShiftedMatrix | None:
    """The system on which Newton's iterations on regularised problems are cheapest; None where W is too large for it."""
    W, d = problem.W, problem.dimension
    if sp.issparse(W):
        return ShiftedSystem(W, d) if W.nnz <= SUPERLU_UP_TO else None
    return DenseShiftedSystem(W, d) if problem.m <= DENSE_UP_TO else None


class RegularisedNewton:
    """Solves the problems (W + alpha D, q - alpha D r_k), D the contacts' own compliances tr(W_aa) / d, by nonsmooth Newton.

    D makes the step of a heavy body's contact as long as that of a light one's; it is one number a contact, since another metric would
    turn the cone. Compliances that are not positive (both bodies held) are replaced by the mean of the others.
    """

    def __init__(self, problem: LocalProblem) -> None:
        self._problem = problem
        self._D = contact_compliance(problem)
        self._norm = float(np.linalg.norm(problem.q))
        self._system = shifted_matrix(problem)

    def solve(
        self, r: FloatArray, alpha: float, tol: float, formulation: str, outer: Monitor, adaptive: bool = False
    ) -> tuple[Iterate, Monitor]:
        """Return Newton's iterate from the centre r and its monitor, whose errors are relative to ||q|| of the problem itself.

        adaptive: rho is found out on the way; slower than what suits most contacts, but with that one single contacts may cycle.
        """
        problem, shift, d = self._problem, alpha * self._D, self._problem.dimension
        q = problem.q - np.repeat(shift, d) * r
        watch = Monitor(q, problem.mu, d, tol, floor=self._norm, time_limit=outer.time_limit, start=outer.start)
        rho = {"rho": ADAPTED[formulation]} if adaptive else {"rho_factor": RHO_FACTOR}
        options = NewtonOptions(formulation=formulation, max_iterations=INNER_ITERATIONS, **rho)
        if self._system is None:
            if sp.issparse(problem.W):
                W: Any = sp.bsr_array(problem.W + sp.diags_array(np.repeat(shift, d)), blocksize=(d, d))
            else:
                W = problem.W.copy()
                W.flat[:: len(W) + 1] += np.repeat(shift, d)
            return newton(LocalProblem(W, q, problem.mu, dimension=d), r, watch, options), watch
        self._system.regularise(shift)
        space = ShiftedSpace(self._system, q, r)
        return newton_iterations(space, r, self._system.diagonal_blocks, problem.mu, watch, options), watch
