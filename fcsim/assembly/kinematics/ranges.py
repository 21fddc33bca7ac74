"""Bodies in a row, by their degrees of freedom: what each rank does of work on all deformable bodies that every rank could do itself."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.groups import Group
from fcsim.ranks import World, for_parts, in_pieces, world

AT_ONCE = 48
"""Bodies in a row whose like ones are solved for together: last bits depend on how many right sides BLAS has at once, so that these are as
many on any number of ranks."""

SHARED_FROM = 20_000
"""Degrees of freedom from which ranks share: a product with K takes them a third of a millisecond, an exchange a tenth."""


class BodyRanges:
    """The deformable bodies in runs of AT_ONCE; edges (nr + 1,): where the runs' degrees of freedom begin and end."""

    def __init__(self, groups: Iterable[Group]) -> None:
        given = [(group.first, group.first + group.size) for group in groups]
        first = np.sort(np.concatenate([np.empty(0, dtype=np.int64), *(begins for begins, _ in given)]))
        self.edges: IntArray = np.append(first[::AT_ONCE], max((int(ends.max()) for _, ends in given), default=0))

    def cuts(self, first: IntArray, edges: IntArray) -> list[int]:
        """Where to cut the bodies of a group whose first dofs are first (nb,), those from edges[0] to edges[-1], so that those between two
        edges go together; all of them where they are no more than a run has, since few right sides at a time take longer."""
        return [0, len(first)] if len(first) <= AT_ONCE else np.searchsorted(first, edges).tolist()

    @property
    def _sharing(self) -> World | None:
        """The ranks that share work on these bodies."""
        ranks, edges = world(), self.edges
        return None if ranks is None or len(edges) - 1 < ranks.size or edges[-1] < SHARED_FROM else ranks

    def vector(self, size: int) -> FloatArray:
        """An array (size,) of any numbers for `share`, in memory that the ranks have in common where they share, so that nothing is copied:
        what is not in the runs every rank writes, the same, and none of them adds to it. All ranks must ask."""
        found: FloatArray = np.empty(size) if self._sharing is None else for_parts((size,), 0)
        return found

    def share(self, what: str, work: Callable[[IntArray], None], x: FloatArray) -> None:
        """Have work(edges) write what x (n_dofs,) has from edges[0] to edges[-1], of consecutive runs: each rank those of some, all of them
        where there are few. All ranks must ask; work exchanges nothing itself."""
        ranks, edges = self._sharing, self.edges
        if ranks is None:
            work(edges)
            return
        cuts = [(len(edges) - 1) * k // ranks.size for k in range(ranks.size + 1)]

        def of_dofs(begin: int, end: int) -> None:
            i, j = np.searchsorted(edges, (begin, end))
            work(edges[i : j + 1])

        in_pieces(what, edges[cuts].tolist(), of_dofs, x[edges[0] : edges[-1]])
