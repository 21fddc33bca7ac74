"""Filling A (W + D) + B in one pass over W, in the storage that is eliminated; compiled.

For the many small factorisations of a proximal method selecting rows and columns would cost more than the factorisation.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def newton_blocks(indptr, indices, W, A, B):
    """The blocks (nnz, d, d) of A W + B, in 3D written out; W by block rows with every diagonal block."""
    d = W.shape[1]
    J = np.empty(W.shape)
    for a in range(len(indptr) - 1):
        for e in range(indptr[a], indptr[a + 1]):
            w, out = W[e], J[e]
            if d == 3:
                for i in range(3):
                    x, y, z = A[a, i, 0], A[a, i, 1], A[a, i, 2]
                    for j in range(3):
                        out[i, j] = x * w[0, j] + y * w[1, j] + z * w[2, j]
            else:
                for i in range(d):
                    for j in range(d):
                        value = 0.0
                        for l in range(d):
                            value += A[a, i, l] * w[l, j]
                        out[i, j] = value
            if indices[e] == a:
                for i in range(d):
                    for j in range(d):
                        out[i, j] += B[a, i, j]
    return J


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
