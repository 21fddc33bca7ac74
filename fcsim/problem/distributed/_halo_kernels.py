"""Sums of what ranks have of a vector, compiled.

every: what came from the ranks, one after the other: `count` numbers, and d values of each row that a rank sends; places (k, 2): numbers
of rows, counted through all ranks, and their ranks.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True)
def add_received(every, count, d, places, to, w):
    """Add the rows at `places` to the rows `to` (k,) of w (n,)."""
    for k in range(len(to)):
        at, row = places[k, 0] * d + (places[k, 1] + 1) * count, to[k] * d
        for i in range(d):
            w[row + i] += every[at + i]


@njit(cache=True, nogil=True)
def products(every, count, d, first, second):
    """The sum of the products of the rows at `first` with those at `second`."""
    total = 0.0
    for k in range(len(first)):
        a, b = first[k, 0] * d + (first[k, 1] + 1) * count, second[k, 0] * d + (second[k, 1] + 1) * count
        for i in range(d):
            total += every[a + i] * every[b + i]
    return total
