"""Small pieces of a step's work, each done by one rank for all of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.ranks.sharing import world


def shared_out(what: str, tasks: Sequence[tuple[int, Callable[[], FloatArray]]]) -> list[FloatArray]:
    """What tasks return, in their order: an array of so many numbers each. Rank k of n does those numbered k, k + n, ..., so that every
    rank has the bits that one process would have; an error of one is every rank's. Tasks exchange nothing themselves; all ranks must ask.

    An exchange takes a tenth of a millisecond: tasks should take more.
    """
    ranks = world()
    if ranks is None:
        return [task() for _, task in tasks]
    own, everyones = np.empty(0), list(range(len(tasks)))
    by_rank = [everyones[k :: ranks.size] for k in range(ranks.size)]
    with ranks.together(what):
        own = np.concatenate([own, *(tasks[k][1]() for k in by_rank[ranks.number])])
    sizes = [size for size, _ in tasks]
    every = ranks.gathered(own, np.array([sum(sizes[k] for k in some) for some in by_rank]))
    order = [k for some in by_rank for k in some]
    parts = np.split(every, np.cumsum([sizes[k] for k in order])[:-1])
    return [part for _, part in sorted(zip(order, parts, strict=True), key=lambda both: both[0])]
