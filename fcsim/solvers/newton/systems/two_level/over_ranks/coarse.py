"""The coarse matrix over ranks: each eliminates the motions of its own bodies, all what that leaves on the bodies between ranks.

Some of the bodies that are next to another rank's separate all others of one rank from the others' (J. S. Przemieniecki, AIAA J. 1, 1963):
a platen in the place of all bricks below it. What is left on these, a dense matrix T, is summed over the ranks and factored by all.

Bodies of others on which a rank's joints lie are among these, so that no sum is needed before a rank eliminates its own. What the joints
between ranks have to tell one another comes with what is left: an application takes two exchanges.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla
from numpy.typing import DTypeLike, NDArray

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.linear.block_rows import dofs_of
from fcsim.linear.elimination_tree import elimination_tree
from fcsim.linear.factors import SingularMatrix
from fcsim.ranks import World
from fcsim.solvers.newton.systems.two_level.over_ranks import _coarse_kernels as kernels
from fcsim.solvers.newton.systems.two_level.over_ranks.guests import Guests

PADDING = 0.15
"""Share of zeros in a front."""


class CoarsePattern:
    """Where S (n k, n k) has blocks (k, k), in which order and by whom they are eliminated."""

    def __init__(self, columns: IntArray, begins: IntArray, rank: IntArray, world: World, first: BoolArray, wanted: BoolArray) -> None:
        """columns (blocks,): ascending, those of row i from begins[i] on, a symmetric pattern with the diagonal; rank (n,): whose each body
        is; first (n,): which are between ranks at any rate; wanted (ranks, n): of which each rank wants the solution, besides its own.
        needed (ranks, blocks): which of the blocks a rank's fronts take."""
        self.columns, self.begins, self.world = columns, begins, world
        n = len(begins) - 1
        row = np.repeat(np.arange(n), np.diff(begins))
        self.mirror = np.searchsorted(row * n + columns, columns * n + row)
        between = kernels.separators(begins, columns, rank, first)
        tree = elimination_tree(begins, columns, PADDING, last=between)
        self.tree = (tree.order, tree.first, tree.starts, tree.rows)
        of_all = np.logical_or.reduceat(between[tree.order], tree.first[:-1])  # fronts with a body between ranks
        owner = np.where(np.repeat(of_all, np.diff(tree.first)), world.size, rank[tree.order])  # by places
        self.which = np.flatnonzero(owner[tree.first[:-1]] == world.number)
        self.top = np.full(n, -1)
        self.places = np.flatnonzero(owner == world.size)
        self.top[self.places] = np.arange(len(self.places))
        self.sizes = np.stack([np.diff(tree.first), np.diff(tree.starts)], axis=1)[self.which]
        rows = [tree.rows[tree.starts[f] : tree.starts[f + 1]] for f in self.which]
        self.firsts, self.borders = tree.first[self.which], np.concatenate([np.empty(0, dtype=np.int64), *rows])
        self.by_rank = [np.flatnonzero(owner == number) for number in range(world.size)]  # places that a rank eliminates
        whose = owner[np.argsort(tree.order)]  # by bodies
        self.needed = np.stack([(whose[row] == k) | (whose[columns] == k) for k in range(world.size)])
        mine = whose == world.number
        if world.number == 0:
            mine |= whose == world.size
        self.diagonal = np.flatnonzero((row == columns) & mine[row])  # where this rank adds I
        asked = wanted[:, tree.order]  # by places
        self.told = [places[np.delete(asked, k, axis=0)[:, places].any(axis=0)] for k, places in enumerate(self.by_rank)]
        number = self.top[np.argsort(tree.order)]
        of_top = np.flatnonzero((number[row] >= 0) & (number[columns] >= 0))
        self.blocks_of_top = of_top, number[row[of_top]], number[columns[of_top]]


