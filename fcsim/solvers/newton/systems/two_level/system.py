"""Newton's linear system by GMRES with the joints' own blocks and the bodies' most compliant motions: nothing of W is factored.

W = E + G G^T, where a column of G is what one of a body's most compliant motions does at its contacts: the rigid motions, which inertia
alone resists, and the few that strain a body as a whole. What is left, E, couples contacts of one joint (contacts of one pair of bodies)
above all, and those that share nodes with them. Q takes from E what it has on a joint and these neighbours:

    Q x on a joint = the joint's rows of (A E + B)^-1 x on the joint and its neighbours            (restricted additive Schwarz)

and with Q in the place of (A E + B)^-1 the preconditioner is the inverse of A (E + G G^T) + B,

    P^-1 = Q - Q A G (I + G^T Q A G)^-1 G^T Q                                                     (Sherman, Morrison, Woodbury)

I + G^T Q A G is the wall of bodies with k degrees of freedom each on joints as stiff as their contacts' status makes them: it carries what
goes from body to body, so that iterations hardly grow with the number of bodies. It is sparse, and all that is factored as a whole.

GMRES works on P^-1 (A W + B) dr = P^-1 rhs, whose defect is one of reactions: a defect of 1e-2 in velocities is large in reactions.

Sources: C. Farhat, F.-X. Roux, Int. J. Numer. Methods Eng. 32, 1991 (rigid motions as the coarse problem of interface forces); X.-C. Cai,
M. Sarkis, SIAM J. Sci. Comput. 21, 1999 (restricted additive Schwarz); N. Spillane, D. J. Rixen, Int. J. Numer. Methods Eng. 95, 2013
(motions that join the rigid ones); Y. Saad, M. H. Schultz, SIAM J. Sci. Stat. Comput. 7, 1986 (GMRES). That friction is in Q and in the
coarse matrix is our own.
"""

from __future__ import annotations

from functools import cached_property, partial

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.linear.factors import SingularMatrix
from fcsim.linear.fronts import Multifrontal
from fcsim.linear.joints import BlockRows
from fcsim.linear.krylov import gmres
from fcsim.problem.bodies.product import ShareProduct
from fcsim.problem.bodies.shares import KnownShares
from fcsim.solvers.newton.systems._condensed_kernels import apply_blocks
from fcsim.solvers.newton.systems.two_level import _joint_kernels as kernels
from fcsim.solvers.newton.systems.two_level.joints import JOINT_UP_TO, MOTIONS, Joints
from fcsim.threads import pieces_by_work, side_by_side

ACCURACY, LEAST, SAFETY = 1e-2, 0.1, 0.3
"""Defect relative to the right-hand side, both as reactions. On walls 1e-3 takes twice the iterations of GMRES for as many of Newton's.
Where Newton's residual is near the tolerance a defect of SAFETY times what is left of the way is enough, LEAST at most."""
ITERATIONS, ENOUGH = 200, 0.3
"""Iterations of GMRES, and the defect that must be reached by then: far from a solution, where much slides, Newton's method goes on with
less than ACCURACY."""
ENTRIES_A_PIECE = 300_000
"""Entries of joints' blocks that one thread multiplies."""


