"""From the global to the local form: W = H^T M^-1 H, q = w + H^T M^-1 f, body by body.

A global FCLIB file knows nothing of bodies, but its M is block diagonal over them: the blocks are the connected components of M's
graph. Blocks that are equal up to round-off are recognised and factored once, and a block's compliance is formed only on the degrees
of freedom that H touches.
Equality constraints G^T v + b = 0 are part of the factored matrix [[M, -G], [-G^T, 0]].
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from fcsim._kernels import add_tile, add_tile_to_block_rows, congruence, union_of_neighbours
from fcsim.linear import DENSE_UP_TO, DenseCholesky, DenseLU, Factor, SingularMatrix, factorise, inverse_on
from fcsim.problem import GlobalProblem, LocalProblem

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

DENSE_W_UP_TO = 3000
"""Up to this many contact unknowns W is stored dense (72 MB), above as block-sparse rows."""
SPARSE_FROM, FILLED = 1000, 0.4
"""Contact unknowns from which, and share of its blocks below which, W is stored by block rows: less to write, and to read in products."""


EQUAL = 1e-13
"""Blocks of M whose entries differ by less, relative to the largest, are one body's (5e-15 to 1e-14 between the blocks of a wall)."""


class MassFactor(Protocol):
    """What stands for M^-1: by blocks of M for a file, by the parts' factors in a simulation."""

    def solve(self, rhs: FloatArray) -> FloatArray: ...

    def delassus(self, H: Any, dimension: int) -> Any: ...


def assemble_delassus(tiles: Iterable[tuple[IntArray, FloatArray]], nc: int, dimension: int) -> Any:
    """Sum the bodies' tiles (contacts (k,), W_body (k d, k d)) into W (m, m): dense up to `DENSE_W_UP_TO`, else block-sparse.

    W is block-sparse from `SPARSE_FROM` unknowns on already where less than the share `FILLED` of its blocks is there.
    """
    d = dimension
    parts = list(tiles)
    entries = sum(len(contacts) ** 2 for contacts, _ in parts)
    if nc * d <= DENSE_W_UP_TO and not (nc * d > SPARSE_FROM and entries < FILLED * nc**2):
        W = np.zeros((nc * d, nc * d))
        for contacts, tile in parts:
            add_tile(W, contacts, tile, d)
        return W
    if not parts:
        return sp.bsr_array((nc * d, nc * d), blocksize=(d, d))
    members = np.concatenate([contacts for contacts, _ in parts])
    first = np.concatenate([[0], np.cumsum([len(contacts) for contacts, _ in parts])])
    owner = np.repeat(np.arange(len(parts)), np.diff(first))
    by_contact = np.argsort(members, kind="stable")
    first_tile = np.searchsorted(members[by_contact], np.arange(nc + 1))
    indptr, columns = union_of_neighbours(first_tile, owner[by_contact], first, members, nc)
    blocks = np.zeros((len(columns), d, d))
    place = np.empty(nc, dtype=np.int64)
    for k, (contacts, tile) in enumerate(parts):
        add_tile_to_block_rows(indptr, columns, blocks, contacts, np.ascontiguousarray(tile), d, place)
        parts[k] = (contacts, np.empty((0, 0)))  # tiles are as large as W together
    return sp.bsr_array((blocks, columns, indptr), shape=(nc * d, nc * d), blocksize=(d, d))


@dataclass(frozen=True)
class _Block:
    """Degrees of freedom of the components that share one factor: dofs (copies, size)."""

    dofs: IntArray
    factor: Factor


