"""From the global to the local form: W = H^T M^-1 H, q = w + H^T M^-1 f, body by body.

A global FCLIB file knows nothing of bodies, but its M is block diagonal over them: the blocks are the connected components of M's
graph. Blocks that are equal up to round-off are recognised and factored once, and a block's compliance is formed only on the degrees
of freedom that H touches; rigid bodies' blocks of up to six unknowns are factored all at once.
Equality constraints G^T v + b = 0 are part of the factored matrix [[M, -G], [-G^T, 0]].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray, Matrix
from fcsim.brief import brief, refused
from fcsim.errors import InputError
from fcsim.linear import storage
from fcsim.linear.factors import DenseCholesky, DenseLU, Factor, SingularMatrix, factorise, inverse_on
from fcsim.linear.late.late_rows import source_of
from fcsim.linear.singularity import refuse_singular
from fcsim.linear.small_blocks import small_blocks
from fcsim.linear.sparse.behind import first_rows
from fcsim.linear.sparse.by_ranks import times_by_ranks, transposed_times_by_ranks
from fcsim.linear.sparse.columns import entries_of_rows, met_twice_beyond, times
from fcsim.problem._reduction_kernels import alike_in_contacts, asymmetry, block_of, connected_components, equal_blocks
from fcsim.problem.bodies.late import LateSum
from fcsim.problem.bodies.shares import BodyShares, KnownShares
from fcsim.problem.delassus import diagonal_blocks, own_compliance
from fcsim.problem.delassus_sum import DelassusSum
from fcsim.problem.elimination import Elimination, dependent_constraints_told
from fcsim.problem.motion import Motion
from fcsim.problem.problem import Answer, Followed, GlobalForm, GlobalProblem, LocalProblem, Reduced
from fcsim.runtime import limited_threads

CONTACTS_AT_ONCE = 1000
"""Contacts whose own blocks of W are computed together where W as a whole is not wanted."""
FEW, FEW_OF_LARGE, LARGE_FROM = 0.6, 0.5, 3000
"""Velocities a contact unknown up to which methods may work in the bodies' velocities, those in large problems, a large one's unknowns."""
EQUAL = 1e-13
"""Blocks of M whose entries differ by less, relative to the largest, are one body's (5e-15 to 1e-14 between the blocks of a wall)."""


class MassFactor(Protocol):
    """What stands for M^-1: by blocks of M for a file, by the parts' factors in a simulation."""

    def solve(self, rhs: FloatArray) -> FloatArray: ...

    def delassus(self, H: sp.sparray, dimension: int) -> Matrix: ...

    def shares(self, H: sp.sparray, dimension: int) -> Callable[[], BodyShares] | None:
        """What makes the bodies' shares of W = H^T M^-1 H, None where W is not their sum alone or that is not known."""
        ...


@dataclass(frozen=True)
class _Block:
    """Degrees of freedom of the components that share one factor: dofs (copies, size), in the factor's order."""

    dofs: IntArray
    factor: Factor


