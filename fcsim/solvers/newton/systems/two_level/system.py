"""Newton's linear system by GMRES with the joints' own blocks and the bodies' most compliant motions: nothing of W is factored.

W = E + G G^T, where a column of G is what one of a body's most compliant motions does at its contacts: the rigid motions, which inertia
alone resists, and the few that strain a body as a whole. What is left, E, couples contacts of one joint (contacts of one pair of bodies)
above all, and those that share nodes with them. Q takes from E what it has on a joint and these neighbours:

    Q x on a joint = the joint's rows of (A E + B)^-1 x on the joint and its neighbours            (restricted additive Schwarz)

and with Q in the place of (A E + B)^-1 the preconditioner is the inverse of A (E + G G^T) + B,

    P^-1 = Q - Q A G (I + G^T Q A G)^-1 G^T Q                                                     (Sherman, Morrison, Woodbury)

I + G^T Q A G is the wall of bodies with k degrees of freedom each on joints as stiff as their contacts' status makes them: it carries what
goes from body to body, so that iterations hardly grow with the number of bodies. It is sparse, and all that is factored as a whole.

GMRES works on (A W + B) P^-1 x = rhs, whose defect is what Newton's next residual contains. Each contact's rows are multiplied by
(A c + B)^-1 before, c its own compliance: they are then reactions, of contacts that slide too, and what an adapting rho does to them counts
neither in a defect nor as a change of A and B. The accuracy follows from the factor
by which that residual has still to fall (R. S. Dembo, S. C. Eisenstat, T. Steihaug, SIAM J. Numer. Anal. 19, 1982).

GMRES ends before where the defect comes to a plateau. Reactions in a checkerboard over the contacts of joints, of one amplitude from joint
to joint, move nothing but what is at the wall's ends: W resists them a million times less than a push on one contact. What is left of a
defect in these motions takes ten times the iterations of all the rest, and reactions in them so large that they open and release contacts
anywhere: Newton's method does better without.

A joint's Q is computed anew where A or B of one of its contacts has changed by more than CHANGED: P is that of A and B with these changes.
So it goes from iteration to iteration and, with E and G of the earlier W, from step to step, where entries of W need not be summed at all.

Sources: R. A. Nicolaides, SIAM J. Numer. Anal. 24, 1987 (a coarse space of what is constant on a part); J. Mandel, Commun. Numer. Methods
Eng. 9, 1993 (of a part's rigid motions); C. Farhat, F.-X. Roux, Int. J. Numer. Methods Eng. 32, 1991 (these of interface forces);
X.-C. Cai, M. Sarkis, SIAM J. Sci. Comput. 21, 1999 (restricted additive Schwarz); N. Spillane, D. J. Rixen, Int. J. Numer. Methods Eng. 95,
2013 (motions that join the rigid ones); Y. Saad, M. H. Schultz, SIAM J. Sci. Stat. Comput. 7, 1986 (GMRES). That friction is in Q and in
the coarse matrix is our own.
"""

from __future__ import annotations

from copy import copy
from functools import cached_property, partial

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.linear.factors import SingularMatrix
from fcsim.linear.joints import BlockRows
from fcsim.linear.krylov import combined, gmres
from fcsim.linear.late.late_rows import source_of
from fcsim.linear.multifrontal.lu import Multifrontal
from fcsim.problem.bodies.late import LateSum
from fcsim.problem.bodies.product import ShareProduct
from fcsim.problem.bodies.shares import BodyShares, KnownShares
from fcsim.solvers.newton.systems.two_level import _block_kernels as block_kernels
from fcsim.solvers.newton.systems.two_level import _joint_kernels as kernels
from fcsim.solvers.newton.systems.two_level.joints import JOINT_UP_TO, MOTIONS, Joints, numbers_of_pairs
from fcsim.solvers.newton.systems.two_level.patches import PART, ROUNDS, patched
from fcsim.solvers.newton.systems.two_level.settling import ContactIterate, Rounds
from fcsim.solvers.newton.systems.two_level.taken_over import Numbers, TakenOver
from fcsim.threads import pieces, pieces_by_work, side_by_side

