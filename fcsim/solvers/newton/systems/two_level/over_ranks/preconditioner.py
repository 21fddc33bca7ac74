"""The two-level preconditioner whose joints are shared by ranks: Q by each rank's own, motions summed, the coarse matrix on all."""

from __future__ import annotations

from copy import copy
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.linear.factors import SingularMatrix
from fcsim.problem.distributed import ContactLayout
from fcsim.runtime import threads
from fcsim.solvers.newton.systems.two_level import _block_kernels as block_kernels
from fcsim.solvers.newton.systems.two_level import _joint_kernels as kernels
from fcsim.solvers.newton.systems.two_level.joints import MOTIONS
from fcsim.solvers.newton.systems.two_level.over_ranks.coarse import CoarseFactor
from fcsim.solvers.newton.systems.two_level.over_ranks.joints import OwnJoints
from fcsim.solvers.newton.systems.two_level.system import CHANGED, ENTRIES_A_PIECE, LASTS
from fcsim.threads import pieces_by_work, side_by_side


class PreconditionerOverRanks:
    """x -> P^-1 x as `Preconditioner` for this rank's parts (k d,) of vectors; SingularMatrix, on all ranks, where a joint of one or the
    bodies' motions are singular."""

    def __init__(self, joints: OwnJoints, layout: ContactLayout) -> None:
        self.joints, self._layout, self._steps, self.given_away = joints, layout, 0, False
        self._A, self._B = np.full((2, len(joints.order), joints.d, joints.d), np.nan)  # of Q, by the joints' order
        self._Q, self._R = (np.empty(starts[-1], dtype=np.float32) for starts in (joints.Q_starts, joints.R_starts))
        self._T = np.empty(joints.T_starts[-1])
        self._coarse: CoarseFactor | None = None
        self._between = np.empty(0)  # blocks of the bodies' matrix where ranks meet, that `_coarse` was made of
        self._ranges = pieces_by_work(joints.Q_starts, ENTRIES_A_PIECE)
        if threads() == 1:
            self._ranges = [(0, len(joints.cuts) - 1)]  # each call takes some microseconds
        self._own, self._wide = np.arange(len(joints.parts.own)), joints.in_halo[joints.wide]

    @property
    def earlier(self) -> bool:
        """Whether it was made of the W of an earlier step."""
        return self._steps > 0

    def update(self, A: FloatArray, B: FloatArray, changed_by: float = CHANGED, place: IntArray | None = None) -> None:
        """Make it the one of A and B (n, d, d), in which the contacts by the joints' order stand at `place` (k,), None: they are all,
        but for changes up to `changed_by`."""
        joints, k = self.joints, MOTIONS
        given = (self._A, self._B, joints.E, joints.shift, joints.cuts, (joints.begins, joints.wide), joints.modes, joints.starts)
        out = (self._Q, joints.Q_starts, self._R, joints.R_starts, self._T, joints.T_starts)
        S = np.zeros((len(joints.coarse.columns), k, k))
        with self._layout.together("joints of A W + B"):
            changed = self._changed(A, B, changed_by, np.arange(len(A)) if place is None else place)
            which = [i + np.flatnonzero(changed[i:j]) for i, j in joints.ranges]
            try:
                side_by_side([partial(kernels.invert_joints, *given, out, own) for own in which if len(own)])
            except np.linalg.LinAlgError:
                raise SingularMatrix("a joint's block is singular") from None
            kernels.add_joints(self._T, joints.T_starts, joints.places, joints.place_begins, joints.body_begins, S)
        joints.guests.take(self._R, joints.R_starts)
        between = S[joints.coarse_between].ravel()
        joints.parts.world.summed("motions of bodies on joints", between)
        S[joints.coarse_between] = between.reshape(-1, k, k)
        S[joints.coarse.diagonal] += np.eye(k)
        earlier, self._coarse = self._coarse, None  # known again where what follows succeeds
        if earlier is None:
            self._coarse = CoarseFactor(joints.coarse, S, joints.precision)
        else:
            of_others = np.any(between.reshape(-1, k * k) != self._between.reshape(-1, k * k), axis=1)
            earlier.take(S, self._changed_blocks(changed, of_others))
            self._coarse = earlier
        self._between = between

    def _changed_blocks(self, changed: BoolArray, between: BoolArray) -> BoolArray:
        """Which blocks of the bodies' matrix this rank's joints `changed` (joints,) have part in, and those `between` ranks that are others
        than before."""
        joints = self.joints
        blocks = np.zeros(len(joints.coarse.columns), dtype=bool)
        blocks[joints.places[np.repeat(changed, np.diff(joints.place_begins))]] = True
        blocks[joints.coarse_between[between]] = True
        return blocks

    def _changed(self, A: FloatArray, B: FloatArray, changed_by: float, place: IntArray) -> BoolArray:
        """As in `Preconditioner`; place: as in `update`."""
        joints, far = self.joints, np.empty(len(place), dtype=bool)
        kernels.changed_contacts(A, B, place, changed_by, self._A, self._B, 0, len(place), far)
        if len(joints.begins) == 1:
            return np.zeros(0, dtype=bool)
        return np.logical_or.reduceat(far[joints.wide], joints.begins[:-1])

    def following(self, bodies: IntArray, diagonal: FloatArray) -> PreconditionerOverRanks | None:
        """The same for the W of a later step, as in `Preconditioner`, which it then serves alone: it has this one's blocks, of which few
        are made anew, and no copy of them."""
        joints = self.joints
        if self.given_away or self._steps >= LASTS:
            return None
        if joints.all_bodies is not bodies and not np.array_equal(joints.all_bodies, bodies):
            return None
        if diagonal.shape != joints.diagonal_of_W.shape:
            return None
        if kernels.moved(diagonal, joints.diagonal_of_W, CHANGED):
            return None
        other = copy(self)
        other._steps, self.given_away = self._steps + 1, True
        return other

    def __call__(self, x: NDArray[np.float32]) -> NDArray[np.float32]:
        """P^-1 x on this rank's own contacts, and after them on those of others at its bodies, for x on those of the joints' halo."""
        joints, own, guests = self.joints, self._own, self.joints.guests
        assert self._coarse is not None  # of the last update
        wide = x.reshape(-1, joints.d)
        z = np.empty((len(own) + len(joints.shares.foreign), joints.d), dtype=np.float32)
        sums, c = np.empty((len(joints.cuts) - 1, 2 * MOTIONS), dtype=np.float32), np.zeros((joints.count, MOTIONS), dtype=np.float32)
        blocks = (self._Q, joints.Q_starts, joints.cuts, joints.begins, self._wide, joints.G32)
        side_by_side([partial(block_kernels.solve_joints, *blocks, i, j, wide, z, sums) for i, j in self._ranges])
        block_kernels.add_to_bodies(sums, joints.cuts, joints.bodies, c)
        c, received = self._coarse.solve(c, z, guests)
        motions = (self._R, joints.R_starts, joints.cuts, joints.body_begins, joints.listed, c)
        side_by_side([partial(block_kernels.less_motions, *motions, i, j, z, own, z) for i, j in self._ranges])
        guests.put(received, c, z[len(own) :])
        return z.ravel()