class BlockFactor:
    """Factor of a block diagonal sparse matrix A whose blocks are found as connected components; equal blocks are factored once,
    small ones (`small_blocks`) each for itself.

    Copies of a body that stand elsewhere were assembled with other round-off: blocks that differ by no more than that (`EQUAL`) share
    a factor too, and `solve` then corrects x by the residual of A itself.
    """

    def __init__(self, A: Matrix, touched: BoolArray | None = None) -> None:
        """touched (n,): degrees of freedom on which A^-1 will be asked for by `delassus`; it is the cheaper for knowing them."""
        if isinstance(A, np.ndarray) or A.format not in ("csr", "csc"):
            A = sp.csr_array(A)
        if not A.has_sorted_indices:
            A = A.sorted_indices()
        self.n = A.shape[0]
        arrays = A.indptr, A.indices, A.data  # by rows or by columns, which is all the same up to the blocks' storage
        dofs, start, place = connected_components(A.indptr, A.indices)
        size = np.diff(start)
        self._single = dofs[start[:-1][size == 1]]
        self._inverse_diagonal = 1 / _diagonal(A, self._single)
        self._small, taken = small_blocks(arrays, dofs, start, place)
        kind, exact = equal_blocks(*arrays, dofs, start, place, (size > 1) & ~taken, EQUAL)
        self.blocks = []
        for k in range(kind.max(initial=-1) + 1):
            copies = np.flatnonzero(kind == k)
            own = dofs[start[copies, None] + np.arange(size[copies[0]])]
            if touched is not None:
                last = touched[own].any(axis=0)  # eliminated last: see inverse_on_last
                own = np.take(own, np.argsort(last, kind="stable"), axis=1)
            starts, indices, values = block_of(*arrays, own[0], place)
            self.blocks.append(_Block(own, _factor(type(A)((values, indices, starts), shape=(len(own[0]), len(own[0]))))))
        self._refined = None if exact else A

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Return A^-1 rhs for rhs (n,) or (n, k)."""
        x = self._solve(rhs)
        if self._refined is not None:
            x += self._solve(rhs - self._refined @ x)
        return x

    def _solve(self, rhs: FloatArray) -> FloatArray:
        columns = rhs.reshape(self.n, rhs.size // self.n if self.n else 0)
        x = np.empty_like(columns)
        x[self._single] = self._inverse_diagonal[:, None] * columns[self._single]
        for small in self._small:
            small.solve(columns, x)
        for block in self.blocks:
            copies, size = block.dofs.shape
            stacked = columns[block.dofs].transpose(0, 2, 1).reshape(-1, size).T  # (size, copies k) in LAPACK's order
            x[block.dofs] = block.factor.solve(stacked).T.reshape(copies, -1, size).transpose(0, 2, 1)
        return x.reshape(rhs.shape)

    def delassus(self, H: sp.sparray, dimension: int) -> Matrix:
        """Return W = H^T A^-1 H (m, m) for sparse H (n, m)."""
        H, d = H.tocsc(), dimension
        touched = np.zeros(self.n, dtype=bool)
        touched[H.indices] = True
        body, column = np.empty(self.n, dtype=np.int64), np.empty(self.n, dtype=np.int64)  # where H touches them
        compliances, count = [], 0
        for block in self.blocks:
            copies, size = block.dofs.shape
            surface = np.flatnonzero(touched[block.dofs].any(axis=0))
            if len(surface):
                if isinstance(block.factor, DenseCholesky):
                    surface = np.arange(surface[0], size)
                body[block.dofs] = np.arange(count, count + copies)[:, None]
                column[block.dofs[:, surface]] = np.arange(len(surface))
                compliances.append((count, block, surface))
                count += copies
        begins = []
        for small in self._small:
            copies, size = small.unknowns.shape
            body[small.unknowns] = np.arange(count, count + copies)[:, None]
            column[small.unknowns] = np.arange(size)
            begins.append(count)
            count += copies
        # dofs that M couples to nothing are taken together where they touch the same contacts: a rigid body's
        group = alike_in_contacts(H.indptr, H.indices, self.n, self._single, d)
        sizes = np.diff(group)
        body[self._single] = count + np.repeat(np.arange(len(sizes)), sizes)
        column[self._single] = np.arange(len(self._single)) - np.repeat(group[:-1], sizes)
        W = DelassusSum(H, body, column, count + len(sizes), d)
        for begin, block, surface in compliances:
            factor, copies = block.factor, np.zeros(len(block.dofs), dtype=np.int64)
            if isinstance(factor, DenseCholesky):
                W.add(begin, factor.inverse_on_last(len(surface))[None], copies)
            else:
                W.add(begin, inverse_on(surface, factor, block.dofs.shape[1])[None], copies, symmetric=False)
        for begin, small in zip(begins, self._small, strict=True):
            W.add(begin, small.inverses, np.arange(len(small.inverses)))
        if len(self._single):
            W.add_diagonal(count, self._inverse_diagonal, group)
        return W.matrix()

    def shares(self, H: sp.sparray, dimension: int) -> None:
        """None: compliances are not kept."""


def _diagonal(A: sp.sparray, single: IntArray) -> FloatArray:
    """The diagonal of the matrix A (csr or csc) on unknowns that it couples to nothing; SingularMatrix where it is zero."""
    first = A.indptr[single]
    diagonal = A.data[first] if np.array_equal(A.indptr[single + 1], first + 1) else A.diagonal()[single]
    if np.any(diagonal == 0):
        raise SingularMatrix(f"M is singular: zero rows, the first is degree of freedom {int(single[diagonal == 0][0])}")
    return diagonal


def _factor(block: sp.sparray) -> Factor:
    try:
        factor = _fitting_factor(block)
    except SingularMatrix as error:
        raise SingularMatrix(f"M is singular in a block of {block.shape[0]} degrees of freedom: {error}") from None
    refuse_singular(block, factor)
    return factor


def _fitting_factor(block: sp.sparray) -> Factor:
    if block.shape[0] > storage.BLOCK_UP_TO:
        return factorise(block)
    dense = block.toarray(order="C" if block.format == "csr" else "F")
    by_rows = dense if block.format == "csr" else dense.T
    if asymmetry(block.indptr, block.indices, block.data, by_rows) <= 1e-12:
        try:
            return DenseCholesky(by_rows.T, overwrite=True)
        except SingularMatrix:  # indefinite, as with equality constraints
            dense = block.toarray()
    return DenseLU(dense)


@dataclass(frozen=True, eq=False)
class Reduction:
    """A global problem with what stands for its M^-1: its local form, and v, l from r."""

    problem: GlobalForm
    factor: MassFactor

    __repr__, __reduce__ = brief, refused("problem", "local")

    @cached_property
    def _H(self) -> sp.sparray:
        p = self.problem
        H = p.H if sp.issparse(p.H) else sp.csr_array(p.H)
        return H if p.G is None else sp.csr_array(sp.vstack([H, sp.csr_array((p.G.shape[1], p.m))]))

    @cached_property
    def unloaded(self) -> FloatArray:
        """M^-1 f (n,), with equality constraints also the multiplier's part: what moves without reactions."""
        p = self.problem
        rhs = p.f if p.G is None or p.b is None else np.concatenate([p.f, p.b])
        return self.factor.solve(rhs)

    @cached_property
    def q(self) -> FloatArray:
        """q = w + H^T M^-1 f (m,)."""
        return self.problem.w + transposed_times_by_ranks(self._H, self.unloaded)

    @property
    def mu(self) -> FloatArray:
        return self.problem.mu

    @property
    def dimension(self) -> int:
        return self.problem.dimension

    @cached_property
    def diagonal_blocks(self) -> FloatArray:
        """The contacts' own blocks W_aa (nc, d, d): of `local` where that is there, else of some contacts at a time, without all of W."""
        p, d = self.problem, self.problem.dimension
        if "local" in self.__dict__:
            return self.local.diagonal_blocks
        H = self._H.tocsc()
        parts = [self.factor.delassus(H[:, d * a : d * (a + CONTACTS_AT_ONCE)], d) for a in range(0, max(p.nc, 1), CONTACTS_AT_ONCE)]
        return np.concatenate([diagonal_blocks(W, d) for W in parts])

    @cached_property
    def compliance(self) -> FloatArray:
        """tr(W_aa) / d (nc,), see `Delassus.compliance`."""
        return own_compliance(np.einsum("aii->a", self.diagonal_blocks) / self.dimension)

    def delassus(self, rows: int) -> Matrix:
        """The Delassus operator W (m, m), formed by blocks of 1, 2 or 3 rows: a contact's, or single ones."""
        return self.factor.delassus(self._H, rows)

    @cached_property
    def local(self) -> LocalProblem:
        """The local form W, q, mu; InputError for problems with rolling or spinning resistance."""
        p = self.problem
        W = self.delassus(p.dimension)
        return LocalProblem(W, self.q, p.mu, dimension=p.dimension, motion=_motion(p, W), shares=self._shares(W))

    def _shares(self, W: Matrix) -> KnownShares | None:
        """The bodies' shares of W: those that it is made of where its entries are made late."""
        if isinstance(source := source_of(W), LateSum):
            return KnownShares(W, lambda: source.shares)
        make = None if self.problem.G is not None else self.factor.shares(self._H, self.problem.dimension)
        return None if make is None else KnownShares(W, make)

    @limited_threads()
    def velocity(self, r: FloatArray) -> tuple[FloatArray, FloatArray | None]:
        """Return v (n,) = M^-1 (H r + G l + f) and the multiplier l (p,), None without equality constraints."""
        return self.split(self.unloaded + self.pushed(r))

    def pushed(self, r: FloatArray) -> FloatArray:
        """M^-1 H r (n,), as `unloaded`."""
        return self.factor.solve(times_by_ranks(self._H, r))

    def split(self, x: FloatArray) -> tuple[FloatArray, FloatArray | None]:
        """v (n,) and l (p,), None without equality constraints, of a solution x with the factor."""
        return (x, None) if self.problem.G is None else (x[: self.problem.n], x[self.problem.n :])

    @limited_threads()
    def answer(self, r: FloatArray) -> Answer:
        """u = H^T v + w with v, l and the momentum residual."""
        v, multiplier = self.split(self.unloaded + self.factor.solve(impulse := times_by_ranks(self._H, r)))
        u = transposed_times_by_ranks(self.problem.H, v) + self.problem.w
        return Answer(u, v, multiplier, self.momentum_residual(r, v, multiplier, impulse[: self.problem.n]))

    def momentum_residual(self, r: FloatArray, v: FloatArray, multiplier: FloatArray | None, impulse: FloatArray | None = None) -> float:
        """Return ||M v - H r - G l - f|| / ||f||; impulse (n,): H r, where it is known."""
        p = self.problem
        residual = p.momentum(v) - (times(p.H, r) if impulse is None else impulse) - p.f
        if p.G is not None and multiplier is not None:
            residual = residual - p.G @ multiplier
        scale = float(np.linalg.norm(p.f))
        return float(np.linalg.norm(residual)) / (scale or 1.0)


