"""Sweeps through the fronts of the coarse matrix, compiled."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.linear._front_kernels import dot


@njit(cache=True, nogil=True)
def solve_fronts(values, sizes, borders, x):
    """Overwrite x with S^-1 x, in the order of the fronts.

    sizes (fronts, 2): each front's own unknowns and its border's; borders: the numbers of the latter, front after front; values: of each
    front F21 F11^-1 (border, own), then F11^-1 (own, own) and F12 (own, border), by rows.
    """
    gathered = np.empty(max(1, sizes.max()), dtype=x.dtype)
    first, at, edge = 0, 0, 0
    for f in range(len(sizes)):
        n, b = sizes[f]
        own = x[first : first + n]
        for i in range(b):
            x[borders[edge + i]] -= dot(values[at + i * n : at + (i + 1) * n], own)
        first, at, edge = first + n, at + n * (n + 2 * b), edge + b
    for f in range(len(sizes) - 1, -1, -1):
        n, b = sizes[f]
        first, at, edge = first - n, at - n * (n + 2 * b), edge - b
        own, inverse, above = x[first : first + n], at + b * n, gathered[:b]
        right = inverse + n * n
        for i in range(b):
            above[i] = x[borders[edge + i]]
        for i in range(n):
            own[i] -= dot(values[right + i * b : right + (i + 1) * b], above)
        below = gathered[:n]
        for i in range(n):
            below[i] = dot(values[inverse + i * n : inverse + (i + 1) * n], own)
        own[:] = below
