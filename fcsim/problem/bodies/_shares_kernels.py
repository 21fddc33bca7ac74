"""Loops over pairs of a body and a contact, compiled by numba."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def sides_of_pairs(first, contacts, bodies, side):
    """Write the bodies of each contact to bodies (nc, 2), -1 before, and which of the two each pair is to side (pairs,); False where a
    contact has more than two."""
    for b in range(len(first) - 1):
        for p in range(first[b], first[b + 1]):
            a = contacts[p]
            side[p] = 0 if bodies[a, 0] < 0 else 1
            if bodies[a, side[p]] >= 0:
                return False
            bodies[a, side[p]] = b
    return True


@njit(cache=True)
def add_modes(first, contacts, begins, unknowns, weights, begin, kind, L, side, G):
    """Write h L of the bodies begin, begin + 1, ... with the motions L[kind[0]], L[kind[1]], ... (n, k) to G (nc, d, 2 k), zero before."""
    d, k = G.shape[1], L.shape[2]
    for i in range(len(kind)):
        own = L[kind[i]]
        for p in range(first[begin + i], first[begin + i + 1]):
            a, at = contacts[p], k * side[p]
            for e in range(begins[p], begins[p + 1]):
                for j in range(d):
                    weight = weights[e, j]
                    for c in range(k):
                        G[a, j, at + c] += weight * own[unknowns[e], c]


@njit(cache=True, nogil=True)
def gather_forces(first, contacts, begins, unknowns, weights, bodies, x, forces):
    """Add h^T x of `bodies` (nb,) to forces (nb, n), for x (nc, d)."""
    d = x.shape[1]
    for i in range(len(bodies)):
        own = forces[i]
        for p in range(first[bodies[i]], first[bodies[i] + 1]):
            r = x[contacts[p]]
            for e in range(begins[p], begins[p + 1]):
                total = weights[e, 0] * r[0]
                for j in range(1, d):
                    total += weights[e, j] * r[j]
                own[unknowns[e]] += total


@njit(cache=True, nogil=True)
def spread_velocities(first, contacts, begins, unknowns, weights, bodies, velocities, of_pairs):
    """Write h v of `bodies` (nb,), v their rows of velocities (nb, n), to of_pairs (pairs, d), zero before."""
    d = of_pairs.shape[1]
    for i in range(len(bodies)):
        own = velocities[i]
        for p in range(first[bodies[i]], first[bodies[i] + 1]):
            for e in range(begins[p], begins[p + 1]):
                v = own[unknowns[e]]
                for j in range(d):
                    of_pairs[p, j] += weights[e, j] * v


@njit(cache=True)
def sum_of_pairs(pairs, of_pairs):
    """u (nc, d): the sum of of_pairs over the pairs (nc, 2) of each contact, -1 for none."""
    u = np.zeros((len(pairs), of_pairs.shape[1]))
    for a in range(len(pairs)):
        for s in range(2):
            if pairs[a, s] >= 0:
                u[a] += of_pairs[pairs[a, s]]
    return u
