"""What a rank's part of the two-level preconditioner takes from W: its own joints with their neighbours, G and E of W = E + G G^T there.

A joint between bodies of two ranks belongs to the one that has less. E comes from the bodies themselves, h (C - L L^T) h^T with L the
compliant motions: of others' bodies a rank knows h, as of all, and asks their owners for C. No rank needs entries of W.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.problem.bodies.shares import EIGEN_UP_TO
from fcsim.problem.distributed import BodiesOverRanks, ContactParts, DistributedDelassus, Halo, SharesByParts
from fcsim.ranks import digest_of
from fcsim.solvers.newton.systems.two_level import _joint_kernels as kernels
from fcsim.solvers.newton.systems.two_level.joints import JOINT_UP_TO, MOTIONS, SHIFT, WORK_A_PIECE, BodiesBehind, numbers_of_pairs
from fcsim.solvers.newton.systems.two_level.over_ranks.coarse import CoarsePattern
from fcsim.solvers.newton.systems.two_level.over_ranks.guests import Guests
from fcsim.solvers.newton.systems.two_level.over_ranks.patches import JointsOfAll
from fcsim.threads import pieces_by_work

Pairs = tuple[IntArray, IntArray, IntArray, IntArray]

PATTERN: tuple[str, ...] = (
    "parts",
    "cuts",
    "begins",
    "wide",
    "order",
    "bodies",
    "body_begins",
    "listed",
    "shares",
    "halo",
    "in_halo",
    "guests",
)
PATTERN += ("place_begins", "places", "coarse", "coarse_between", "precision", "entries", "of_all", "made_of")
"""What joints have from where W and h have entries, and not from their numbers: it serves again where those are there again."""


class OwnJoints:
    """The joints of this rank, as `Joints`. Contacts are numbered in the order of its joints, `parts.own`, and after them the neighbours
    of others; order (k,): their numbers among all, in_halo (k,): among the contacts of `halo`, on which vectors are."""

    def __init__(self, W: DistributedDelassus, behind: BodiesOverRanks, bodies: IntArray, earlier: dict[str, object]) -> None:
        """bodies: those of `behind`; earlier: the `pattern` of those of an earlier W, empty where there is none."""
        world, layout = W.layout.world, W.layout
        self.d, self.count = layout.dimension, behind.count
        self.all_bodies, self.diagonal_of_W = bodies, W.diagonal().reshape(-1, self.d)
        self.made_of = behind.made_of
        if behind.has_entries_as(earlier.get("made_of")):
            vars(self).update(earlier)
            with layout.together("joints of a rank"):
                h = behind.make_h(self.order)
                pairs = behind.pairs(*h[:2], len(self.order))
        else:
            h = self._found(W, behind, earlier)
            pairs = behind.pairs(*h[:2], behind.nc)[self.order]
        wanted = np.zeros(self.count, dtype=bool)
        wanted[self.listed] = True
        compliances = behind.compliances(world, wanted)
        with layout.together("blocks of joints"):
            self._fill(pairs, h[2:], compliances.matrices, compliances.kind)
            own = slice(0, len(self.parts.own))
            G = self.modes[0]
            left = self.diagonal_of_W[self.order[own]] - np.einsum("aij,aij->ai", G[own], G[own])
        self.shift = SHIFT * float(self.parts.summed(np.array([np.abs(left).sum()]))[0]) / self.diagonal_of_W.size

    def _found(
        self, W: DistributedDelassus, behind: BodiesOverRanks, earlier: dict[str, object]
    ) -> tuple[IntArray, IntArray, IntArray, IntArray, FloatArray]:
        """h of all contacts, by which PATTERN is that of an earlier W or is found anew."""
        bodies, layout = self.all_bodies, W.layout
        sizes = behind.sizes(layout.world)
        with layout.together("joints of a rank"):
            h = behind.make_h(None)
            self.entries = digest_of(*h[:4], bodies, sizes, behind.rank, *layout.contacts)  # known to all: they take the same decision
            if self.entries == earlier.get("entries"):
                vars(self).update(earlier | {"made_of": self.made_of})
        if "halo" not in vars(self):
            self._find_pattern(W, behind, h[:4], sizes)
        return h

    @property
    def pattern(self) -> dict[str, object]:
        """PATTERN by names, for the joints of a later W."""
        return {name: value for name, value in vars(self).items() if name in PATTERN}

    def _find_pattern(self, W: DistributedDelassus, behind: BodiesOverRanks, h: Pairs, sizes: IntArray) -> None:
        """PATTERN but for `entries`; h: by pairs, without weights; sizes (bodies,): the unknowns of each body's compliance."""
        world, layout, bodies = W.layout.world, W.layout, self.all_bodies
        with layout.together("pattern of joints"):
            self.parts = parts = parts_by_joints(W, behind, bodies)
            self._find(behind.nc, h, np.where(sizes > EIGEN_UP_TO, sizes, 0), bodies)
        self.shares = SharesByParts(parts, layout)
        self.halo = Halo(parts, self.shares.foreign, self.order[len(parts.own) :], self.d)
        place = np.empty(layout.nc, dtype=np.int64)
        place[self.halo.contacts] = np.arange(len(self.halo.contacts))
        self.in_halo = place[self.order]
        whose = np.where(bodies >= 0, behind.rank[bodies], -1)
        between = np.flatnonzero(np.any((whose >= 0) & (whose != world.number), axis=1)[parts.own][self.cuts[:-1]])
        ends = self.cuts, self.body_begins
        self.guests = Guests(world, parts.own, ends, self.listed, between, self.shares.foreign, self.d, MOTIONS)
        first = np.zeros(self.count, dtype=bool)
        first[bodies[(whose >= 0) & (whose != parts.owner[:, None])]] = True  # on which others' joints are
        self._find_coarse(behind.rank, first)
        fewest = self.d * int(np.unique(numbers_of_pairs(bodies, self.count), return_counts=True)[1].min(initial=MOTIONS))
        # where contacts of a joint do not tell a body's motions apart, single precision loses some of them
        self.precision = np.float32 if fewest > MOTIONS else np.float64

    @cached_property
    def of_all(self) -> JointsOfAll:
        """The joints of all ranks, for patches."""
        return JointsOfAll(self.all_bodies, self.count)

    def _find(self, nc: int, h: Pairs, sizes: IntArray, bodies: IntArray) -> None:
        """The joints, their neighbours and bodies among all nc contacts; h: made by `make_h`; sizes (bodies,): see `with_neighbours`."""
        own = self.parts.own
        others = np.setdiff1d(np.arange(nc), own)
        every, position = np.concatenate([own, others]), np.empty(nc, dtype=np.int64)
        position[every] = np.arange(nc)
        number = numbers_of_pairs(bodies[own], self.count)
        self.cuts = np.concatenate([np.flatnonzero(np.diff(number, prepend=-1)), [len(own)]])
        self.begins, wide = kernels.with_neighbours(*h, sizes, position, self.cuts, JOINT_UP_TO)
        beyond = np.unique(wide[wide >= len(own)])
        self.wide = np.where(wide < len(own), wide, len(own) + np.searchsorted(beyond, wide))
        self.order = np.concatenate([own, every[beyond]])
        self.bodies = bodies[self.order]
        self.body_begins, self.listed = kernels.bodies_of_joints(self.begins, self.wide, self.bodies, self.count)

    def _fill(self, pairs: IntArray, h: tuple[IntArray, IntArray, FloatArray], matrices: tuple[FloatArray, ...], kind: IntArray) -> None:
        """G and E from the bodies' compliances, matrices[kind[b]] that of body b; pairs: of the contacts `order`; h: begins, unknowns,
        weights."""
        k, d, behind = MOTIONS, self.d, BodiesBehind(pairs, h, matrices, kind)
        G = behind.modes(self.bodies, d)
        self.modes = G, self.bodies, self.body_begins, self.listed
        self.G32 = G[: len(self.parts.own)].astype(np.float32)
        inner, sizes, listed = np.diff(self.cuts), np.diff(self.begins), np.diff(self.body_begins)
        own = np.sum(self.bodies[self.cuts[:-1]] >= 0, axis=1)
        self.starts, self.Q_starts = _ends((d * sizes) ** 2), _ends(d * d * sizes * inner)
        self.R_starts, self.T_starts = _ends(d * inner * listed * k), _ends(own * listed * k**2)
        self.E = np.empty(self.starts[-1], dtype=np.float32)
        self.ranges = pieces_by_work(self.starts, WORK_A_PIECE)
        behind.blocks(self.bodies, (self.begins, self.wide), (self.body_begins, self.listed), self.starts, d, self.ranges, self.E)

    def _find_coarse(self, rank: IntArray, first: BoolArray) -> None:
        """The coarse matrix by blocks, of all ranks' joints: their (own body, body), and the diagonal; rank (bodies,): whose each is; first
        (bodies,): see `CoarsePattern`."""
        world, count = self.parts.world, self.count
        listed = np.diff(self.body_begins)
        number = np.sum(self.bodies[self.cuts[:-1]] >= 0, axis=1) * listed
        self.place_begins = _ends(number)
        joint = np.repeat(np.arange(len(number)), number)
        e = np.arange(len(joint)) - self.place_begins[joint]
        row = self.listed[self.body_begins[joint] + e // listed[joint]]
        column = self.listed[self.body_begins[joint] + e % listed[joint]]
        keys = np.unique(np.concatenate([row * count + column, column * count + row]))
        counts = world.gathered(np.array([len(keys)]), np.ones(world.size, dtype=np.int64))
        key = np.unique(np.concatenate([world.gathered(keys, counts), np.arange(count) * (count + 1)]))  # a symmetric pattern
        self.places = np.searchsorted(key, row * count + column)
        wants = np.zeros(count, dtype=np.int8)
        wants[self.listed] = wants[self.guests.listed] = 1
        wanted = world.gathered(wants, [count] * world.size).reshape(-1, count)
        self.coarse = CoarsePattern(key % count, np.searchsorted(key, count * np.arange(count + 1)), rank, world, first, wanted > 0)
        own = np.unique(self.places)
        counts = world.gathered(np.array([len(own)]), np.ones(world.size, dtype=np.int64))
        made = np.zeros((world.size, len(key)), dtype=bool)
        for k, some in enumerate(np.split(world.gathered(own, counts), np.cumsum(counts)[:-1])):
            made[k, some] = True
        # blocks that a rank takes and others add to
        self.coarse_between = np.flatnonzero((self.coarse.needed & (made.sum(axis=0) > made)).any(axis=0))


def parts_by_joints(W: DistributedDelassus, behind: BodiesOverRanks, bodies: IntArray) -> ContactParts:
    """Contacts cut by joints; bodies (nc, 2): of each contact. A joint is of its bodies' rank, between two ranks of the one that has fewer
    contacts so far."""
    rank = np.where(bodies >= 0, behind.rank[bodies], behind.rank[bodies[:, ::-1]])
    numbers = numbers_of_pairs(bodies, behind.count)
    owner, between = rank[:, 0].copy(), np.flatnonzero(rank[:, 0] != rank[:, 1])
    contacts = np.bincount(np.delete(owner, between), minlength=W.layout.world.size)
    _, first, joint = np.unique(numbers[between], return_index=True, return_inverse=True)
    of_joints = np.empty(len(first), dtype=np.int64)
    for k, pair in enumerate(rank[between[first]]):
        of_joints[k] = pair[np.argmin(contacts[pair])]
        contacts[of_joints[k]] += np.count_nonzero(joint == k)
    owner[between] = of_joints[joint]
    return ContactParts(W.layout.world, owner, numbers)


def _ends(sizes: IntArray) -> IntArray:
    return np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(sizes)])
