"""Lists of unlike lengths, one after the other in one array, walked all at once."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import IntArray


def each_of(first: IntArray, count: IntArray) -> tuple[IntArray, IntArray]:
    """Numbers (n,) of lists and places (n,) of their entries, list after list: list k has the count[k] places from first[k] on."""
    row = np.repeat(np.arange(len(count)), count)
    return row, np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count) + first[row]


def of_same_key(known: IntArray, asked: IntArray) -> tuple[IntArray, IntArray]:
    """For each of `asked` (n,) the places in `known` that have its key, as pairs (place in asked, place in known)."""
    order = np.argsort(known, kind="stable")
    first = np.searchsorted(known[order], asked)
    row, place = each_of(first, np.searchsorted(known[order], asked, side="right") - first)
    return row, order[place]
