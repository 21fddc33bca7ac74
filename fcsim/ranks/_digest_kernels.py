"""A digest of numbers, compiled: it tells whether ranks have the same bits, several times as fast as one that nobody can forge."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

_P1, _P2, _P3 = np.uint64(11400714785074694791), np.uint64(14029467366897019727), np.uint64(1609587929392839161)
_LEFT, _RIGHT = np.uint64(31), np.uint64(33)


@njit(cache=True, nogil=True)
def mixed(lane, word):
    """The round of XXH64 (Y. Collet, doc/xxhash_spec.md)."""
    lane += word * _P2
    return ((lane << _LEFT) | (lane >> _RIGHT)) * _P1


@njit(cache=True, nogil=True)
def digest(words, out):
    """Write four lanes (4,) of the words (n,) to out, all uint64; word i goes to lane i mod 4, and its place counts."""
    a, b, c, d = _P1, _P2, _P3, np.uint64(len(words))
    n = len(words) // 4 * 4
    for i in range(0, n, 4):
        a, b, c, d = mixed(a, words[i]), mixed(b, words[i + 1]), mixed(c, words[i + 2]), mixed(d, words[i + 3])
    for i in range(n, len(words)):
        a = mixed(a, words[i])
    out[0], out[1], out[2], out[3] = a, b, c, d
