"""Whose body is whose: bodies cut into as many neighbourhoods of equal cost as there are ranks."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray


def partition(centres: FloatArray, costs: FloatArray, ranks: int) -> IntArray:
    """The rank (nb,) of each body, from centres (nb, d) and costs (nb,) >= 0: recursive coordinate bisection.

    A set of bodies is cut across its longest extent so that the costs of both sides are as the numbers of ranks there (M. J. Berger,
    S. H. Bokhari, IEEE Trans. Comput. C-36, 1987). Of bodies at one place the first goes first: every rank finds the same. Ranks beyond the
    number of bodies have none.
    """
    rank = np.zeros(len(costs), dtype=np.int64)
    sets = [(np.arange(len(costs)), 0, ranks)]
    while sets:
        bodies, first, count = sets.pop()
        if count == 1 or len(bodies) == 0:
            rank[bodies] = first
            continue
        extent = np.ptp(centres[bodies], axis=0)
        bodies = bodies[np.argsort(centres[bodies, int(np.argmax(extent))], kind="stable")]
        below = count // 2
        total = np.concatenate([[0.0], np.cumsum(costs[bodies])])
        cut = int(np.argmin(np.abs(total - total[-1] * below / count)))
        if len(bodies) >= count:  # no rank is left without a body where there are enough
            cut = min(max(cut, below), len(bodies) - (count - below))
        sets += [(bodies[:cut], first, below), (bodies[cut:], first + below, count - below)]
    return rank
