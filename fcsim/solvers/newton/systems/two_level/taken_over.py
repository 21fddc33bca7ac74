"""Blocks of joints that one preconditioner takes over from the one of the step before, without a copy of all of them.

From step to step few joints change, and hundreds of megabytes do not. The later preconditioner writes to the arrays that it takes over,
and keeps what it overwrites, for the earlier one still counts: a step that is cut is begun again from there. What the earlier one had is
then found by undoing all that was written since, the last first, in a copy.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import IntArray
from fcsim.solvers.newton.systems.two_level import _block_kernels as kernels
from fcsim.threads import side_by_side

Numbers = NDArray[np.generic]


class _Journal:
    """What one owner of arrays has overwritten, in its order, and the journal of the next owner."""

    def __init__(self) -> None:
        self.overwritten: list[tuple[IntArray, list[Numbers]]] = []
        self.following: _Journal | None = None


class TakenOver:
    """Arrays of blocks, that of joint k of one array from starts[k] on; of several values that share them the last one may write."""

    def __init__(self, arrays: Sequence[Numbers], starts: Sequence[IntArray]) -> None:
        self._arrays, self._starts, self._journal = tuple(arrays), tuple(starts), _Journal()
        self._first = True  # nobody has had these arrays before

    def following(self) -> TakenOver:
        """A value of its own with the same numbers, which has the arrays from here on."""
        if self._journal.following is not None:
            return TakenOver(self._as_they_were(), self._starts)
        other = TakenOver(self._arrays, self._starts)
        self._journal.following, other._first = other._journal, False
        return other

    def to_read(self) -> tuple[Numbers, ...]:
        """The arrays."""
        if self._journal.following is not None:
            self._arrays, self._journal, self._first = self._as_they_were(), _Journal(), True
        return self._arrays

    def to_write(self, which: IntArray) -> tuple[Numbers, ...]:
        """The arrays, of which the blocks of the joints `which` will be overwritten."""
        arrays = self.to_read()
        if not self._first:
            taken = [kernels.blocks_of(x, starts, which) for x, starts in zip(arrays, self._starts, strict=True)]
            self._journal.overwritten.append((which, taken))
        return arrays

    def _as_they_were(self) -> tuple[Numbers, ...]:
        """Copies of the arrays without what later owners have written."""
        arrays, later, journal = tuple(side_by_side([partial(np.copy, x) for x in self._arrays])), [], self._journal
        while journal.following is not None:
            journal = journal.following
            later.append(journal)
        for journal in reversed(later):
            for which, taken in reversed(journal.overwritten):
                for x, starts, blocks in zip(arrays, self._starts, taken, strict=True):
                    kernels.put_blocks(x, starts, which, blocks)
        return arrays