class CoarseFactor:
    """S^-1 by fronts, made in double precision: beside the stiffness of joints, inertia is round-off in single precision."""

    def __init__(self, pattern: CoarsePattern, S: FloatArray, dtype: DTypeLike = np.float64) -> None:
        """S (blocks, k, k): the blocks in the pattern's order, whole where a rank needs them, else its share; SingularMatrix, on all ranks,
        where a front is singular. dtype: of what is kept, the precision of solutions."""
        self._pattern, self._k = pattern, S.shape[1]
        world, k = pattern.world, S.shape[1]
        own, border = k * pattern.sizes.T
        self._values = np.empty(int(np.sum(own * (own + 2 * border))), dtype=dtype)
        self._complements = np.empty(int(np.sum(border**2)))  # what each front leaves on its border
        self._lu: FloatArray
        self._pivots: IntArray
        self.take(S, np.ones(len(S), dtype=bool))
        self._fronts = self._values, k * pattern.sizes, k * pattern.firsts, dofs_of(pattern.borders, k)
        self._of_top, self._told = dofs_of(pattern.places, k), dofs_of(pattern.told[world.number], k)
        # of all solutions: memory that is new for each one takes as long as T's factors do
        self._x, self._solution = np.empty(k * len(pattern.top), dtype=dtype), np.zeros((len(pattern.top), k), dtype=np.float32)
        self._given, self._total = np.empty(len(self._told), dtype=np.float32), np.empty(len(self._of_top))
        self._sent = np.empty(0, dtype=np.float32)
        self._counts = [k * len(places) for places in pattern.told]
        self._order = dofs_of(pattern.tree[0], k)  # of c, in the order of elimination
        known = np.concatenate([pattern.by_rank[world.number], pattern.places])
        self._known = dofs_of(known, k), self._order[dofs_of(known, k)]
        self._heard = self._order[dofs_of(np.concatenate(pattern.told), k)]

    def take(self, S: FloatArray, changed: BoolArray) -> None:
        """Be the factor of S (blocks, k, k), with the bits of one made anew; changed (blocks,): which are others than before, of those that
        this rank needs. After SingularMatrix, on all ranks, it is none."""
        pattern, k, most = self._pattern, self._k, len(self._pattern.places)
        T = np.zeros((k * most, k * most))
        with pattern.world.together("motions of bodies"):
            which, row, column = pattern.blocks_of_top
            T.reshape(most, k, most, k)[row, :, column] = S[which]
            try:
                matrix = (pattern.begins, pattern.columns, pattern.mirror, S, changed)
                kernels.eliminate(pattern.tree, pattern.which, *matrix, pattern.top, self._values, self._complements, T)
            except np.linalg.LinAlgError:
                raise SingularMatrix("the bodies' motions on their joints are singular") from None
        pattern.world.summed("motions of bodies between ranks", T.ravel())
        self._lu, self._pivots, info = sla.lapack.dgetrf(T.T, overwrite_a=True) if most else (T, np.empty(0, dtype=np.int64), 0)
        if info > 0:
            raise SingularMatrix("the bodies' motions on their joints are singular")

    def solve(self, c: NDArray[np.float32], z: NDArray[np.float32], guests: Guests) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """S^-1 c (n, k) on this rank's bodies, those between ranks, and those that it wants, for c the sum of what the ranks have; and what
        they have told one another of their z (contacts, d), where `guests` finds it. The former holds until the next one."""
        world, top = self._pattern.world, len(self._of_top)
        numbers, every, lengths = self._solution.reshape(-1), np.empty(0, dtype=np.float32), guests.lengths(2 * top)
        if len(self._sent) != lengths[world.number]:
            self._sent = np.empty(lengths[world.number], dtype=np.float32)
        left, x, total = self._sent[: 2 * top].view(np.float64), self._x, self._total
        kernels.eliminated(c.reshape(-1), self._order, self._fronts, self._of_top, z, guests.rows, x, left, self._sent[2 * top :])
        if top:
            every = world.gathered(self._sent, lengths)
            wide, begin = every.view(np.float64), 0
            total[:] = 0.0
            for length in lengths:
                total += wide[begin : begin + top]
                begin += length // 2
            total = sla.lapack.dgetrs(self._lu, self._pivots, total, trans=1, overwrite_b=True)[0]
        kernels.solved(self._fronts, x, self._of_top, total, *self._known, self._told, numbers, self._given)
        if top:
            numbers[self._heard] = world.gathered(self._given, self._counts)
        return self._solution, every
