"""W of a patch from what ranks have of it, compiled."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

PART, SENT, ADDED = 120.0, 20.0, 50.0
"""Numbers of W of n contacts that are made, sent, and added to others, for n^2 of them, in time of n^3 that a solution takes; measured at
n = 128 to 202."""


@njit(cache=True, nogil=True)
def latest(sizes, known, solver):
    """When the last rank has solved its patches, of sizes (p,) contacts of which each rank knows known (p, ranks), where solver (p,) has
    them: parts that others wait for are made first, and meanwhile a rank that sends less makes its own; and the mean of all ranks."""
    ranks = known.shape[1]
    sent, own, later = np.zeros(ranks), np.zeros(ranks), np.zeros(ranks)
    for p in range(len(sizes)):
        s = solver[p]
        later[s] += float(sizes[p]) ** 3
        for rank in range(ranks):
            square = float(known[p, rank]) ** 2
            if rank == s:
                own[rank] += PART * square
            else:
                sent[rank] += (PART + SENT) * square
                later[s] += ADDED * square
    exchanged, last, total = sent.max(), 0.0, 0.0
    for rank in range(ranks):
        end = exchanged + max(0.0, own[rank] - (exchanged - sent[rank])) + later[rank]
        last, total = max(last, end), total + end
    return last, total / ranks


@njit(cache=True, nogil=True)
def solvers_of_patches(sizes, known):
    """The rank (p,) that solves each patch: from those that know most of its contacts on, one patch after another goes where that brings
    `latest` down most."""
    solver = np.empty(len(sizes), dtype=np.int64)
    for p in range(len(sizes)):
        solver[p] = np.argmax(known[p])
    least = latest(sizes, known, solver)
    while True:
        patch, rank, best = -1, -1, least
        for p in range(len(sizes)):
            before = solver[p]
            for s in range(known.shape[1]):
                solver[p] = s
                found = latest(sizes, known, solver)
                if found < best:
                    patch, rank, best = p, s, found
            solver[p] = before
        if patch < 0:
            return solver
        solver[patch], least = rank, best


@njit(cache=True, nogil=True)
def add_part(part, at, d, W):
    """Add part (k d, k d), blocks of contacts, to W at their places `at` (k,)."""
    for a in range(len(at)):
        for i in range(d):
            source, row = part[d * a + i], W[d * at[a] + i]
            for b in range(len(at)):
                for j in range(d):
                    row[d * at[b] + j] += source[d * b + j]


@njit(cache=True, nogil=True)
def lower(part):
    """The symmetric matrix part (n, n) by rows up to the diagonal (n (n + 1) / 2,)."""
    n, end = len(part), 0
    packed = np.empty(n * (n + 1) // 2)
    for i in range(n):
        row = part[i]
        for j in range(i + 1):
            packed[end + j] = row[j]
        end += i + 1
    return packed


@njit(cache=True, nogil=True)
def add_lower(packed, at, d, W):
    """As `add_part`, of a symmetric part as `lower` gives it."""
    e = 0
    for a in range(len(at)):
        for i in range(d):
            p = d * at[a] + i
            for b in range(a + 1):
                for j in range(d if b < a else i + 1):
                    q = d * at[b] + j
                    W[p, q] += packed[e]
                    if p != q:
                        W[q, p] += packed[e]
                    e += 1