ACCURACY, FORESEEN, SAFETY, AT_FIRST = 1e-3, 1e-5, 0.3, 0.1
"""Defect relative to the right-hand side: of a system; of a step's first one, which has the last step's statuses: most of them hold, and
what is left of a defect opens and releases others; with 1e-4 steps of walls take a fifth more iterations. Where Newton's residual is near
the tolerance a defect of SAFETY times what is left is enough; with 0.5 Newton's method takes half more; for a step's first system
AT_FIRST times, since it may be the only one."""
PLATEAU, FIRST_PLATEAU, PATIENCE, LESS = 0.3, 2e-3, 2, 0.7
"""Defect, relative to the right-hand side, from which on GMRES ends on a plateau, where patches follow, and that of a step's first system,
much of which patches cannot mend; but for every PATIENCE-th system while Newton's residual stays above LESS of its least: two contacts may
take turns for ever, each opened by what the other's system left."""
STALLED, SHARPER, SHARPEST = 20, 0.1, 1e-6
"""Newton's iterations in which its error is not halved after which systems are asked for SHARPER times the defect, and after as many more
for less again, down to what single precision allows. Quadratic cells, whose corners hardly resist, stall at errors of 1e-2 to 1e-1 else."""
LOST = 1e-6
"""Smallest error so far relative to the last from which GMRES does not go on: it has followed what hardly resists, as bodies do on more
contacts than they need."""
CHANGED, FIRST_CHANGED = 0.05, 0.01
"""Change of a contact's A, relative to its largest entry, or of its B, up to which the joints' blocks stay; in a step's first system, which
takes most of its iterations: what a cold start has left of such changes costs the steps that follow half as many again or twice as many."""
ITERATIONS, ENOUGH = 200, 0.3
"""Iterations of GMRES, and the defect that must be reached by then: far from a solution, where much slides, Newton's method goes on with
less than ACCURACY."""
LASTS = 10
"""Steps that what was made of one W serves: W changes by 1e-4 from step to step."""
ENTRIES_A_PIECE = 300_000
"""Entries of joints' blocks that one thread multiplies."""
CONTACTS_A_PIECE = 4000
"""Contacts from whose reactions one thread takes what the bodies' motions make: a tenth of a millisecond."""


class Preconditioner:
    """x (m,) -> P^-1 x, of one W for A and B that change; SingularMatrix where a joint or the bodies' motions are singular."""

    def __init__(self, joints: Joints) -> None:
        self._joints, self._steps = joints, 0
        self._A, self._B = np.full((2, len(joints.order), joints.d, joints.d), np.nan)  # of Q; by the order of the joints
        Q, R = (np.empty(starts[-1], dtype=np.float32) for starts in (joints.Q_starts, joints.R_starts))
        self._blocks = TakenOver((Q, R, np.empty(joints.T_starts[-1])), (joints.Q_starts, joints.R_starts, joints.T_starts))
        self._ranges = pieces_by_work(joints.Q_starts, ENTRIES_A_PIECE)
        self._contacts = pieces(len(joints.order), CONTACTS_A_PIECE)
        self._coarse: Multifrontal | None = None  # of the last update

    @property
    def joints(self) -> Joints:
        return self._joints

    @property
    def earlier(self) -> bool:
        """Whether it was made of the W of an earlier step."""
        return self._steps > 0

    def update(self, A: FloatArray, B: FloatArray, changed_by: float = CHANGED) -> None:
        """Make it the one of A and B, but for changes up to `changed_by`."""
        joints = self._joints
        earlier, self._coarse = self._coarse, None  # known again where all that follows succeeds
        changed = self._changed(A, B, changed_by)
        given = (self._A, self._B, joints.E, joints.shift, joints.cuts, (joints.begins, joints.wide), joints.modes, joints.starts)
        Q, R, T = self._blocks.to_write(np.flatnonzero(changed))
        out = (Q, joints.Q_starts, R, joints.R_starts, T, joints.T_starts)
        which = [i + np.flatnonzero(changed[i:j]) for i, j in joints.ranges]
        try:
            side_by_side([partial(kernels.invert_joints, *given, out, own) for own in which if len(own)])
        except np.linalg.LinAlgError:
            raise SingularMatrix("a joint's block is singular") from None
        self._coarse = self._motions(T, changed, earlier)

    def _motions(self, T: Numbers, changed: BoolArray, earlier: Multifrontal | None) -> Multifrontal:
        """The factor of I + G^T Q A G; earlier: before the joints `changed` (joints,) did, None: not known."""
        joints, k, n = self._joints, MOTIONS, self._joints.count
        S = np.zeros((len(joints.coarse_columns), k, k))
        S[joints.diagonal] = np.eye(k)
        kernels.add_joints(T, joints.T_starts, joints.places, joints.place_begins, joints.body_begins, S)
        coarse = BlockRows(sp.bsr_array((S, joints.coarse_columns, joints.coarse_begins), shape=(n * k, n * k)), k, joints.coarse_pattern)
        joints.coarse_pattern = coarse.pattern
        if earlier is None:
            return Multifrontal(coarse, None, np.ones(n, dtype=bool), np.float32, lasting=True)
        entries = np.zeros(len(S), dtype=bool)
        entries[joints.places[np.repeat(changed, np.diff(joints.place_begins))]] = True
        return earlier.following(coarse, np.flatnonzero(entries))

    def following(self, shares: BodyShares, bodies: IntArray, diagonal: FloatArray) -> Preconditioner | None:
        """The same for the W of a later step, a value of its own; None where W's bodies (nc, 2) or diagonal (nc, d) are not nearly
        those that it was made for, or where that is long ago."""
        joints = self._joints
        if self._steps >= LASTS or joints.count != shares.count or diagonal.shape != joints.diagonal_of_W.shape:
            return None
        if np.any(joints.bodies != bodies[joints.order]):
            return None
        if kernels.moved(diagonal, joints.diagonal_of_W, CHANGED):
            return None
        other = copy(self)
        other._A, other._B, other._blocks = self._A.copy(), self._B.copy(), self._blocks.following()
        other._steps += 1
        return other

    def _changed(self, A: FloatArray, B: FloatArray, changed_by: float) -> BoolArray:
        """Take over A and B of contacts that have changed; which joints have one of these among theirs or their neighbours."""
        joints, far = self._joints, np.empty(len(A), dtype=bool)
        given = (A, B, joints.order, changed_by, self._A, self._B)
        side_by_side([partial(kernels.changed_contacts, *given, i, j, far) for i, j in self._contacts])
        return np.logical_or.reduceat(far[joints.wide], joints.begins[:-1])

    def __call__(self, x: FloatArray) -> FloatArray:
        joints, x, coarse = self._joints, x.reshape(-1, self._joints.d), self._coarse
        assert coarse is not None
        Q, R, _ = self._blocks.to_read()
        given, z = np.empty((2, *x.shape), dtype=np.float32)
        c = np.zeros((joints.count, MOTIONS), dtype=np.float32)
        sums, step = np.empty((len(joints.cuts) - 1, 2 * MOTIONS), dtype=np.float32), np.empty(x.shape)
        side_by_side([partial(block_kernels.in_order, x, joints.order, i, j, given) for i, j in self._contacts])
        blocks = Q, joints.Q_starts, joints.cuts, joints.begins, joints.wide, joints.G32
        side_by_side([partial(block_kernels.solve_joints, *blocks, i, j, given, z, sums) for i, j in self._ranges])
        block_kernels.add_to_bodies(sums, joints.cuts, joints.bodies, c)
        c[coarse.contacts] = coarse.solve(c[coarse.contacts])
        motions = R, joints.R_starts, joints.cuts, joints.body_begins, joints.listed, c
        side_by_side([partial(block_kernels.less_motions, *motions, i, j, z, joints.order, step) for i, j in self._ranges])
        return step.ravel()


