"""Boxes that meet, compiled: bodies by sweeping along an axis, then the vertices, facets and edges of each pair of bodies."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import FloatArray, IntArray

_FEW = 32  # below this many on either side all pairs are looked at, without sorting


@njit(cache=True)
def _grown(array: IntArray) -> IntArray:
    larger = np.empty((2 * len(array), array.shape[1]), dtype=np.int64)
    for i in range(len(array)):
        for j in range(array.shape[1]):
            larger[i, j] = array[i, j]
    return larger


@njit(cache=True)
def _meet(low_a: FloatArray, high_a: FloatArray, low_b: FloatArray, high_b: FloatArray, by: float) -> bool:
    apart = False
    for i in range(3):
        apart = apart or low_a[i] > high_b[i] + by or low_b[i] > high_a[i] + by
    return not apart


@njit(cache=True)
def body_pairs(low: FloatArray, high: FloatArray, reach: FloatArray, order: IntArray, axis: int) -> IntArray:
    """Pairs (np, 2), first < second, of bodies whose boxes come within reach_a + reach_b; low, high (nb, 3), reach (nb,) [m].

    order: the bodies sorted by low - reach along `axis`. Sweep and prune: cost nb times the bodies that overlap along the axis.
    """
    found = np.empty((max(64, 4 * len(order)), 2), dtype=np.int64)
    n = 0
    for place in range(len(order)):
        a = order[place]
        end = high[a, axis] + reach[a]
        for k in range(place + 1, len(order)):
            b = order[k]
            if low[b, axis] - reach[b] > end:
                break
            if _meet(low[a], high[a], low[b], high[b], reach[a] + reach[b]):
                if n == len(found):
                    found = _grown(found)
                found[n, 0], found[n, 1] = min(a, b), max(a, b)
                n += 1
    return found[:n].copy()


@njit(cache=True)
def _inside_box(first: int, last: int, low: FloatArray, high: FloatArray, box_low: FloatArray, box_high: FloatArray, by: float) -> IntArray:
    """Which of the items first ... last - 1 come within `by` of a box."""
    chosen = np.empty(last - first, dtype=np.int64)
    n = 0
    for item in range(first, last):
        if _meet(low[item], high[item], box_low, box_high, by):
            chosen[n] = item
            n += 1
    return chosen[:n]


@njit(cache=True)
def _sorted_along(low: FloatArray, items: IntArray, axis: int) -> IntArray:
    """The items by their lower ends along an axis; of equal ones the first stays the first."""
    ends = np.empty(len(items))
    for k in range(len(items)):
        ends[k] = low[items[k], axis]
    order = np.argsort(ends, kind="mergesort")
    found = np.empty_like(items)
    for k in range(len(items)):
        found[k] = items[order[k]]
    return found


@njit(cache=True)
def item_pairs(
    pairs: IntArray,
    body_low: FloatArray,
    body_high: FloatArray,
    first_a: IntArray,
    low_a: FloatArray,
    high_a: FloatArray,
    first_b: IntArray,
    low_b: FloatArray,
    high_b: FloatArray,
    near: FloatArray,
    reach: FloatArray,
) -> IntArray:
    """Rows (item of body a, item of body b, pair) of items whose boxes come within reach, for each pair (a, b) of bodies.

    Items of body k are first[k] ... first[k + 1] - 1 with boxes low, high (n, 3). near (np,): items of a count within that of b's box;
    reach (np,) [m]: of each other. Many items are sorted along the longest axis of what they have in common.
    """
    found = np.empty((max(64, 8 * len(pairs)), 3), dtype=np.int64)
    n = 0
    for p in range(len(pairs)):
        a, b = pairs[p]
        ours = _inside_box(first_a[a], first_a[a + 1], low_a, high_a, body_low[b], body_high[b], near[p])
        if len(ours) == 0:
            continue
        theirs = _inside_box(first_b[b], first_b[b + 1], low_b, high_b, body_low[a], body_high[a], max(near[p], reach[p]))
        if len(theirs) == 0:
            continue
        axis = 0
        sweep = len(ours) > _FEW and len(theirs) > _FEW
        longest = 0.0
        if sweep:  # both sorted by their lower ends along the axis on which b's items are spread most
            widest = -1.0
            for i in range(3):
                least, most = low_b[theirs[0], i], low_b[theirs[0], i]
                for item in theirs:
                    least, most = min(least, low_b[item, i]), max(most, low_b[item, i])
                if most - least > widest:
                    widest, axis = most - least, i
            theirs, ours = _sorted_along(low_b, theirs, axis), _sorted_along(low_a, ours, axis)
            for item in theirs:
                longest = max(longest, high_b[item, axis] - low_b[item, axis])
        start = 0
        for item in ours:
            if sweep:
                while start < len(theirs) and low_b[theirs[start], axis] < low_a[item, axis] - longest - reach[p]:
                    start += 1
            for k in range(start, len(theirs)):
                other = theirs[k]
                if sweep and low_b[other, axis] > high_a[item, axis] + reach[p]:
                    break
                if _meet(low_a[item], high_a[item], low_b[other], high_b[other], reach[p]):
                    if n == len(found):
                        found = _grown(found)
                    found[n, 0], found[n, 1], found[n, 2] = item, other, p
                    n += 1
    return found[:n].copy()