def _motion(problem: GlobalForm, W: Matrix) -> Motion | None:
    """H and M behind W, where degrees of freedom are few and no equality constraints couple them; those of bodies that no contact touches
    cost nothing and do not count, nor do those of a spring, which M couples to nothing and one contact unknown alone moves: they are
    compliances of that."""
    few = (FEW if problem.m < LARGE_FROM else FEW_OF_LARGE) * problem.m
    if problem.G is not None or met_twice_beyond(problem.H, few):
        return None
    H: sp.csr_array | sp.csc_array = problem.H if isinstance(problem.H, sp.csc_array) else sp.csr_array(problem.H)
    count = entries_of_rows(H)
    if not 0 < np.count_nonzero(count > 1) <= few and not 0 < np.count_nonzero(count) <= few:
        return None
    M = sp.csr_array(problem.entries)
    if 0 < np.count_nonzero(count) <= few:
        return Motion(sp.csr_array(H.T), M, W)
    diagonal = M.diagonal()
    alone = (np.diff(M.indptr) == 1) & (np.bincount(M.indices, minlength=problem.n) == 1) & (diagonal > 0)
    springs = np.flatnonzero(alone & (count == 1))
    bodies = np.setdiff1d(np.arange(problem.n), springs)
    if not 0 < np.count_nonzero(count[bodies]) <= few:
        return None
    H = sp.csr_array(H)
    place = H.indptr[springs]
    own = np.bincount(H.indices[place], H.data[place] ** 2 / diagonal[springs], minlength=problem.m)
    if bodies[-1] == (k := len(bodies)) - 1:  # all springs stand behind the bodies: no row is to be looked for
        return Motion(sp.csr_array(first_rows(H, k, problem.m).T), first_rows(M, k, k), W, own)
    return Motion(sp.csr_array(H[bodies].T), sp.csr_array(M[bodies][:, bodies]), W, own)