class Demand:
    """How small a defect is asked for, from one of Newton's systems to the next; plateau: as PLATEAU, first: as FIRST_PLATEAU."""

    def __init__(self, plateau: float = PLATEAU, first: float = FIRST_PLATEAU) -> None:
        self._plateau, self._first = plateau, first
        self._nearest, self._waited = 0.0, 0  # the largest `needed` so far, and systems since it grew
        self._halved, self._since, self._sharper = 0.0, 0, 1.0  # that which no later one is twice as large as, and systems since then

    def lost(self, needed: float) -> bool:
        """Whether Newton's error has grown beyond what further systems mend."""
        return needed < LOST * self._nearest

    def following(self, needed: float, *, foreseen: bool) -> tuple[float, float]:
        """The defect of the next system, and that from which on it ends on a plateau (0: on none), relative to the right-hand side; needed,
        foreseen: as in `NewtonSpace`."""
        self._nearest, self._waited = (needed, 0) if self._nearest < LESS * needed else (self._nearest, self._waited + 1)
        self._halved, self._since = (needed, 0) if needed > 2 * self._halved else (self._halved, self._since + 1)
        if self._since and self._since % STALLED == 0:
            self._sharper *= SHARPER
        plateau = 0.0 if self._sharper < 1 or self._waited % PATIENCE == PATIENCE - 1 else self._first if foreseen else self._plateau
        least, share = (FORESEEN, AT_FIRST) if foreseen else (ACCURACY, SAFETY)
        accuracy = max(least, min(ENOUGH, share * needed))
        return max(min(accuracy, SHARPEST), self._sharper * accuracy), plateau


