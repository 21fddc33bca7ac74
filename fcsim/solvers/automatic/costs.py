"""What the stages of `auto` cost: operations and bytes counted from each algorithm, times the rates of `fcsim.linear.storage`.

d unknowns a contact, nc contacts, m = d nc; entries: those of W that are not zero.

    sweep (Gauss-Seidel)   W is read once, by blocks of nine entries in 2D as well; `SWEPT` operations a contact
    Newton, dense          LU of A W + B: 2/3 c^3 for the c unknowns of contacts that are not open, since those leave the system; W is read
                           `PASSES` times: rows scaled, copied, eliminated, multiplied
    Newton, sparse         LU by the elimination tree's count; the entries are gathered and scattered `SCATTERS` times; of both c / m
    Newton, joints         the same on large fronts, at the dense rate
    ADMM                   one Cholesky factor (half an LU) and W's norm (`NORMED` reads of W), then solves that read the factor twice and
                           W once an iteration
    proximal Newton        Newton's iterations, each with its own factor; where few degrees of freedom are behind W, an LU in the bodies'
                           velocities by its own count
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fcsim.linear.joints import BlockRows
from fcsim.linear.late.late_rows import source_of
from fcsim.linear.storage import REAL, REFERENCE, Machine, Work
from fcsim.problem import Delassus, LocalProblem
from fcsim.solvers.interior_point.systems import by_bodies
from fcsim.solvers.newton.systems.choice import eliminated_in_velocities
from fcsim.solvers.newton.systems.velocity import bodies_of
from fcsim.solvers.proximal.in_velocities import UP_TO

SCALAR = 10.0
"""Times the dense rate's time that an operation takes which waits for the one before it: a contact's own equations."""
ONE_CONTACT = 100 * SCALAR
"""Operations of a one-contact Newton solve in 3D: about an iteration of 150, and next to none where a contact stays open."""
SWEPT, IN_CACHE = 0.6 * ONE_CONTACT, 0.8
"""Operations a contact of sweeps, since not all are closed; and the time of a number that they read over that of the memory's rate."""
UNSOLVED = 60 * ONE_CONTACT
"""Operations of a one-contact problem that is not solved within its 20 iterations, as Painlevé's where it has no solution: 2.2 to 2.9
microseconds, measured."""
IRREGULAR = 2.0
"""Times the dense rate's time that an operation takes on the small fronts and indirect addresses of sparse elimination."""
PASSES, SCATTERS = 4, 16
"""How often Newton's system reads or writes W: dense, and entry by entry with its index."""
NEWTON_STEPS, SPARSE_STEPS, ADMM_STEPS, ADMM_BEGINS = 40, 200, 5, 40
"""Small steps (calls on vectors) of an iteration: Newton's on a dense W, on a sparse one with what it takes to hand it over, ADMM's; and
before ADMM's first one."""
RUNNING_STEPS = 80
"""Those of an iteration of proximal Newton on a sparse W that is running: as measured. Who asks whether it is to begin counts those above,
since it mostly needs more iterations than expected."""
OWN, OWN_COMPILED = 25_000, 7500
"""Operations of a contact's own equations in such an iteration in the bodies' velocities, as measured: 1 and 0.3 microseconds."""
COMPILED, COMPILED_2D = 0.6, 0.85
"""Such an iteration up to 600 velocities, compiled, its places planned once, over its count: measured 0.33 to 0.65 where sweeps, ADMM and
interior points are 0.8 to 1.1 of theirs (walls, towers, boxes, nearly singular piles, rocks, large friction; 100 to 300 contacts). In the
plane 0.65, but an interior point 0.75 too (arches): what counts is what the one takes for the other."""
NORMED = 40
"""How often W is read for its norm, by 20 to 30 products from Python, before ADMM's first iteration."""
SHARES, PRODUCTS = 8, 3
"""How often an iteration in the bodies' velocities reads or writes the contacts' shares of their matrix, and W."""
PIECE = {2: 0.4, 3: 0.2}
"""A piece of a path over an iteration of proximal Newton without the contacts' own equations, in the bodies' velocities, in 2D and in 3D:
measured 0.35 to 0.6 on arches and walls of 300 to 2000 contacts, 0.1 to 0.4 where faces hold one another. Its steps are compiled and
change an elimination at one contact."""
PIECE_IN_W = 1.0
"""The same in W of few contacts, where its steps are not compiled."""
INTERIOR_STEPS, OWN_INTERIOR = 40, 45_000
"""Small steps of an iteration of the interior point beside its system, and operations of a contact, as measured."""
SVD = 10
"""Operations of a singular value decomposition with both sides of vectors, over m^3, in those of the dense rate: 20 are counted by
G. H. Golub, C. F. Van Loan, 1996, section 5.4; LAPACK's `gesdd` takes the time of 14 at 400 unknowns, of 10 at 700."""
LP, LP_STEPS = 10, 1000
"""Operations of a linear programme, over entries times variables: about two pivots a variable, each some passes; and its small steps."""


