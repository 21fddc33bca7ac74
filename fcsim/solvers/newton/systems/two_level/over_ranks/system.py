"""Newton's linear system where ranks of MPI have W together, by the two-level preconditioner: each rank has a part of all vectors."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.linear.factors import SingularMatrix
from fcsim.linear.over_ranks.krylov import gmres_over_ranks
from fcsim.problem.distributed import BodiesOverRanks, ContactParts, DistributedDelassus, Needed
from fcsim.solvers.newton.systems._condensed_kernels import apply_blocks
from fcsim.solvers.newton.systems.two_level.joints import JOINT_UP_TO
from fcsim.solvers.newton.systems.two_level.over_ranks.joints import OwnJoints, parts_by_joints
from fcsim.solvers.newton.systems.two_level.over_ranks.preconditioner import PreconditionerOverRanks
from fcsim.solvers.newton.systems.two_level.system import ENOUGH, ITERATIONS, asked, largest_joint, with_equal_rows

STALLED, SHARPER, SHARPEST = 20, 0.1, 1e-6
"""Newton's iterations in which its error is not halved after which systems are asked for SHARPER times the defect, and after as many more
for less again, down to what single precision allows. Quadratic cells, whose corners hardly resist, stall at errors of 1e-2 to 1e-1 else."""
LOST = 1e-6
"""Smallest error so far relative to the last from which GMRES does not go on: it has followed what hardly resists, as bodies do on more
contacts than they need."""


class TwoLevelOverRanks:
    """Solves (A W + B) dr = rhs as `TwoLevelSystem`; all ranks have A, B, rhs and the answer, and take the same decisions."""

    def __init__(self, W: DistributedDelassus, behind: BodiesOverRanks, kept: PreconditionerOverRanks | None = None) -> None:
        """behind: the bodies of W; kept: what the system of an earlier W of the same contacts has left."""
        self._W, self._behind, self._kept = W, behind, kept
        self._precondition: PreconditionerOverRanks | None = None
        self._sides = behind.sides()
        # of `needed` the largest, that which no later one is twice as large as, and systems since then; what they are asked for
        self._best, self._halved, self._since, self._sharper = 0.0, 0.0, 0, 1.0
        self.pays = self._sides is not None and largest_joint(self._sides[0], behind.count) <= JOINT_UP_TO and not len(W.layout.free)

    @property
    def left(self) -> PreconditionerOverRanks | None:
        """What serves the next W of these contacts; None where none was made, or where it did not pay."""
        return self._precondition if self.pays else None

    def solve(
        self, A: FloatArray, B: FloatArray, rhs: FloatArray, needed: float = 0.0, foreseen: bool = False
    ) -> tuple[FloatArray, FloatArray] | None:
        """dr and W dr (m,) for rhs (nc, d), as `TwoLevelSystem.solve`."""
        if not self.pays or self._sides is None:
            return None
        if needed < LOST * self._best:
            self.pays = False
            return None
        self._watch(needed)
        diagonal = self._W.diagonal().reshape(rhs.shape)
        A, B, rhs = with_equal_rows(A, B, rhs, diagonal)
        found = None
        if self._precondition is None and self._kept is not None:
            self._precondition = self._kept.following(self._sides[0], diagonal)
        if self._precondition is not None:
            found = self._by(self._precondition, A, B, rhs, needed, foreseen=foreseen)
        if found is None and (self._precondition is None or self._precondition.earlier):
            self._precondition = self._kept = None  # the old one makes room for the new
            self._precondition = self._anew(*self._sides)
            found = self._by(self._precondition, A, B, rhs, needed, foreseen=foreseen)
        self.pays = found is not None
        return found

    def _watch(self, needed: float) -> None:
        """Ask for more where Newton's error does not fall; needed: as in `solve`."""
        if needed > 2 * self._halved:
            self._halved, self._since = needed, 0
        else:
            self._since += 1
            if self._since % STALLED == 0:
                self._sharper *= SHARPER
        self._best = max(self._best, needed)

    def _anew(self, bodies: IntArray, pairs: IntArray) -> PreconditionerOverRanks:
        parts = parts_by_joints(self._W, self._behind, bodies)
        return PreconditionerOverRanks(OwnJoints(self._W, self._behind, parts, bodies, pairs), self._W.layout)

    def _by(
        self, precondition: PreconditionerOverRanks, A: FloatArray, B: FloatArray, rhs: FloatArray, needed: float, *, foreseen: bool
    ) -> tuple[FloatArray, FloatArray] | None:
        """dr and W dr by GMRES with this preconditioner; None where that does not get there.

        What has the accuracy as reactions may leave more of rhs than there was: P^-1 magnifies what it does not know of A W + B, where
        bodies have hardly more contacts than motions, or what hardly resists (eta of statics). Then the defect is measured in the residual.
        """
        try:
            precondition.update(A, B)
        except SingularMatrix:
            return None
        parts, shape = precondition.joints.parts, rhs.shape
        by_parts = ProductByParts(self._W, parts)
        own_A, own_B = A[parts.own], B[parts.own]

        def product(x: FloatArray) -> FloatArray:
            x = x.reshape(-1, shape[1])
            image: FloatArray = apply_blocks(own_A, by_parts(x), own_B, x)
            return image.ravel()

        def as_reactions(x: FloatArray) -> FloatArray:
            return precondition(product(x)).astype(np.float64)

        near, accuracy = asked(needed, foreseen=foreseen)
        accuracy = max(min(accuracy, SHARPEST), self._sharper * accuracy)
        given = rhs[parts.own].ravel()
        with parts.world.unasked("GMRES over ranks"):
            if not near:
                reactions = precondition(given).astype(np.float64)
                found = gmres_over_ranks(as_reactions, None, reactions, parts.summed, accuracy, ITERATIONS, ENOUGH)
                if found is not None:
                    step = found.reshape(-1, shape[1])
                    image = by_parts(step)
                    if _reduced(given, apply_blocks(own_A, image, own_B, step).ravel(), parts):
                        return parts.whole(step).ravel(), parts.whole(image).ravel()
            found = gmres_over_ranks(product, precondition, given, parts.summed, accuracy, ITERATIONS, ENOUGH)
            if found is None:
                return None
            step = found.reshape(-1, shape[1])
            return parts.whole(step).ravel(), parts.whole(by_parts(step)).ravel()


