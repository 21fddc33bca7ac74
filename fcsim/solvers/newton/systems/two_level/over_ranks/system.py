"""Newton's linear system where ranks of MPI have W together, by the two-level preconditioner: each rank has a part of all vectors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray
from fcsim.linear.factors import SingularMatrix
from fcsim.linear.krylov import combined
from fcsim.linear.over_ranks.krylov import gmres_over_ranks
from fcsim.problem.distributed import BodiesOverRanks, DistributedDelassus
from fcsim.solvers.newton.systems.two_level import _joint_kernels as kernels
from fcsim.solvers.newton.systems.two_level.joints import JOINT_UP_TO
from fcsim.solvers.newton.systems.two_level.over_ranks.joints import OwnJoints
from fcsim.solvers.newton.systems.two_level.over_ranks.patches import patched_over_ranks
from fcsim.solvers.newton.systems.two_level.over_ranks.preconditioner import PreconditionerOverRanks
from fcsim.solvers.newton.systems.two_level.patches import PART, ROUNDS
from fcsim.solvers.newton.systems.two_level.settling import WORTH, ContactIterate, Rounds
from fcsim.solvers.newton.systems.two_level.system import CHANGED, ENOUGH, FIRST_CHANGED, ITERATIONS, Demand, largest_joint

FULL_WORTH = 0.5
"""What a round of patches must leave of the error for another one to follow, less than in one process, where more joints miss what they
should than a round can take: half of the rounds of a wall of 768 bricks then lead to as few systems."""

KEPT = 40
"""Iterations of GMRES up to which what W makes of its steps is kept; W times the answer of longer ones takes one more product."""


class TwoLevelOverRanks:
    """Solves (A W + B) dr = rhs as `TwoLevelSystem`; all ranks have A, B, rhs and the answer, and take the same decisions."""

    def __init__(self, W: DistributedDelassus, behind: BodiesOverRanks, kept: PreconditionerOverRanks | None = None) -> None:
        """behind: the bodies of W; kept: what the system of an earlier W of the same contacts has left."""
        self._W, self._behind, self._kept = W, behind, kept
        self._precondition: PreconditionerOverRanks | None = None
        self.rounds, self._demand, bodies = Rounds(ROUNDS, PART), Demand(), behind.bodies
        self.pays = bodies is not None and not len(W.layout.free)
        if self.pays and (kept is None or kept.joints.all_bodies is not bodies):  # for which it has been found to pay
            self.pays = bodies is not None and largest_joint(bodies, behind.count) <= JOINT_UP_TO

    @property
    def left(self) -> PreconditionerOverRanks | None:
        """What serves the next W of these contacts; None where none was made, or where it did not pay."""
        return self._precondition if self.pays else None

    def solve(
        self, A: FloatArray, B: FloatArray, rhs: FloatArray, needed: float = 0.0, foreseen: bool = False
    ) -> tuple[FloatArray, FloatArray] | None:
        """dr and W dr (m,) for rhs (nc, d), as `TwoLevelSystem.solve`."""
        bodies = self._behind.bodies
        if not self.pays or bodies is None:
            return None
        if self._demand.lost(needed):
            self.pays = False
            return None
        diagonal = self._W.diagonal().reshape(rhs.shape)
        limits = self._demand.following(needed, foreseen=foreseen)
        changed_by = FIRST_CHANGED if foreseen else CHANGED
        found = None
        if self._precondition is not None and self._precondition.given_away:  # to a later W
            self._precondition = None
        if self._precondition is None and self._kept is not None:
            self._precondition = self._kept.following(bodies, diagonal)
        if self._precondition is not None:
            found = self._by(self._precondition, (A, B, rhs, diagonal), limits, changed_by)
        if found is None and (self._precondition is None or self._precondition.earlier):
            earlier = {} if self._kept is None else self._kept.joints.pattern
            self._precondition = self._kept = None  # the old one makes room for the new
            joints = OwnJoints(self._W, self._behind, bodies, earlier)
            self._precondition = PreconditionerOverRanks(joints, self._W.layout)
            found = self._by(self._precondition, (A, B, rhs, diagonal), limits, changed_by)
        self.pays = found is not None
        return found

    def settled(self, at: ContactIterate, limit: float) -> tuple[FloatArray, FloatArray] | None:
        """dr and W dr (m,) as `TwoLevelSystem.settled`, all (nc, ...) whole on every rank."""
        if self._precondition is None or self._precondition.given_away or not self.pays:
            return None
        found = patched_over_ranks(self._precondition.joints.of_all, self._W, at, limit)
        if found is None:
            return None
        step, few = found
        self.rounds = Rounds(ROUNDS, PART, WORTH if few else FULL_WORTH)
        dr, layout = step.ravel(), self._W.layout
        with layout.world.unasked("W times what patches move by"):
            return dr, layout.summed(self._W.own_product_of_few(dr[layout.own_unknowns]))

    def _by(
        self,
        precondition: PreconditionerOverRanks,
        given: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
        limits: tuple[float, float],
        changed_by: float,
    ) -> tuple[FloatArray, FloatArray] | None:
        """dr and W dr by GMRES with this preconditioner, as in `TwoLevelSystem`; given: A, B, rhs and the diagonal of W, by contacts, whose
        rows are normalised where this rank has them."""
        joints = precondition.joints
        halo, parts = joints.halo, joints.parts
        A, B, rhs, diagonal = (values.take(halo.contacts, axis=0, mode="clip") for values in given)
        kernels.normalise(A, B, rhs, diagonal.mean(1))
        try:
            precondition.update(A, B, changed_by, joints.in_halo)
        except SingularMatrix:
            return None
        d = rhs.shape[1]
        share_of = joints.shares.applied(A, B)
        images, products = list[FloatArray](), 0  # what this rank's bodies make of the steps; how many there were

        def product(x: NDArray[np.floating]) -> FloatArray:
            nonlocal products
            image = joints.shares.of(self._W, x.reshape(-1, d))
            products += 1
            if products <= KEPT:
                images.append(image)
            else:
                images.clear()
            return share_of(image, x.reshape(-1, d)).ravel()

        with parts.world.unasked("GMRES over ranks"):
            found = gmres_over_ranks(product, precondition, rhs.ravel(), halo, *limits, ITERATIONS, ENOUGH)
            if found is None:
                return None
            step, y = found
            step = step.reshape(-1, d)[: len(parts.own)]
            if not len(y):
                image = np.zeros_like(step)
            elif images:
                image = joints.shares.joined(combined(y, images).reshape(-1, d))
            else:
                image = joints.shares.product(self._W, step)
            return parts.whole(step).ravel(), parts.whole(image).ravel()