def sweep(blocks: float, nc: int) -> Work:
    """One Gauss-Seidel sweep: blocks of nine entries, in 2D as well."""
    return Work(SWEPT * nc, IN_CACHE * REAL * 9 * blocks)


def lu_flops(problem: LocalProblem) -> float:
    """Operations of an LU of W, by the elimination tree where W is stored by block rows."""
    if isinstance(problem.W, np.ndarray):
        return 2 / 3 * problem.m**3
    return problem.delassus.analysis[1].flops  # which Newton's and ADMM's factors need as well


@dataclass(frozen=True, eq=False)
class Prices:
    """Seconds on the reference machine, each counted when it is first asked for; problem: as `auto` stores it; counted: how many entries of
    W are not zero, or W itself, whose entries are counted then."""

    problem: LocalProblem
    counted: int | Delassus
    joints: BlockRows | None
    machine: Machine = REFERENCE

    @staticmethod
    def of(problem: LocalProblem, operator: Delassus, joints: BlockRows | None) -> Prices:
        """Those of a problem that is stored as it is eliminated; operator: W as it was given. Where entries in joints are summed when they
        are read the room that there is for them counts: a price is not to have them summed."""
        late = joints is not None and source_of(operator.W) is not None
        return Prices(problem, len(joints.indices) * operator.dimension**2 if joints is not None and late else operator, joints)

    @cached_property
    def entries(self) -> int:
        """W's entries that are not zero."""
        return self.counted if isinstance(self.counted, int) else self.counted.entries

    @cached_property
    def sweep(self) -> float:
        """A Gauss-Seidel sweep."""
        return self.machine.seconds(sweep(self.entries / self.problem.dimension**2, self.problem.nc))

    @cached_property
    def unsolved_contact(self) -> float:
        """A one-contact problem that is not solved, beside its sweep's price."""
        return self.machine.seconds(Work(UNSOLVED))

    @cached_property
    def flops(self) -> float:
        """Operations of an LU, in those of the dense rate."""
        if self.joints is not None:
            return self.joints.tree.flops(self.problem.dimension)
        return (IRREGULAR if sp.issparse(self.problem.W) else 1.0) * lu_flops(self.problem)

    @cached_property
    def _gather(self) -> Work:
        """W brought into the storage that is eliminated."""
        if self.joints is not None:
            return Work(bytes=SCATTERS * REAL * self.entries, steps=10 * len(self.joints.tree))
        if sp.issparse(self.problem.W):
            return Work(bytes=SCATTERS * 2 * REAL * self.entries)
        return Work(bytes=PASSES * REAL * self.problem.m**2)

    def least(self, closed: int) -> float:
        """An iteration of Newton without its elimination, whose count takes time of its own: no iteration costs less.

        closed: contact unknowns whose reaction is not zero; none: nothing is known of them.
        """
        steps = SPARSE_STEPS if sp.issparse(self.problem.W) else NEWTON_STEPS
        return self.machine.seconds(Work(steps=steps) + self._share(closed) * self._gather)

    def newton(self, closed: int) -> float:
        """An iteration of Newton or of proximal Newton."""
        if self.in_velocities and self.problem.delassus.motion is not None and self.problem.delassus.motion.regular:
            return self.proximal(closed)
        share = self._share(closed) ** (1 if sp.issparse(self.problem.W) else 3)
        return self.least(closed) + self.machine.seconds(Work(share * self.flops))

    @cached_property
    def in_velocities(self) -> bool:
        """Whether proximal Newton eliminates in the bodies' velocities."""
        return eliminated_in_velocities(self.problem.delassus)

    def proximal(self, closed: int) -> float:
        """An iteration of proximal Newton: of its own elimination where that is in the bodies' velocities, else Newton's."""
        if not self.in_velocities:
            return self.newton(closed)
        bodies = bodies_of(self.problem.delassus)
        return self.least_in_velocities + self.machine.seconds(Work(bodies.flops, SHARES * REAL * bodies.places_count))

    def running(self, closed: int) -> float:
        """An iteration of proximal Newton once it has begun."""
        if self.in_velocities:
            motion = self.problem.delassus.motion
            if motion is not None and motion.M.shape[0] <= UP_TO:
                compiled = COMPILED if self.problem.dimension == 3 else COMPILED_2D
                return compiled * (self.proximal(closed) + self.machine.seconds(Work(OWN_COMPILED * self.problem.nc)))
            return self.proximal(closed) + self.machine.seconds(Work(OWN * self.problem.nc))
        if self.joints is not None and closed:  # open contacts leave the fronts
            share = closed / self.problem.m
            return self.machine.seconds(Work(share**3 * self.flops, steps=SPARSE_STEPS) + share * self._gather)
        loaded = SPARSE_STEPS - RUNNING_STEPS if sp.issparse(self.problem.W) else 0
        return self.proximal(closed) - self.machine.seconds(Work(steps=loaded))

    @cached_property
    def interior(self) -> float:
        """An iteration of the interior point on Coulomb's law: one factor, its own small steps."""
        operator = self.problem.delassus
        if by_bodies(operator):
            bodies = bodies_of(operator)
            system = self.least_in_velocities + self.machine.seconds(Work(bodies.flops, SHARES * REAL * bodies.places_count))
        else:
            system = self.machine.seconds(Work(self.flops) + self._gather)
        return system + self.machine.seconds(Work(OWN_INTERIOR * self.problem.nc, steps=INTERIOR_STEPS))

    @property
    def piece(self) -> float:
        """A piece of a path in the bodies' velocities, which mostly changes an elimination at one contact, or in W; or an iteration of
        Newton."""
        return (PIECE[self.problem.dimension] if self.in_velocities else PIECE_IN_W) * self.proximal(0)

    @cached_property
    def least_in_velocities(self) -> float:
        """An iteration of proximal Newton in the bodies' velocities without its elimination, whose count takes time of its own."""
        return self.machine.seconds(Work(bytes=PRODUCTS * REAL * self.entries, steps=NEWTON_STEPS))

    def _share(self, closed: int) -> float:
        return closed / self.problem.m if closed and self.joints is None else 1.0

    @cached_property
    def least_admm(self) -> float:
        """An iteration of ADMM whose factor fills in nothing."""
        return self.machine.seconds(Work(bytes=REAL * self._reads(self.entries), steps=ADMM_STEPS))

    @cached_property
    def admm(self) -> float:
        """An iteration of ADMM."""
        filled = 2 * self.entries
        if self.joints is None and sp.issparse(self.problem.W) and self.problem.delassus.symmetric:
            filled = self.problem.delassus.analysis[1].entries
        return self.machine.seconds(Work(bytes=REAL * self._reads(filled), steps=ADMM_STEPS))

    def _reads(self, factor: float) -> float:
        """Numbers read by an iteration with a factor of so many entries."""
        return 2 * factor + self.entries if sp.issparse(self.problem.W) else 2 * self.problem.m**2

    def splitting(self, iterations: int) -> float:
        """ADMM's factor and so many iterations."""
        return self.machine.seconds(Work(0.5 * self.flops) + self._admm_begins) + iterations * self.admm

    def least_splitting(self, iterations: int) -> float:
        """The same with a factor that takes no operations and fills in nothing."""
        return self.machine.seconds(self._admm_begins) + iterations * self.least_admm

    @property
    def _admm_begins(self) -> Work:
        """What ADMM does before its first iteration beside its factor."""
        return Work(bytes=NORMED * REAL * self.entries, steps=ADMM_BEGINS) + self._gather

    def least_squares(self, closed: int) -> float:
        """An iteration of Levenberg-Marquardt: the singular values of the matrix of the unknowns of contacts that are not open."""
        return self.machine.seconds(Work(SVD * closed**3, steps=NEWTON_STEPS))

    @cached_property
    def proof(self) -> float:
        """A linear programme of a variable a contact and a row an unknown or, where those are known, a velocity; by the rows' entries."""
        motion = self.problem.delassus.motion
        rows = (self.entries if motion is None else motion.HT.nnz) / self.problem.dimension
        return self.machine.seconds(Work(LP * IRREGULAR * rows * self.problem.nc, steps=LP_STEPS))
