"""What the two-level preconditioner takes from W alone: contacts by joints with their neighbours; G and E of W = E + G G^T."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, partial

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.linear.joints import BlockRows, Pattern
from fcsim.linear.late.late_rows import source_of
from fcsim.problem.bodies.late import LateSum
from fcsim.problem.bodies.shares import EIGEN_UP_TO, BodyShares, by_matrices, compliant_motions
from fcsim.solvers.newton.systems.two_level import _body_kernels as body_kernels
from fcsim.solvers.newton.systems.two_level import _joint_kernels as kernels
from fcsim.solvers.newton.systems.two_level.patches import joints_beside
from fcsim.threads import pieces_by_work, side_by_side

MOTIONS = 12
"""Compliant motions of a body: six rigid ones and as many that strain it. Six in all take a third more iterations, 24 hardly fewer."""
JOINT_UP_TO = 150
"""Contacts of a joint up to which its block is inverted as a whole; with its neighbours it has no more either."""
SHIFT = 1e-8
"""Added to E's diagonal, relative to its mean: contacts at the middle of faces hardly feel a checkerboard of forces."""
WORK_A_PIECE = 300_000
"""Entries of joints' blocks that one thread inverts."""


class Joints:
    """What the preconditioner takes from W alone: contacts by joints, with their neighbours; G and E."""

    def __init__(self, rows: BlockRows, shares: BodyShares, bodies: IntArray, side: IntArray) -> None:
        """bodies, side: those of `shares`. Where entries of W would have to be summed first, E comes from the bodies instead."""
        self.d = d = shares.dimension
        self.count = shares.count
        number, joint = np.unique(numbers_of_pairs(bodies, shares.count), return_inverse=True)
        self.order = np.argsort(joint, kind="stable")
        position = np.argsort(self.order)
        self.cuts = _ends(np.bincount(joint, minlength=len(number)))
        self.begins, self.wide = kernels.with_neighbours(
            shares.first, shares.contacts, shares.begins, shares.unknowns, _unknowns(shares), position, self.cuts, JOINT_UP_TO
        )
        self.bodies, by_bodies = bodies[self.order], _behind(rows, shares, side, self.order)
        G = shares.modes(MOTIONS, side)[self.order] if by_bodies is None else by_bodies.modes(self.bodies, d)
        self.body_begins, self.listed = kernels.bodies_of_joints(self.begins, self.wide, self.bodies, self.count)
        self.modes = G, self.bodies, self.body_begins, self.listed
        self.G32 = G.astype(np.float32)
        sizes, inner, listed = np.diff(self.begins), np.diff(self.cuts), np.diff(self.body_begins)
        own = np.sum(bodies[self.order[self.cuts[:-1]]] >= 0, axis=1)
        self.starts, self.Q_starts = _ends((d * sizes) ** 2), _ends(d * d * sizes * inner)
        self.R_starts = _ends(d * inner * listed * MOTIONS)
        self.T_starts, self.place_begins = _ends(own * listed * MOTIONS**2), _ends(own * listed)
        self.E = np.empty(self.starts[-1], dtype=np.float32)
        self.ranges, wide = pieces_by_work(self.starts, WORK_A_PIECE), (self.begins, self.wide)
        if by_bodies is None:
            entries = rows.indptr, rows.indices, rows.blocks, self.order, position
            side_by_side([partial(kernels.joint_blocks, *entries, wide, self.modes, self.starts, *ends, self.E) for ends in self.ranges])
        else:
            by_bodies.blocks(self.bodies, wide, (self.body_begins, self.listed), self.starts, d, self.ranges, self.E)
        self.diagonal_of_W = rows.W.diagonal().reshape(-1, d)
        diagonal = self.diagonal_of_W[self.order] - np.einsum("aij,aij->ai", G, G)
        self.shift = SHIFT * float(np.abs(diagonal).mean())
        # the coarse matrix by blocks: of all joints' (own body, body), and the diagonal
        joint_of = np.repeat(np.arange(len(own)), own * listed)
        e = np.arange(len(joint_of)) - self.place_begins[joint_of]
        row = self.listed[self.body_begins[joint_of] + e // listed[joint_of]]
        column = self.listed[self.body_begins[joint_of] + e % listed[joint_of]]
        every = np.arange(self.count)
        keys = [row * self.count + column, column * self.count + row, every * (self.count + 1)]
        key, places = np.unique(np.concatenate(keys), return_inverse=True)  # a symmetric pattern
        places = places.reshape(-1)
        self.places, self.diagonal = places[: len(row)], places[2 * len(row) :]
        self.coarse_columns, self.coarse_begins = key % self.count, np.searchsorted(key, self.count * np.arange(self.count + 1))
        self.coarse_pattern: Pattern | None = None  # with its elimination tree, once that is known

    @cached_property
    def beside(self) -> tuple[IntArray, IntArray]:
        """The joints that have a body in common with each joint, see `joints_beside`."""
        return joints_beside(self.bodies[self.cuts[:-1]], self.count)


class BodiesBehind:
    """What G and E of W = E + G G^T are made of without entries of W: E on a joint is the sum of h (C - L L^T) h^T over its bodies, L (k,
    MOTIONS) the most compliant motions of C (k, k)."""

    def __init__(self, pairs: IntArray, h: tuple[IntArray, IntArray, FloatArray], matrices: Sequence[FloatArray], kind: IntArray) -> None:
        """pairs (n, 2): of h, that belong to each contact, -1: none; h: begins, unknowns, weights, see `BodyShares`; C of body b:
        matrices[kind[b]]."""
        self._pairs, self._h = pairs, h
        motions = [compliant_motions(C, MOTIONS) for C in matrices]
        rows = np.array([len(C) for C in matrices], dtype=np.int64)
        left = np.concatenate([np.empty(0), *((C - L @ L.T).ravel() for C, L in zip(matrices, motions, strict=True))])
        self._compliances = left, _ends(rows**2)[kind], rows[kind] if len(rows) else kind
        self._motions = np.concatenate([np.empty(0), *(own.ravel() for own in motions)]), _ends(MOTIONS * rows)[kind]

    def modes(self, bodies: IntArray, d: int) -> FloatArray:
        """G (n, d, 2 MOTIONS) of the contacts; bodies (n, 2): theirs, -1: none."""
        G = np.zeros((len(bodies), d, 2 * MOTIONS))
        body_kernels.modes_of_contacts(self._pairs, bodies, *self._h, *self._motions, G)
        return G

    def blocks(
        self,
        bodies: IntArray,
        joints: tuple[IntArray, IntArray],
        listing: tuple[IntArray, IntArray],
        starts: IntArray,
        d: int,
        ranges: Sequence[tuple[int, int]],
        E: FloatArray,
    ) -> None:
        """Write the joints' blocks to E, that of joint k from starts[k] on; the rest as in `joint_blocks_of_bodies`."""
        given = (self._pairs, bodies, self._h, self._compliances, joints, listing, starts, d)
        side_by_side([partial(body_kernels.joint_blocks_of_bodies, *given, begin, end, E) for begin, end in ranges])


def _behind(rows: BlockRows, shares: BodyShares, side: IntArray, order: IntArray) -> BodiesBehind | None:
    """The bodies behind the contacts `order` where entries of W would have to be summed first; side: of the pairs of h."""
    source = source_of(rows.W)
    if not isinstance(source, LateSum) or source.shares is not shares:
        return None
    pairs, kind = np.full((shares.nc, 2), -1), np.full(shares.count, -1)
    matrices: list[FloatArray] = []
    pairs[shares.contacts, side] = np.arange(len(side))
    for bodies, C in by_matrices(shares.runs, np.ones(shares.count, dtype=bool)):
        kind[bodies] = len(matrices)
        matrices.append(C)
    return BodiesBehind(pairs[order], (shares.begins, shares.unknowns, shares.weights), matrices, kind)


def numbers_of_pairs(bodies: IntArray, count: int) -> IntArray:
    """One number (nc,) for each pair of `count` bodies (nc, 2), -1 for none, ascending as the pairs are."""
    return (bodies[:, 0] + 1) * (count + 1) + bodies[:, 1] + 1


def _ends(sizes: IntArray) -> IntArray:
    return np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(sizes)])


def _unknowns(shares: BodyShares) -> IntArray:
    """The unknowns of each body's compliance, 0 for those that all their contacts share."""
    sizes = np.zeros(shares.count, dtype=np.int64)
    for begin, C, kind in shares.runs:
        sizes[begin : begin + len(kind)] = C.shape[1] if C.shape[1] > EIGEN_UP_TO else 0
    return sizes