def _reduced(rhs: FloatArray, image: FloatArray, parts: ContactParts) -> bool:
    """Whether ||rhs - image|| <= ENOUGH ||rhs||, of which each rank has a part."""
    left = rhs - image
    before, after = parts.summed(np.array([rhs @ rhs, left @ left]))
    return bool(after <= ENOUGH**2 * before)


class ProductByParts:
    """x (k, d) -> W x (k, d), both the parts of the ranks: each multiplies with the shares of its own bodies.

    Ranks do not ask one another about errors before they exchange what they have, as elsewhere: nothing but a lack of memory ends a
    product, or an application of the preconditioner, on one rank, and then that rank, and the others with it (`World.unasked`).
    """

    def __init__(self, W: DistributedDelassus, parts: ContactParts) -> None:
        self._W, contacts = W, W.layout.own
        self._foreign = np.flatnonzero(parts.owner[contacts] != parts.world.number)
        place = np.empty(W.layout.nc, dtype=np.int64)
        place[parts.own] = np.arange(len(parts.own))
        place[contacts[self._foreign]] = len(parts.own) + np.arange(len(self._foreign))
        self._place = place[contacts]  # of the contacts of this rank's bodies, in its part and after it those of others
        place[contacts] = np.arange(len(contacts))
        self._own = place[parts.own]
        self._needed = Needed(parts, contacts[self._foreign])

    def __call__(self, x: FloatArray) -> FloatArray:
        wide = np.concatenate([x, self._needed.of(x)]).take(self._place, axis=0)
        image = self._W.own_product(wide.ravel()).reshape(wide.shape)
        own: FloatArray = image.take(self._own, axis=0)
        self._needed.to_owners(own, image[self._foreign])
        return own
