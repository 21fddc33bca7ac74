"""GMRES where each rank has a part of every vector: products of vectors are summed over the ranks, all else is their own."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from fcsim.arrays import FloatArray

GROWTH = 32
"""Vectors by which the basis' room grows."""
CANCELLED = 0.1
"""What Gram-Schmidt leaves of a vector's length where it is taken once more: classical Gram-Schmidt loses in orthogonality what that
cancels, and a target of 1e-5 asks for five digits."""


def gmres_over_ranks(
    product: Callable[[FloatArray], FloatArray],
    precondition: Callable[[FloatArray], FloatArray],
    rhs: FloatArray,
    summed: Callable[[FloatArray], FloatArray],
    accuracy: float,
    limit: int,
    enough: float,
) -> FloatArray | None:
    """Right-preconditioned GMRES for A x = rhs (k,) from x = 0, of which k are this rank's (Y. Saad, M. H. Schultz, SIAM J. Sci. Stat.
    Comput. 7, 1986), by classical Gram-Schmidt, twice where it cancels (J. W. Daniel, W. B. Gragg, L. Kaufman, G. W. Stewart, Math. Comp.
    30, 1976): two sums over the ranks for a vector, whatever their number.

    summed: numbers (j,) -> their sum over the ranks, the same bits on all. Return this rank's part of x with ||rhs - A x|| <= accuracy
    ||rhs||, in the recurrence's norm, or after `limit` iterations with <= enough ||rhs||; None where they do not get there.
    """
    beta = math.sqrt(float(summed(np.array([rhs @ rhs]))[0]))
    if beta == 0:
        return np.zeros_like(rhs)
    basis = np.empty((GROWTH + 1, len(rhs)))
    basis[0] = rhs / beta
    steps: list[FloatArray] = []
    R = np.zeros((limit, limit))  # of H = Q R, Q by Givens' rotations; c, s: theirs; g = Q^T beta e_1
    c, s, g = np.zeros(limit), np.zeros(limit), np.zeros(limit + 1)
    g[0] = beta
    for j in range(limit):
        if j + 1 == len(basis):
            basis = np.concatenate([basis, np.empty((GROWTH, len(rhs)))])
        known = basis[: j + 1]
        steps.append(precondition(known[j]))
        w = product(steps[j])
        along = summed(np.append(known @ w, w @ w))
        w -= along[:-1] @ known
        size, column = math.sqrt(float(summed(np.array([w @ w]))[0])), R[:, j]
        column[: j + 1] = along[:-1]
        if not math.isfinite(size):
            return None
        if size < CANCELLED * math.sqrt(float(along[-1])):
            again = summed(known @ w)
            w -= again @ known
            column[: j + 1] += again
            size = math.sqrt(float(summed(np.array([w @ w]))[0]))
        for i in range(j):
            column[i], column[i + 1] = c[i] * column[i] + s[i] * column[i + 1], c[i] * column[i + 1] - s[i] * column[i]
        diagonal = math.hypot(column[j], size)
        if diagonal == 0:
            return None
        c[j], s[j], column[j] = column[j] / diagonal, size / diagonal, diagonal
        g[j], g[j + 1] = c[j] * g[j], -s[j] * g[j]
        left = abs(float(g[j + 1]))
        if left <= accuracy * beta or (j + 1 == limit and left <= enough * beta):
            x = np.zeros_like(rhs)
            for y, step in zip(np.linalg.solve(R[: j + 1, : j + 1], g[: j + 1]), steps, strict=True):
                x += y * step
            return x
        if size == 0:
            return None
        basis[j + 1] = w / size
    return None
