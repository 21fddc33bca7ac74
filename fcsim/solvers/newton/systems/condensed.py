"""Newton's linear system by condensation: what does not change between iterations and steps is eliminated once.

Two values do it: the held factor (`held`), of W on the contacts that were closed, and the border (`border`), the contacts whose status is
another since then. A step adds columns to the border and solves what is left there (`remainder`); W is factored anew only when the
border has grown too large for that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import DTypeLike

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.linear.factors import SingularMatrix, is_symmetric
from fcsim.linear.joints import Pattern
from fcsim.linear.krylov import gmres
from fcsim.linear.late.late_rows import in_blocks
from fcsim.linear.products import times, transposed_times
from fcsim.problem import Delassus
from fcsim.solvers.memory import Kept, Memory
from fcsim.solvers.newton.systems._condensed_kernels import apply_blocks, held_side, roles, signed
from fcsim.solvers.newton.systems.border import Border, empty_border, extended
from fcsim.solvers.newton.systems.direct import DenseSystem, SparseSystem
from fcsim.solvers.newton.systems.held import Held, hold
from fcsim.solvers.newton.systems.interface import NewtonSystem
from fcsim.solvers.newton.systems.multifrontal import MultifrontalSystem
from fcsim.solvers.newton.systems.preconditioned import StiffnessBlocks, system_of_joints
from fcsim.solvers.newton.systems.remainder import Factored, Remainder, split_known
from fcsim.solvers.newton.systems.two_level.settling import SettlesJoints
from fcsim.solvers.newton.systems.two_level.system import Preconditioner, TwoLevelSystem

FORCING = 1e-2
"""Defect, relative to the right-hand side, at which a Newton step by an earlier W's factor is accepted."""
INNER = 2e-3
"""The same for the border's system where such a step is a preconditioner's."""
ACCURACY = 1e-4
"""Defect at which a step by this W's factor in single precision is accepted."""
SINGLE_FROM = 1500
"""Contact unknowns from which factor and border are kept in single precision."""
PRECISIONS: tuple[tuple[DTypeLike, DTypeLike], ...] = ((np.float32, np.float32), (np.float64, np.float32), (np.float64, np.float64))
"""Those of the factor and of the border that are tried one after the other. Where meshes are fine, reactions in checkerboards are resisted
1e-7 times as much as a push on one contact, and W has no factor in single precision; columns by a factor in double precision may be kept
in single all the same."""
WELL_CONDITIONED, WELL_CONDITIONED_SINGLE = 1e-8, 1e-5
"""Least pivot over the largest from which the factor on all closed contacts is trusted; rank-deficient W gives round-off, 1e-16 or 1e-7."""
UNSETTLED, FEW_SLIDE = 0.05, 0.25
"""Share of the contacts whose status changes from step to step above which a factor to be held would not last: the fronts' LU is cheaper.
At first, share of the closed contacts that may slide: a cold start has more, a warm one less."""
BORDER_UP_TO = 2e9
"""Bytes of the border's columns up to which it is carried: a wall of a thousand bricks would have more, and goes on without one (see
`preconditioned`)."""
CORRECTIONS = 8
"""Iterations of GMRES with an earlier W's factor before factoring anew."""
TWO_LEVEL_FROM = 20_000
"""Contact unknowns (a hundred bricks) from which systems of a W whose bodies are known are solved without any factor of W (`two_level`)
where GMRES gets there; below it a border on a factor takes less."""


@dataclass(frozen=True, eq=False)
class Condensation:
    """The held factor, the border on it, and the last LU of what was left there; earlier: whether they belong to an earlier W."""

    held: Held
    border: Border
    factored: Factored | None = None
    earlier: bool = False


@dataclass(frozen=True, eq=False)
class KeptCondensation(Kept):
    """What serves the next W: the condensation, as a preconditioner, the analysis, and which choices had to be made.

    status (nc,): 0 open, 1 sliding, 3 sticking in the last step; precision: which of PRECISIONS; pattern: None where contacts do not come
    in joints; blocks: in the place of a condensation whose border would be too large, and two_level where nothing of W is factored.
    """

    condensation: Condensation | None
    status: IntArray
    precision: int
    holds_sliding: bool
    pattern: Pattern | None
    blocks: StiffnessBlocks | None = None
    two_level: Preconditioner | None = None