class _Preconditioner:
    """x (m,) -> P^-1 x; SingularMatrix where a joint or the bodies' motions are singular."""

    def __init__(self, joints: Joints, A: FloatArray, B: FloatArray) -> None:
        self._joints, k, n = joints, MOTIONS, joints.count
        A, B = A[joints.order], B[joints.order]
        self._A = A.astype(np.float32)
        self._Q, T = np.empty(joints.Q_starts[-1], dtype=np.float32), np.empty(joints.T_starts[-1])
        given = (A, B, joints.E, joints.shift, joints.cuts, (joints.begins, joints.wide), joints.modes, joints.starts)
        out = (self._Q, joints.Q_starts, T, joints.T_starts)
        every = np.arange(len(joints.cuts) - 1)
        try:
            side_by_side([partial(kernels.invert_joints, *given, out, every[i:j]) for i, j in joints.ranges])
        except np.linalg.LinAlgError:
            raise SingularMatrix("a joint's block is singular") from None
        S = np.zeros((len(joints.coarse_columns), k, k))
        S[joints.diagonal] = np.eye(k)
        kernels.add_joints(T, joints.T_starts, joints.places, joints.place_begins, joints.body_begins, S)
        coarse = BlockRows(sp.bsr_array((S, joints.coarse_columns, joints.coarse_begins), shape=(n * k, n * k)), k)
        self._coarse = Multifrontal(coarse, np.broadcast_to(np.eye(k), (n, k, k)), np.zeros((n, k, k)), np.ones(n, dtype=bool))
        self._ranges = pieces_by_work(joints.Q_starts, ENTRIES_A_PIECE)

    def _joint_by_joint(self, x: FloatArray) -> FloatArray:
        """Q x."""
        j, z = self._joints, np.empty_like(x)
        given = (self._Q, j.Q_starts, j.cuts, j.begins, j.wide)
        side_by_side([partial(kernels.solve_joints, *given, begin, end, x, z) for begin, end in self._ranges])
        return z

    def __call__(self, x: FloatArray) -> FloatArray:
        joints = self._joints
        x = x.reshape(-1, joints.d)[joints.order].astype(np.float32)
        c = np.zeros((joints.count, MOTIONS), dtype=np.float32)
        kernels.restrict(joints.G32, joints.bodies, self._joint_by_joint(x), c)
        order = self._coarse.contacts
        c[order] = self._coarse.solve(c[order].astype(float))
        rest = np.empty_like(x)
        kernels.less_motions(self._A, joints.G32, joints.bodies, c, x, rest)
        step = np.empty(x.shape)
        step[joints.order] = self._joint_by_joint(rest)
        return step.ravel()


class TwoLevelSystem:
    """Solves (A W + B) dr = rhs for one W, the sum of the bodies' shares."""

    def __init__(self, rows: BlockRows, known: KnownShares) -> None:
        """known: the shares of the matrix of `rows`."""
        self._rows, self._shares = rows, known.make()
        self._bodies = self._shares.bodies()
        self.pays = self._bodies is not None and int(np.unique(self._bodies[0], axis=0, return_counts=True)[1].max()) <= JOINT_UP_TO

    @cached_property
    def _joints(self) -> Joints:
        assert self._bodies is not None
        return Joints(self._rows, self._shares, *self._bodies)

    @cached_property
    def _product(self) -> ShareProduct:
        assert self._bodies is not None
        return ShareProduct(self._shares, self._bodies[1])

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray, needed: float = 0.0) -> tuple[FloatArray, FloatArray] | None:
        """dr and W dr (m,) for rhs (nc, d); None where joints are too large or GMRES does not get there, and from then on.

        needed: the factor by which Newton's residual has still to fall, 0: not known. Less is not asked of the defect.
        """
        if not self.pays:
            return None
        shape = rhs.shape
        try:
            precondition = _Preconditioner(self._joints, A, B)
        except SingularMatrix:
            self.pays = False
            return None

        def product(x: FloatArray) -> FloatArray:
            return precondition(apply_blocks(A, self._product(x).reshape(shape), B, x.reshape(shape)).ravel())

        given = precondition(rhs.ravel())
        size = float(np.linalg.norm(given))
        accuracy = max(ACCURACY, min(LEAST, SAFETY * needed))
        found = gmres(product, _itself, given, accuracy * size, ITERATIONS, ITERATIONS, ENOUGH * size)
        if found is None:
            self.pays = False
            return None
        dr = found[0]
        return dr, self._product(dr)


def _itself(x: FloatArray) -> FloatArray:
    """GMRES' preconditioner where the system is preconditioned already."""
    return x
