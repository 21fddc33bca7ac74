"""Choosing problems of graded difficulty: evenly over the range of difficulty, and over time within each class of difficulty.

Stratified systematic sampling (Cochran, Sampling Techniques, 3rd ed., 1977, chapters 5 and 8): deterministic for a given seed.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import BoolArray, IntArray, is_whole
from fcsim.brief import shown
from fcsim.errors import InputError


def choose(iterations: IntArray, solved: BoolArray, count: int, seed: int = 0) -> IntArray:
    """Return the places of `count` problems of the given (k,), which stand in the order of time, ascending.

    The range of log iterations is divided into round(sqrt(count)) classes of equal width, at most 10; unsolved problems form one more,
    the hardest. Classes get equal shares of `count`, and what a small class cannot take goes to the others. A class divides its share
    likewise among as many intervals of time, of equally many problems, and each interval is sampled systematically, from a start
    drawn by `seed`.
    """
    if not (is_whole(count, 0) and is_whole(seed, 0)):
        raise InputError(f"choose: expected whole numbers count and seed >= 0, got {shown(count)} and {shown(seed)}")
    k = len(iterations)
    if count >= k:
        return np.arange(k)
    rng = np.random.default_rng(seed)
    label = difficulty_classes(iterations, solved, int(np.clip(round(np.sqrt(count)), 1, 10)))
    intervals = int(label.max()) + 1
    when = np.arange(k) * intervals // k
    chosen = []
    for difficulty, quota in enumerate(shares(count, np.bincount(label, minlength=intervals), rng)):
        inside = label == difficulty
        for interval, part in enumerate(shares(quota, np.bincount(when[inside], minlength=intervals), rng)):
            members = np.flatnonzero(inside & (when == interval))
            chosen.append(members[systematic(len(members), part, rng)])
    return np.sort(np.concatenate(chosen))


def difficulty_classes(iterations: IntArray, solved: BoolArray, classes: int) -> IntArray:
    """Class of each problem (k,): 0 ... classes - 1 of equal width in log iterations, `classes` where unsolved."""
    label = np.full(len(iterations), classes, dtype=np.int64)
    if solved.any():
        level = np.log(np.maximum(iterations[solved], 1))
        width = np.ptp(level)
        # a problem at the upper end belongs to the last class
        label[solved] = np.minimum((level - level.min()) / width * classes, classes - 1) if width > 0 else 0
    return label


def shares(total: int, sizes: IntArray, rng: np.random.Generator) -> IntArray:
    """Divide `total` among cells that hold `sizes` (c,): equally, as far as they hold enough.

    What does not divide goes to cells that are spread evenly.
    """
    share = np.zeros(len(sizes), dtype=np.int64)
    total = min(total, int(sizes.sum()))
    while left := total - int(share.sum()):
        room = np.flatnonzero(share < sizes)
        if left < len(room):
            share[room[systematic(len(room), left, rng)]] += 1
        else:
            share[room] += np.minimum(left // len(room), sizes[room] - share[room])
    return share


def systematic(size: int, count: int, rng: np.random.Generator) -> IntArray:
    """`count` of 0 ... size - 1 at equal distances from a random start."""
    places = np.floor((np.arange(count) + rng.random()) * size / max(count, 1)).astype(np.int64)
    return np.minimum(places, size - 1)
