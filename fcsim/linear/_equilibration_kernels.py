"""Loops over the entries of a sparse matrix that is equilibrated, compiled by numba."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def equilibrating_scale(indptr, indices, data, passes):
    """s (n,) for which the largest entries |s_i A_ij s_j| of rows and columns of a csr or csc matrix are about equal (Ruiz 2001)."""
    n = len(indptr) - 1
    scale, largest = np.ones(n), np.empty(n)
    for _ in range(passes):
        largest[:] = 0
        for i in range(n):
            for e in range(indptr[i], indptr[i + 1]):
                j = indices[e]
                scaled = abs(data[e]) * scale[i] * scale[j]
                if scaled > largest[i]:
                    largest[i] = scaled
                if scaled > largest[j]:
                    largest[j] = scaled
        for i in range(n):
            if largest[i] > 0:
                scale[i] /= np.sqrt(largest[i])
    return scale