class TwoLevelSystem:
    """Solves (A W + B) dr = rhs for one W, the sum of the bodies' shares."""

    rounds = Rounds(ROUNDS, PART)

    def __init__(self, rows: BlockRows, known: KnownShares, kept: Preconditioner | None = None) -> None:
        """known: the shares of the matrix of `rows`; kept: what the system of an earlier W of the same contacts has left."""
        self._rows, self._shares, self._kept = rows, known.make(), kept
        self._precondition: Preconditioner | None = None
        self._demand = Demand()
        self._bodies = self._shares.bodies()
        self.pays = self._bodies is not None and largest_joint(self._bodies[0], self._shares.count) <= JOINT_UP_TO

    @property
    def left(self) -> Preconditioner | None:
        """What serves the next W of these contacts; None where none was made, or where it did not pay."""
        return self._precondition if self.pays else None

    @cached_property
    def _diagonal(self) -> FloatArray:
        """The diagonal of W (nc, d)."""
        diagonal: FloatArray = self._rows.W.diagonal().reshape(-1, self._shares.dimension)
        return diagonal

    def _anew(self) -> Preconditioner:
        assert self._bodies is not None
        return Preconditioner(Joints(self._rows, self._shares, *self._bodies))

    @cached_property
    def _by_bodies(self) -> ShareProduct:
        source = source_of(self._rows.W)
        return source.product if isinstance(source, LateSum) and source.shares is self._shares else ShareProduct(self._shares)

    def _product(self, x: FloatArray) -> FloatArray:
        """W x (m,)."""
        return self._by_bodies.times(x)

    def solve(
        self, A: FloatArray, B: FloatArray, rhs: FloatArray, needed: float = 0.0, foreseen: bool = False
    ) -> tuple[FloatArray, FloatArray] | None:
        """dr and W dr (m,) for rhs (nc, d); None where joints are too large or GMRES does not get there, and from then on.

        needed: the factor by which Newton's residual has still to fall, 0: not known. Less is not asked of the defect.
        """
        if not self.pays:
            return None
        if self._demand.lost(needed):
            self.pays = False
            return None
        A, B, rhs = kernels.normalised(A, B, rhs, self._diagonal.mean(1))
        limits = self._demand.following(needed, foreseen=foreseen)
        changed_by = FIRST_CHANGED if foreseen else CHANGED
        found = None
        if self._precondition is None and self._kept is not None and self._bodies is not None:
            self._precondition = self._kept.following(self._shares, self._bodies[0], self._diagonal)
        if self._precondition is not None:
            found = self._by(self._precondition, A, B, rhs, limits, changed_by)
        if found is None and (self._precondition is None or self._precondition.earlier):
            self._precondition = self._anew()
            found = self._by(self._precondition, A, B, rhs, limits, changed_by)
        self.pays = found is not None
        return found

    def settled(self, at: ContactIterate, limit: float) -> tuple[FloatArray, FloatArray] | None:
        """dr and W dr (m,) by which a round of patches is solved, see `patches`; None where none are, or this system does not pay."""
        if self._precondition is None or not self.pays:
            return None
        found = patched(self._precondition.joints, self._rows.W, at, limit)
        if found is None:
            return None
        dr = (found - at.r).ravel()
        return dr, self._by_bodies.of_few(dr)

    def _by(
        self, precondition: Preconditioner, A: FloatArray, B: FloatArray, rhs: FloatArray, limits: tuple[float, float], changed_by: float
    ) -> tuple[FloatArray, FloatArray] | None:
        """dr and W dr (m,) by GMRES with this preconditioner, as of changes by more than `changed_by`; None where that does not get there.
        limits: as `Demand` gives them."""
        shape = rhs.shape
        images: list[FloatArray] = []  # W times the steps
        try:
            precondition.update(A, B, changed_by)
        except SingularMatrix:
            return None

        alone, diagonal = block_kernels.diagonals(A, B)
        parts = pieces(len(rhs), CONTACTS_A_PIECE)

        def product(x: FloatArray) -> FloatArray:
            images.append(self._product(x))
            given, image = (A, B, alone, diagonal, images[-1].reshape(shape), x.reshape(shape)), np.empty(shape)
            side_by_side([partial(block_kernels.apply_most_diagonal, *given, i, j, image) for i, j in parts])
            return image.ravel()

        size = float(np.linalg.norm(rhs))
        accuracy, plateau = (size * limit for limit in limits)
        found = gmres(product, precondition, rhs.ravel(), accuracy, ITERATIONS, ITERATIONS, ENOUGH * size, plateau)
        if found is None:
            return None
        dr, y = found
        return dr, combined(y, images) if len(y) else np.zeros_like(dr)


def largest_joint(bodies: IntArray, count: int) -> int:
    """The most contacts (nc, 2) that one pair of `count` bodies has."""
    return int(np.unique(numbers_of_pairs(bodies, count), return_counts=True)[1].max(initial=0))
