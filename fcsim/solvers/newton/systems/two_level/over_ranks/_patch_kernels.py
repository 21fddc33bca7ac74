"""W of a patch from what ranks have of it, compiled."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True)
def add_part(part, at, d, W):
    """Add part (k d, k d), blocks of contacts, to W at their places `at` (k,)."""
    for a in range(len(at)):
        for i in range(d):
            source, row = part[d * a + i], W[d * at[a] + i]
            for b in range(len(at)):
                for j in range(d):
                    row[d * at[b] + j] += source[d * b + j]
