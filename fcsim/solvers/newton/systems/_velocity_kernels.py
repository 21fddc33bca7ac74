"""Adding the contacts' shares h^T K h to a matrix of the bodies' velocities, compiled."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def add_shares(S, unknowns, h, K):
    """Add h_a^T K_a h_a of every contact to S (n, n): h (nc, d, k) on the unknowns (nc, k), -1 where a contact has fewer; K (nc, d, d)."""
    nc, d, k = h.shape
    Kh = np.empty((d, k))
    for a in range(nc):
        for i in range(d):
            for j in range(k):
                total = 0.0
                for l in range(d):
                    total += K[a, i, l] * h[a, l, j]
                Kh[i, j] = total
        for i in range(k):
            row = unknowns[a, i]
            if row < 0:
                break
            for j in range(k):
                column = unknowns[a, j]
                if column < 0:
                    break
                total = 0.0
                for l in range(d):
                    total += h[a, l, i] * Kh[l, j]
                S[row, column] += total