def _touched(H: Matrix) -> BoolArray:
    """Which rows of H (n, m), dense or sparse, have entries (n,)."""
    if not isinstance(H, np.ndarray) and H.format == "csc":
        return np.bincount(H.indices, minlength=H.shape[0]) > 0
    return np.diff(sp.csr_array(H).indptr) > 0


def reduce(problem: GlobalForm, factor: MassFactor | None = None) -> Reduction:
    """Return the reduction of a global problem; `factor` is given by a simulation that has factored its parts already."""
    if factor is None:
        matrix = problem.entries
        if problem.G is not None:
            matrix = sp.csr_array(sp.block_array([[matrix, -sp.csr_array(problem.G)], [-sp.csr_array(problem.G).T, None]]))
        touched = np.append(_touched(problem.H), np.zeros(matrix.shape[0] - problem.n, dtype=bool))
        with dependent_constraints_told(problem.G):
            factor = BlockFactor(matrix, touched)
    return Reduction(problem, factor)


def reduced(problem: GlobalProblem | LocalProblem | Reduction | Followed) -> Reduced:
    """A problem in whatever form with the way to its local form: its `Reduction`, its `Elimination` where it is mixed, else itself."""
    if isinstance(problem, GlobalProblem):
        return reduce(problem)
    if isinstance(problem, LocalProblem):
        return problem if problem.V is None else Elimination(problem)
    if isinstance(problem, Reduction | Followed):
        return problem
    raise InputError(f"problem: expected a GlobalProblem, a LocalProblem or a Reduction, got {type(problem).__name__}")
