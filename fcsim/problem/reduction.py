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

from fcsim.arrays import BoolArray, FloatArray, Matrix
from fcsim.brief import brief, refused
from fcsim.errors import InputError
from fcsim.linear.late.late_rows import source_of
from fcsim.linear.sparse.behind import first_rows
from fcsim.linear.sparse.by_ranks import times_by_ranks, transposed_times_by_ranks
from fcsim.linear.sparse.columns import entries_of_rows, met_twice_beyond, times
from fcsim.problem.bodies.block_factor import BlockFactor as BlockFactor
from fcsim.problem.bodies.late import LateSum
from fcsim.problem.bodies.shares import BodyShares, KnownShares
from fcsim.problem.delassus import diagonal_blocks, own_compliance
from fcsim.problem.elimination import Elimination, dependent_constraints_told
from fcsim.problem.motion import Motion
from fcsim.problem.problem import Answer, Followed, GlobalForm, GlobalProblem, LocalProblem, Reduced
from fcsim.runtime import limited_threads

CONTACTS_AT_ONCE = 1000
"""Contacts whose own blocks of W are computed together where W as a whole is not wanted."""
FEW, FEW_OF_LARGE, LARGE_FROM = 0.6, 0.5, 3000
"""Velocities a contact unknown up to which methods may work in the bodies' velocities, those in large problems, a large one's unknowns."""


class MassFactor(Protocol):
    """What stands for M^-1: by blocks of M for a file, by the parts' factors in a simulation."""

    def solve(self, rhs: FloatArray) -> FloatArray: ...

    def delassus(self, H: sp.sparray, dimension: int) -> Matrix: ...

    def shares(self, H: sp.sparray, dimension: int) -> Callable[[], BodyShares] | None:
        """What makes the bodies' shares of W = H^T M^-1 H, None where W is not their sum alone or that is not known."""
        ...


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
