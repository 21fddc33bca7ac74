"""Newton's linear system where ranks of MPI have W together, by the two-level preconditioner: each rank has a part of all vectors."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.linear.factors import SingularMatrix
from fcsim.linear.over_ranks.krylov import gmres_over_ranks
from fcsim.problem.distributed import BodiesOverRanks, ContactParts, DistributedDelassus, Needed
from fcsim.solvers.newton.systems._condensed_kernels import apply_blocks
from fcsim.solvers.newton.systems.two_level import _joint_kernels as kernels
from fcsim.solvers.newton.systems.two_level.joints import JOINT_UP_TO
from fcsim.solvers.newton.systems.two_level.over_ranks.joints import OwnJoints, parts_by_joints
from fcsim.solvers.newton.systems.two_level.over_ranks.preconditioner import PreconditionerOverRanks
from fcsim.solvers.newton.systems.two_level.settling import Rounds, settled
from fcsim.solvers.newton.systems.two_level.system import ENOUGH, ITERATIONS, Demand, largest_joint

PLATEAU = 0.05
"""Of every system: single joints leave more than patches do."""


class TwoLevelOverRanks:
    """Solves (A W + B) dr = rhs as `TwoLevelSystem`; all ranks have A, B, rhs and the answer, and take the same decisions."""

    rounds = Rounds()  # of single joints: a patch's bodies may be on several ranks

    def __init__(self, W: DistributedDelassus, behind: BodiesOverRanks, kept: PreconditionerOverRanks | None = None) -> None:
        """behind: the bodies of W; kept: what the system of an earlier W of the same contacts has left."""
        self._W, self._behind, self._kept = W, behind, kept
        self._precondition: PreconditionerOverRanks | None = None
        self._by_parts: ProductByParts | None = None
        self._demand, bodies = Demand(PLATEAU, PLATEAU), behind.bodies
        self.pays = bodies is not None and largest_joint(bodies, behind.count) <= JOINT_UP_TO and not len(W.layout.free)

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
        found = None
        if self._precondition is not None and self._precondition.given_away:  # to a later W
            self._precondition = None
        if self._precondition is None and self._kept is not None:
            self._precondition = self._kept.following(bodies, diagonal)
        if self._precondition is not None:
            found = self._by(self._precondition, (A, B, rhs, diagonal), limits)
        if found is None and (self._precondition is None or self._precondition.earlier):
            self._precondition = self._kept = None  # the old one makes room for the new
            self._precondition = self._anew(bodies)
            found = self._by(self._precondition, (A, B, rhs, diagonal), limits)
        self.pays = found is not None
        return found

    def _anew(self, bodies: IntArray) -> PreconditionerOverRanks:
        parts = parts_by_joints(self._W, self._behind, bodies)
        return PreconditionerOverRanks(OwnJoints(self._W, self._behind, parts, bodies), self._W.layout)

    def settled(
        self, u: FloatArray, r: FloatArray, mu: FloatArray, rho: FloatArray, weight: FloatArray, limit: float
    ) -> tuple[FloatArray, FloatArray] | None:
        """dr and W dr (m,) as `TwoLevelSystem.settled`, all (nc, ...) whole on every rank: each solves its own joints."""
        if self._precondition is None or self._precondition.given_away or not self.pays:
            return None
        joints = self._precondition.joints
        own = joints.parts.own
        with self._W.layout.together("joints one by one"):
            found = settled(joints, u, r, mu, rho, weight, limit)
            step = np.zeros((len(own), joints.d)) if found is None else found[own] - r[own]
        with joints.parts.world.unasked("joints one by one"):
            dr = joints.parts.whole(step)
            return (dr.ravel(), joints.parts.whole(self._product(step)).ravel()) if dr.any() else None

    def _product(self, x: FloatArray) -> FloatArray:
        """W x (k, d), as `ProductByParts` of the preconditioner's."""
        assert self._precondition is not None
        parts = self._precondition.joints.parts
        if self._by_parts is None or self._by_parts.parts is not parts:
            self._by_parts = ProductByParts(self._W, parts)
        return self._by_parts(x)

    def _by(
        self,
        precondition: PreconditionerOverRanks,
        given: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
        limits: tuple[float, float],
    ) -> tuple[FloatArray, FloatArray] | None:
        """dr and W dr by GMRES with this preconditioner, as in `TwoLevelSystem`; given: A, B, rhs and the diagonal of W, by contacts, whose
        rows are normalised where this rank has them."""
        parts = precondition.joints.parts
        A, B, rhs, diagonal = (values[precondition.joints.order] for values in given)
        A, B, rhs = kernels.normalised(A, B, rhs, diagonal.mean(1))
        try:
            precondition.update(A, B)
        except SingularMatrix:
            return None
        count, d = len(parts.own), rhs.shape[1]
        own_A, own_B = A[:count], B[:count]

        def product(x: FloatArray) -> FloatArray:
            x = x.reshape(-1, d)
            image: FloatArray = apply_blocks(own_A, self._product(x), own_B, x)
            return image.ravel()

        with parts.world.unasked("GMRES over ranks"):
            found = gmres_over_ranks(product, precondition, rhs[:count].ravel(), parts.summed, *limits, ITERATIONS, ENOUGH)
            if found is None:
                return None
            step = found.reshape(-1, d)
            return parts.whole(step).ravel(), parts.whole(self._product(step)).ravel()


class ProductByParts:
    """x (k, d) -> W x (k, d), both the parts of the ranks: each multiplies with the shares of its own bodies.

    Ranks do not ask one another about errors before they exchange what they have, as elsewhere: nothing but a lack of memory ends a
    product, or an application of the preconditioner, on one rank, and then that rank, and the others with it (`World.unasked`).
    """

    def __init__(self, W: DistributedDelassus, parts: ContactParts) -> None:
        self.parts, self._W, contacts = parts, W, W.layout.own
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
