"""Filling A (W + D) + B on the active contacts in one pass over W, in the storage that LAPACK or SuperLU reads; compiled.

For the many small factorisations of a proximal method selecting rows and columns would cost more than the factorisation.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

from numba import njit


@njit(cache=True)
def active_rows(W, starts, columns, shift, A, B, active, place, values, indices, pointers):
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
def active_matrix(W, shift, A, B, active, J):
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