def last_pattern(memory: Memory | None) -> Pattern | None:
    """That of the W before, of the same contacts, where they come in joints."""
    kept = None if memory is None else memory.of_same_contacts(KeptCondensation)
    return None if kept is None else kept.pattern


class CondensedSystem(SettlesJoints[TwoLevelSystem]):
    """Elimination of what does not change between iterations: closed contacts, of which sliding ones are released again.

    W must be symmetric; where it is not positive definite on the closed contacts, those that stick are held, and where it is not on these
    the LU of the whole takes over; of joints it does also as long as the sets are far from settled. Of a sparse W whose contacts come in
    joints the factor is multifrontal, else dense. Large factors and columns are kept in single precision, columns alone where W has no
    factor in it (PRECISIONS), and those of an earlier W serve the next: they are then the preconditioner of GMRES on the true system.
    Where that does not pay all is factored anew, in the next precision if that was not the last. Where contacts come in joints and the
    border would be too large, W's factor and the joints' own stiffness precondition (`PreconditionedSystem`). A large W of known bodies is
    not factored where GMRES gets there without (`TwoLevelSystem`).
    """

    def __init__(self, operator: Delassus, kept: KeptCondensation | None = None) -> None:
        """kept: what the system of an earlier W of the same contacts has left."""
        self.operator, self._d = operator, operator.dimension
        W = operator.matrix
        self._rows = operator.joints_like(None if kept is None else kept.pattern)
        self._W = W if isinstance(W, np.ndarray) else in_blocks(W, self._d) if self._rows is None else self._rows.W
        self._precision = 0 if W.shape[0] >= SINGLE_FROM else len(PRECISIONS) - 1
        self._holds_sliding = True
        self._status: IntArray | None = None  # of the contacts at the last step
        self._condensation: Condensation | None = None
        self._preconditioned = None if self._rows is None else system_of_joints(self._rows, None if kept is None else kept.blocks)
        self.needed, self.foreseen = 0.0, False  # as in `NewtonSpace`; 0: not known
        known = operator.shares if operator.shift is None and operator.size >= TWO_LEVEL_FROM else None
        self._two_level = (
            None if known is None or self._rows is None else TwoLevelSystem(self._rows, known, None if kept is None else kept.two_level)
        )
        if kept is not None:
            self._precision, self._holds_sliding, self._status = kept.precision, kept.holds_sliding, kept.status
            self._condensation = None if kept.condensation is None else replace(kept.condensation, earlier=True)

    def shifted(self, shift: FloatArray) -> CondensedSystem:
        return CondensedSystem(self.operator.shifted(shift))

    def left(self, identity: IntArray) -> KeptCondensation | None:
        """What serves the next W of these contacts, None where nothing is held."""
        blocks = None if self._preconditioned is None else self._preconditioned.blocks
        if (self._condensation is None and blocks is None and self._two_level is None) or self._status is None:
            return None
        pattern = None if self._rows is None else self._rows.pattern
        two_level = None if self._two_level is None else self._two_level.left
        return KeptCondensation(
            identity, self._condensation, self._status, self._precision, self._holds_sliding, pattern, blocks, two_level
        )

    def _product(self, x: FloatArray) -> FloatArray:
        """W x (m,)."""
        Wx: FloatArray = self._W @ x if self._rows is None else self._rows.product(x)
        return Wx

    @cached_property
    def _whole(self) -> NewtonSystem:
        """What solves where the condensation cannot."""
        operator = Delassus(self._W, self._d)
        if self._rows is not None:
            return MultifrontalSystem(operator, self._rows)
        return DenseSystem(operator) if isinstance(self._W, np.ndarray) else SparseSystem(operator)

    @cached_property
    def _symmetric(self) -> bool:
        return is_symmetric(self._W)

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        closed, sticking = roles(A, B)
        if not closed.any():
            return self._whole.solve(A, B, rhs)
        settled = self._settled(closed, sticking)
        columns, rows = (self._d * np.count_nonzero(contacts) for contacts in (closed & ~sticking, closed))
        border = columns * rows * np.dtype(PRECISIONS[self._precision][1]).itemsize
        if self._two_level is not None:
            found = self._two_level.solve(A, B, rhs, self.needed, self.foreseen)
            if found is not None:
                return found
        if self._condensation is not None and not _outgrown(self._condensation, self._holds_sliding, closed, sticking):
            found = self._by_what_is_held(A, B, rhs)
            if found is not None:
                return found
        self._condensation = None
        large = border > BORDER_UP_TO
        found = None
        if self._preconditioned is not None and (large or self._preconditioned.blocks is not None) and self._symmetric:
            found = self._preconditioned.solve(A, B, rhs, self.needed)
            if found is not None:
                return found
        if not large and (settled or self._rows is None) and self._symmetric:
            found = self._by_a_new_factor(A, B, rhs, closed, sticking)
        return self._whole.solve(A, B, rhs) if found is None else found

    def _by_a_new_factor(
        self, A: FloatArray, B: FloatArray, rhs: FloatArray, closed: BoolArray, sticking: BoolArray
    ) -> tuple[FloatArray, FloatArray] | None:
        """The step by a factor on the closed contacts or, where that fails, on the sticking ones; in the end in double precision."""
        factored: Held | None = None
        while True:
            held, trusted = (closed, WELL_CONDITIONED) if self._holds_sliding else (sticking, 0.0)
            (factor, columns), last = PRECISIONS[self._precision], self._precision == len(PRECISIONS) - 1
            if factored is None or factored.dtype is not factor:
                factored = self._hold(held, WELL_CONDITIONED_SINGLE if factor is np.float32 else trusted)
            if factored is not None:
                self._condensation = Condensation(factored, empty_border(factored, self._d, columns))
                found = self._by_what_is_held(A, B, rhs)
                if found is not None:
                    return found
                self._condensation = None
                if last:
                    return None
            elif factor is np.float64:
                if not self._holds_sliding:
                    return None
                self._holds_sliding = False
                continue
            self._precision += 1

    def _hold(self, contacts: BoolArray, conditioning: float) -> Held | None:
        return hold(
            self._W,
            self._rows,
            self._d,
            contacts,
            with_sliding=self._holds_sliding,
            dtype=PRECISIONS[self._precision][0],
            conditioning=conditioning,
        )

    def _settled(self, closed: BoolArray, sticking: BoolArray) -> bool:
        """Whether few contacts have another status than in the last step; without one, whether few of the closed contacts slide."""
        before, self._status = self._status, closed + 2 * sticking
        if before is None:
            return bool(np.count_nonzero(closed & ~sticking) <= FEW_SLIDE * np.count_nonzero(closed))
        return bool(np.count_nonzero(self._status != before) <= UNSETTLED * len(closed))

    def _by_what_is_held(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """The step by the factor and border that are there; None where they cannot give it."""
        assert self._condensation is not None
        earlier, single = self._condensation.earlier, self._condensation.border.dtype == np.float32
        try:
            step = _Step(self, self._condensation, A, B, inexact=earlier)
            found = self._corrected(step, A, B, rhs, earlier=earlier) if earlier or single else step.solve(rhs, 0.0)
        except SingularMatrix:
            return None
        if found is None:
            return None
        self._condensation = step.left()
        return found if isinstance(found, tuple) else (found, self._product(found))

    def _corrected(
        self, step: _Step, A: FloatArray, B: FloatArray, rhs: FloatArray, *, earlier: bool
    ) -> tuple[FloatArray, FloatArray] | None:
        """GMRES with factor and border as preconditioner; None where it does not pay."""
        shape = rhs.shape
        images: list[FloatArray] = []  # W times the steps

        def product(x: FloatArray) -> FloatArray:
            images.append(self._product(x))
            Wx = images[-1].reshape(shape)
            image: FloatArray = apply_blocks(A, Wx, B, x.reshape(shape))
            return image.ravel()

        def precondition(x: FloatArray) -> FloatArray:
            return step.solve(x.reshape(shape), INNER if earlier else 0.0)

        accuracy = FORCING if earlier else ACCURACY
        found = gmres(product, precondition, rhs.ravel(), accuracy * float(np.linalg.norm(rhs)), CORRECTIONS)
        if found is None:
            return None
        dr, y = found
        return dr, np.tensordot(y, images, 1) if len(y) else np.zeros_like(dr)


def _outgrown(condensation: Condensation, holds_sliding: bool, closed: BoolArray, sticking: BoolArray) -> bool:
    """Whether many closed contacts are not held, or stick and are in the border all the same: factoring anew then costs less."""
    held, in_border = condensation.held, condensation.border.column >= 0
    carried = np.count_nonzero(np.where(held.is_held, sticking & in_border, closed if holds_sliding else sticking))
    return bool(carried > 80 + 0.2 * len(held.contacts))


class _Step:
    """Solves A W dr + B dr = rhs for one A and B by a condensation, in its precision; its border gets the columns that these need."""

    def __init__(self, system: CondensedSystem, given: Condensation, A: FloatArray, B: FloatArray, *, inexact: bool) -> None:
        """inexact: whether the system that is left on the border will be solved with a defect."""
        held, self._d = given.held, system._d
        A, B = (x.astype(given.border.dtype, copy=False) for x in (A, B))
        closed, sticking = roles(A, B)
        border = extended(given.border, held, system._W, np.flatnonzero(np.where(held.is_held, ~sticking, closed)))
        self._given, self._border, self._product = given, border, system._product
        self._open = ~(closed | held.is_held)  # an open contact that was held stays in the system as a released one
        self._stays = ~_among(border.contacts[border.released], held)
        self._A, self._B = A, B
        released, every = border.released, border.contacts
        self._own = own = every[released]
        # a released contact's unknown is W dr and its response dr: A and B change places
        outer, inner = A[every], B[every]
        outer[released], inner[released] = B[own], A[own]
        unknown = np.repeat(~self._open[every][:, None], self._d, axis=1)
        unknown[released] = split_known(A[own], B[own], np.zeros((len(own), self._d), dtype=border.dtype))[1]
        self._remainder = Remainder(border.response, outer, inner, unknown, given.factored, inexact=inexact)

    def left(self) -> Condensation:
        """The condensation with the border and the factor that were needed here."""
        return replace(self._given, border=self._border, factored=self._remainder.factored)

    def solve(self, rhs: FloatArray, tolerance: float) -> FloatArray:
        """The step dr (m,); tolerance: defect of the border's system relative to rhs (nc, d), 0: round-off."""
        d, held, border = self._d, self._given.held, self._border
        dr = np.where(self._open[:, None], rhs, 0)
        rhs = rhs.astype(border.dtype, copy=False)
        coupling = np.zeros_like(rhs)
        if np.any(dr):
            coupling += self._product(dr.ravel().astype(float, copy=False)).reshape(-1, d)
        t = np.empty((len(held.contacts), d), dtype=held.dtype)
        if not held_side(self._A, rhs, coupling, held.contacts, self._stays, t):
            raise SingularMatrix("the block of a sticking contact is singular")
        z = held.factor.forward(t.reshape(-1, 1))[:, 0]
        if len(border.contacts):
            released, free = border.released, border.contacts[~border.released]
            known = times(border.PT, z.astype(border.dtype, copy=False)).reshape(-1, d)
            signed(known, released, coupling, border.contacts)
            x = np.zeros_like(known)
            x[released] = split_known(self._A[self._own], self._B[self._own], rhs[self._own])[0]
            self._remainder.complete(x, known, rhs, border.contacts, tolerance * float(np.linalg.norm(rhs)))
            z -= transposed_times(border.PT, x.ravel())
            dr[free] += x[~released]
        dr[held.contacts] = held.factor.backward(z).reshape(-1, d)
        return dr.ravel().astype(float, copy=False)


def _among(contacts: IntArray, held: Held) -> BoolArray:
    """Which of the held contacts (s,) are among `contacts`."""
    among = np.zeros(len(held.contacts), dtype=bool)
    among[held.place[contacts]] = True
    return among
