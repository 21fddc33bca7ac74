"""The many small blocks of a block diagonal matrix, as rigid bodies have in M: factored and solved with at once, by compiled loops."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit

from fcsim.arrays import BoolArray, FloatArray, IntArray

LARGEST = 6
"""Unknowns of a block up to which it is one of these: a rigid body's."""
LEAST_PIVOT, ASYMMETRIC = 1e-10, 1e-12
"""Pivots over diagonal entries below which, and asymmetry over the largest entry above which a block is left to LAPACK and its tests."""


@njit(cache=True)
def dense_blocks(indptr, indices, data, unknowns, place):
    """The diagonal blocks (count, s, s) of a csr or csc matrix on the components unknowns (count, s); place (n,): each one's in its own."""
    count, size = unknowns.shape
    blocks = np.zeros((count, size, size))
    for c in range(count):
        for row in range(size):
            for e in range(indptr[unknowns[c, row]], indptr[unknowns[c, row] + 1]):
                blocks[c, row, place[indices[e]]] += data[e]
    return blocks


@njit(cache=True)
def small_cholesky(blocks, least, asymmetric):
    """Factor the blocks (count, s, s) in place, A = L L^T with L in the lower triangle; returns which of them have one (count,).

    None has a block that is not symmetric to `asymmetric` times its largest entry or that has a pivot below `least` times its
    diagonal entry: positive semidefinite but for round-off.
    """
    count, size = blocks.shape[:2]
    regular = np.ones(count, dtype=np.bool_)
    for c in range(count):
        A = blocks[c]
        limit = asymmetric * np.abs(A).max()
        for i in range(size):
            for j in range(i):
                if not abs(A[i, j] - A[j, i]) <= limit:
                    regular[c] = False
        for j in range(size):
            entry = A[j, j]
            pivot = entry
            for k in range(j):
                pivot -= A[j, k] ** 2
            if not (regular[c] and pivot > 0 and pivot >= least * entry):  # numbers near the least float lose the share
                regular[c] = False
                break
            A[j, j] = np.sqrt(pivot)
            for i in range(j + 1, size):
                rest = A[i, j]
                for k in range(j):
                    rest -= A[i, k] * A[j, k]
                A[i, j] = rest / A[j, j]
    return regular


@njit(cache=True)
def small_solve(factors, unknowns, rhs, x):
    """x[unknowns[c]] = A_c^-1 rhs[unknowns[c]] for the factors L (count, s, s) of `small_cholesky`; rhs, x (n, k)."""
    size = factors.shape[1]
    y = np.empty(size)
    for c in range(len(factors)):
        L, own = factors[c], unknowns[c]
        for column in range(rhs.shape[1]):
            for i in range(size):
                y[i] = rhs[own[i], column]
                for j in range(i):
                    y[i] -= L[i, j] * y[j]
                y[i] /= L[i, i]
            for i in range(size - 1, -1, -1):
                for j in range(i + 1, size):
                    y[i] -= L[j, i] * y[j]
                y[i] /= L[i, i]
                x[own[i], column] = y[i]


@njit(cache=True)
def small_inverses(factors):
    """The inverses (count, s, s) of the blocks with the factors L of `small_cholesky`: L^-T L^-1, symmetric to the last bit."""
    count, size = factors.shape[:2]
    inverses = np.zeros((count, size, size))
    K = np.zeros((size, size))
    for c in range(count):
        L = factors[c]
        for j in range(size):  # K = L^-1
            K[j, j] = 1 / L[j, j]
            for i in range(j + 1, size):
                total = 0.0
                for k in range(j, i):
                    total -= L[i, k] * K[k, j]
                K[i, j] = total / L[i, i]
        for i in range(size):
            for j in range(i + 1):
                total = 0.0
                for k in range(i, size):
                    total += K[k, i] * K[k, j]
                inverses[c, i, j] = inverses[c, j, i] = total
    return inverses


@dataclass(frozen=True, eq=False)
class SmallBlocks:
    """Blocks of one size s: their unknowns (count, s) and the lower Cholesky factors (count, s, s)."""

    unknowns: IntArray
    factors: FloatArray

    @cached_property
    def inverses(self) -> FloatArray:
        """The blocks' inverses (count, s, s)."""
        inverses: FloatArray = small_inverses(self.factors)
        return inverses

    def solve(self, rhs: FloatArray, x: FloatArray) -> None:
        """Write the blocks' part of A^-1 rhs to x, both (n, k)."""
        small_solve(self.factors, self.unknowns, rhs, x)


def small_blocks(
    arrays: tuple[IntArray, IntArray, FloatArray], dofs: IntArray, start: IntArray, place: IntArray
) -> tuple[list[SmallBlocks], BoolArray]:
    """The blocks of 2 to `LARGEST` unknowns that are surely symmetric positive definite, by their size, and which components they are.

    arrays: row starts, columns, values of A (csr or csc); dofs, start, place: its components (`connected_components`).
    """
    size = np.diff(start)
    taken, found = np.zeros(len(size), dtype=bool), []
    for s in np.unique(size[(size > 1) & (size <= LARGEST)]):
        components = np.flatnonzero(size == s)
        unknowns = dofs[start[components, None] + np.arange(s)]
        factors = dense_blocks(*arrays, unknowns, place)
        regular = small_cholesky(factors, LEAST_PIVOT, ASYMMETRIC)
        if regular.any():
            found.append(SmallBlocks(unknowns[regular], factors[regular]))
        taken[components[regular]] = True
    return found, taken