class BlockFactor:
    """Factor of a block diagonal sparse matrix A whose blocks are found as connected components; equal blocks are factored once.

    Copies of a body that stand elsewhere were assembled with other round-off: blocks that differ by no more than that (`EQUAL`) share
    a factor too, and `solve` then corrects x by the residual of A itself.
    """

    def __init__(self, A: Any, touched: BoolArray | None = None) -> None:
        """touched (n,): degrees of freedom on which A^-1 will be asked for by `delassus`; it is the cheaper for knowing them."""
        A = sp.csr_array(A)
        A.sort_indices()
        self.n = A.shape[0]
        count, label = connected_components(A, directed=False)
        size = np.bincount(label, minlength=count)
        dofs = np.argsort(label, kind="stable")
        start = np.concatenate([[0], np.cumsum(size)])
        single = dofs[start[:-1][size == 1]]
        diagonal = A.diagonal()[single]
        if np.any(diagonal == 0):
            raise SingularMatrix(f"M is singular: zero rows, the first is degree of freedom {int(single[diagonal == 0][0])}")
        self._single, self._inverse_diagonal = single, 1 / diagonal
        kinds: dict[tuple[int, str], list[tuple[list[IntArray], Any]]] = {}
        position = np.empty(self.n, dtype=np.int64)
        exact = True
        for c in np.flatnonzero(size > 1):
            own = dofs[start[c] : start[c + 1]]
            position[own] = np.arange(len(own))
            rows = A[own]
            block = sp.csr_array((rows.data, position[rows.indices], rows.indptr), shape=(len(own), len(own)))
            # the trace tells most of the different ones apart
            alike = kinds.setdefault((len(own), f"{block.trace():.6e}"), [])
            for copies, first in alike:
                difference = _difference(first, block)
                if difference <= EQUAL:
                    copies.append(own)
                    exact = exact and difference == 0
                    break
            else:
                alike.append(([own], block))
        touched = np.zeros(self.n, dtype=bool) if touched is None else touched
        self.blocks = []
        for copies, block in (kind for alike in kinds.values() for kind in alike):
            own = np.array(copies)
            self.blocks.append(_Block(own, _factor(block, np.flatnonzero(touched[own].any(axis=0)))))
        self._refined = None if exact else A

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Return A^-1 rhs for rhs (n,) or (n, k)."""
        x = self._solve(rhs)
        if self._refined is not None:
            x += self._solve(rhs - self._refined @ x)
        return x

    def _solve(self, rhs: FloatArray) -> FloatArray:
        columns = rhs.reshape(self.n, -1)
        x = np.empty_like(columns)
        x[self._single] = self._inverse_diagonal[:, None] * columns[self._single]
        for block in self.blocks:
            copies, size = block.dofs.shape
            stacked = columns[block.dofs].transpose(1, 0, 2).reshape(size, -1)
            x[block.dofs] = block.factor.solve(stacked).reshape(size, copies, -1).transpose(1, 0, 2)
        return x.reshape(rhs.shape)

    def delassus(self, H: Any, dimension: int) -> Any:
        """Return W = H^T A^-1 H (m, m) for sparse H (n, m)."""
        H = sp.csr_array(H)
        nc = H.shape[1] // dimension
        return assemble_delassus(self._tiles(H, dimension), nc, dimension)

    def _tiles(self, H: Any, d: int) -> Iterable[tuple[IntArray, FloatArray]]:
        single = H[self._single]
        if single.nnz:
            yield from _component_tiles(single, self._inverse_diagonal, d)
        for block in self.blocks:
            size = block.dofs.shape[1]
            rows = [sp.csr_array(H[own]) for own in block.dofs]
            touched = np.unique(np.concatenate([np.flatnonzero(np.diff(h.indptr)) for h in rows]))
            if not len(touched):
                continue
            compliance = inverse_on(touched, block.factor, size)
            symmetric = isinstance(block.factor, DenseCholesky)
            for h in rows:
                h = sp.csc_array(h[touched])
                contacts = np.unique(np.flatnonzero(np.diff(h.indptr)) // d)
                if len(contacts):
                    h = h[:, (contacts[:, None] * d + np.arange(d)).ravel()]
                    h = sp.csr_array(h.T)
                    if symmetric:
                        yield contacts, congruence(h.indptr, h.indices, h.data, compliance)
                    else:
                        yield contacts, h @ (h @ compliance.T).T


def _component_tiles(H: Any, inverse_diagonal: FloatArray, d: int) -> Iterable[tuple[IntArray, FloatArray]]:
    """Tiles of dofs that M couples to nothing: rows of H that share contacts are taken together (a rigid body's dofs)."""
    H = sp.csr_array(H)
    nc = H.shape[1] // d
    incidence = sp.csr_array((np.ones(H.nnz), H.indices // d, H.indptr.copy()), shape=(H.shape[0], nc))
    # dofs with the same set of contacts belong to one rigid body: group by that set
    incidence.sum_duplicates()
    groups: dict[bytes, list[int]] = {}
    for row in range(H.shape[0]):
        contacts = incidence.indices[incidence.indptr[row] : incidence.indptr[row + 1]]
        if len(contacts):
            groups.setdefault(contacts.tobytes(), []).append(row)
    for members in groups.values():
        rows = np.array(members)
        contacts = np.unique(H[rows].indices // d).astype(np.int64)
        h = H[rows][:, (contacts[:, None] * d + np.arange(d)).ravel()].toarray()
        yield contacts, h.T @ (inverse_diagonal[rows, None] * h)


def _difference(A: Any, B: Any) -> float:
    """max |A - B| / max |A|."""
    if A.nnz == B.nnz and np.array_equal(A.data, B.data) and np.array_equal(A.indices, B.indices) and np.array_equal(A.indptr, B.indptr):
        return 0.0
    return float(np.abs((A - B).data).max(initial=0.0) / np.abs(A.data).max())


def _factor(block: Any, last: IntArray) -> Factor:
    factor = _fitting_factor(block, last)
    refuse_singular(block, factor)
    return factor


def _fitting_factor(block: Any, last: IntArray) -> Factor:
    if block.shape[0] > DENSE_UP_TO:
        return factorise(block)
    dense = block.toarray()
    if np.abs(dense - dense.T).max() <= 1e-12 * np.abs(dense).max():
        try:
            return DenseCholesky(dense, last)
        except SingularMatrix:  # indefinite, as with equality constraints
            return DenseLU(dense)
    return DenseLU(dense)


def refuse_singular(block: Any, factor: Factor) -> None:
    """Raise SingularMatrix where the factor does not find a known solution again.

    Round-off hides the zero pivot of most singular matrices, such as the stiffness of a body without supports. The known solution
    is random in the scaling that makes the rows' largest entries equal (Ruiz 2001), so that units and multipliers do not matter.
    """
    block = sp.coo_array(block)
    size, (row, column) = block.shape[0], block.coords
    magnitude, scale = np.abs(block.data), np.ones(size)
    for _ in range(5):
        scaled, largest = magnitude * scale[row] * scale[column], np.zeros(size)
        np.maximum.at(largest, row, scaled)
        np.maximum.at(largest, column, scaled)
        scale = scale / np.where(largest > 0, np.sqrt(largest), 1)
    known = scale[:, None] * np.random.default_rng(0).standard_normal((size, 2))
    found = factor.solve(block @ known)
    if not np.abs((found - known) / scale[:, None]).max() <= 1e-2:
        raise SingularMatrix(f"M is singular to working precision: a block of {size} degrees of freedom (a body without supports?)")


@dataclass(frozen=True, eq=False)
class Reduction:
    """A global problem with what stands for its M^-1: its local form, and v, l from r. `kept` as in `LocalProblem`."""

    problem: GlobalProblem
    factor: MassFactor
    kept: dict[str, Any] | None = None

    @cached_property
    def _H(self) -> Any:
        p = self.problem
        H = sp.csr_array(p.H)
        return H if p.G is None else sp.csr_array(sp.vstack([H, sp.csr_array((p.G.shape[1], p.m))]))

    @cached_property
    def _free(self) -> FloatArray:
        p = self.problem
        rhs = p.f if p.G is None or p.b is None else np.concatenate([p.f, p.b])
        return self.factor.solve(rhs)

    @cached_property
    def q(self) -> FloatArray:
        """q = w + H^T M^-1 f (m,)."""
        return self.problem.w + self._H.T @ self._free

    @property
    def diagonal_blocks(self) -> FloatArray:
        """The contacts' own blocks W_aa (nc, d, d)."""
        return self.local.diagonal_blocks

    @cached_property
    def local(self) -> LocalProblem:
        """The local form W, q, mu."""
        p = self.problem
        return LocalProblem(self.factor.delassus(self._H, p.dimension), self.q, p.mu, dimension=p.dimension, kept=self.kept)

    def velocity(self, r: FloatArray) -> tuple[FloatArray, FloatArray | None]:
        """Return v (n,) = M^-1 (H r + G l + f) and the multiplier l (p,), None without equality constraints."""
        x = self._free + self.factor.solve(self._H @ r)
        return (x, None) if self.problem.G is None else (x[: self.problem.n], x[self.problem.n :])

    def momentum_residual(self, r: FloatArray, v: FloatArray, multiplier: FloatArray | None) -> float:
        """Return ||M v - H r - G l - f|| / ||f||."""
        p = self.problem
        residual = p.M @ v - p.H @ r - p.f
        if p.G is not None:
            residual = residual - p.G @ multiplier
        scale = float(np.linalg.norm(p.f))
        return float(np.linalg.norm(residual)) / (scale or 1.0)


def reduce(problem: GlobalProblem, factor: MassFactor | None = None) -> Reduction:
    """Return the reduction of a global problem; `factor` is given by a simulation that has factored its parts already."""
    if factor is None:
        matrix = sp.csr_array(problem.M)
        if problem.G is not None:
            matrix = sp.csr_array(sp.block_array([[matrix, -sp.csr_array(problem.G)], [-sp.csr_array(problem.G).T, None]]))
        touched = np.zeros(matrix.shape[0], dtype=bool)
        touched[: problem.n] = np.diff(sp.csr_array(problem.H).indptr) > 0
        factor = BlockFactor(matrix, touched)
    return Reduction(problem, factor)


class Elimination:
    """A mixed local problem u = W r + V l + q, V^T r + R l + s = 0 with what stands for R^-1: its multiplier l and its form without l.

    R is singular where constraints are redundant. As long as s and the rows of V^T are in its range, which is so where
    [[W, V], [V^T, R]] comes from one positive semidefinite M^-1, V l is unique all the same; otherwise SingularMatrix is raised.
    """

    def __init__(self, problem: LocalProblem) -> None:
        if problem.V is None or problem.R is None or problem.s is None:
            raise ValueError("expected a problem with V, R and s")
        self.problem = problem
        V = sp.csr_array(problem.V)
        self._touched = np.flatnonzero(np.diff(V.indptr))  # the contact unknowns that the constraints meet
        self._V: FloatArray = V[self._touched].toarray()
        rhs = np.column_stack([self._V.T, problem.s])
        R = problem.R.toarray() if sp.issparse(problem.R) else problem.R
        solved = _solve_consistent(R, rhs)
        self._RV, self._Rs = solved[:, :-1], solved[:, -1]

    @cached_property
    def q(self) -> FloatArray:
        """q - V R^-1 s (m,): u without reactions."""
        q = self.problem.q.copy()
        q[self._touched] -= self._V @ self._Rs
        return q

    def multiplier(self, r: FloatArray) -> FloatArray:
        """l (p,) = -R^-1 (V^T r + s)."""
        return -self._RV @ r[self._touched] - self._Rs

    def velocity(self, r: FloatArray) -> FloatArray:
        """Return u (m,) = W r + V l + q."""
        u = self.problem.W @ r + self.problem.q
        u[self._touched] += self._V @ self.multiplier(r)
        return u

    @cached_property
    def diagonal_blocks(self) -> FloatArray:
        """The contacts' own blocks (nc, d, d) of W - V R^-1 V^T."""
        p, d = self.problem, self.problem.dimension
        V, RV = np.zeros((p.m, self._V.shape[1])), np.zeros((self._V.shape[1], p.m))
        V[self._touched], RV[:, self._touched] = self._V, self._RV
        return p.diagonal_blocks - np.einsum("aik,kaj->aij", V.reshape(p.nc, d, -1), RV.reshape(-1, p.nc, d))

    @cached_property
    def local(self) -> LocalProblem:
        """The problem with W - V R^-1 V^T, filled in only among the contact unknowns that the constraints meet, and no constraints."""
        p, d = self.problem, self.problem.dimension
        tile = self._V @ self._RV
        if isinstance(p.W, np.ndarray):
            W = p.W.copy()
            W[np.ix_(self._touched, self._touched)] -= tile
        else:
            rows, columns = np.repeat(self._touched, len(self._touched)), np.tile(self._touched, len(self._touched))
            W = sp.bsr_array(p.W - sp.csr_array((tile.ravel(), (rows, columns)), shape=p.W.shape), blocksize=(d, d))
        return LocalProblem(W, self.q, p.mu, dimension=d)


def _solve_consistent(R: FloatArray, rhs: FloatArray) -> FloatArray:
    """Return R^-1 rhs, or the least solution of a singular R whose range holds rhs; otherwise SingularMatrix."""
    size = float(np.abs(rhs).max(initial=0.0))
    try:
        solved = DenseLU(R).solve(rhs)
        if np.abs(R @ solved - rhs).max(initial=0.0) <= 1e-10 * size and np.linalg.cond(R) < 1e12:
            return solved
    except SingularMatrix:
        pass
    solved = np.linalg.lstsq(R, rhs, rcond=1e-10)[0]
    if not np.abs(R @ solved - rhs).max(initial=0.0) <= 1e-8 * size:
        raise SingularMatrix(f"R of {len(R)} equality constraints is singular, and V and s are not in its range: l is not determined by r")
    return solved


def eliminate_equalities(problem: LocalProblem) -> LocalProblem:
    """Return the local problem without V, R, s: l = -R^-1 (V^T r + s), so W - V R^-1 V^T and q - V R^-1 s."""
    return problem if problem.V is None else Elimination(problem).local
