"""A mixed local problem without its equality constraints: l = -R^-1 (V^T r + s), so W - V R^-1 V^T and q - V R^-1 s."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, Matrix
from fcsim.linear.factors import DenseLU, SingularMatrix
from fcsim.problem.delassus import own_compliance
from fcsim.problem.problem import Answer, LocalProblem

DEPENDENT_UP_TO = 1_000_000
"""Entries of G up to which the constraints of a singular problem are looked at."""


@contextmanager
def dependent_constraints_told(G: Matrix | None) -> Generator[None]:
    """SingularMatrix of M with equality constraints G (n, p) says so where these are dependent."""
    try:
        yield
    except SingularMatrix as error:
        raise SingularMatrix(f"{error}{_dependent(G)}") from None


def _dependent(G: Matrix | None) -> str:
    """What there is to say of dependent columns of G (n, p), empty where they are not."""
    if G is None:
        return ""
    rows, p = sp.csr_array(G), G.shape[1]
    met = rows[np.flatnonzero(np.diff(rows.indptr))]
    if met.shape[0] * p > DEPENDENT_UP_TO:
        return ""
    rank = int(np.linalg.matrix_rank(met.toarray())) if met.shape[0] else 0
    if rank == p:
        return ""
    return f"; G: expected independent equality constraints G^T v + b = 0, got {p} of rank {rank}: leave {p - rank} out"


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
        R = problem.R if isinstance(problem.R, np.ndarray) else problem.R.toarray()
        solved = _solve_consistent(R, rhs)
        self._RV, self._Rs = solved[:, :-1], solved[:, -1]

    @property
    def mu(self) -> FloatArray:
        return self.problem.mu

    @property
    def dimension(self) -> int:
        return self.problem.dimension

    @cached_property
    def compliance(self) -> FloatArray:
        """tr / d (nc,) of the contacts' own blocks, see `Delassus.compliance`."""
        return own_compliance(np.einsum("aii->a", self.diagonal_blocks) / self.dimension)

    def answer(self, r: FloatArray) -> Answer:
        """u = W r + V l + q and l."""
        return Answer(self.velocity(r), multiplier=self.multiplier(r))

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
        return p.diagonal_blocks - np.einsum("aik,kaj->aij", V.reshape(p.nc, d, V.shape[1]), RV.reshape(len(RV), p.nc, d))

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
    if not len(R):  # of which there is no condition
        return np.zeros(rhs.shape)
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
