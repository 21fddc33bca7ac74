"""How work is cut for threads: by its size alone, so that no result depends on how many threads there are."""

from __future__ import annotations

import itertools

import numpy as np

from fcsim.arrays import IntArray

PIECES = 8
"""At most so many pieces are made of one piece of work: more threads than that have nothing to do."""


def pieces(size: int, least: int) -> list[tuple[int, int]]:
    """Cut range(size) into up to `PIECES` pieces (begin, end) of `least` or more: by the size alone, whatever the threads."""
    count = max(1, min(PIECES, size // max(least, 1)))
    ends = [size * k // count for k in range(count + 1)]
    return list(itertools.pairwise(ends))


def pieces_by_work(begins: IntArray, least: int) -> list[tuple[int, int]]:
    """As `pieces` of rows whose work is begins[k + 1] - begins[k]: pieces of about the same work."""
    rows, total = len(begins) - 1, int(begins[-1]) if len(begins) else 0
    count = max(1, min(PIECES, total // max(least, 1)))
    inner = np.searchsorted(begins, [total * k // count for k in range(1, count)])
    ends = [0, *(int(end) for end in inner), rows]
    return [(begin, end) for begin, end in itertools.pairwise(ends) if begin < end]
