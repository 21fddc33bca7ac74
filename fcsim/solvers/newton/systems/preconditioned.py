"""Newton's linear system by GMRES where neither a border of sliding contacts nor an LU a step fits: walls of many hundred bricks.

In the velocities y = W dr the system (A W + B) dr = rhs reads (A + B W^-1) y = rhs. Where a contact sticks B = 0, and y is known; W^-1 is
a stiffness, which couples the others with their neighbours above all. So W is factored once, whatever slides, and with Z the diagonal
blocks of W^-1 of the joints,

    dr = W^-1 y,        y = (A + B Z)^-1 x, joint by joint,

is GMRES' right preconditioner. A block of single contacts would not do: W of a joint is nearly singular (contacts at the middle of
faces hardly feel a checkerboard of forces), and its inverse as badly conditioned. The number of iterations hardly depends on how many
bodies there are, and another W or other statuses need no other factor as long as it pays.

Sources: Y. Saad, M. H. Schultz, SIAM J. Sci. Stat. Comput. 7, 1986 (GMRES); C. Farhat, F.-X. Roux, Int. J. Numer. Methods Eng. 32, 1991
(interface forces of floating bodies); the preconditioner is our own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray, IntArray
from fcsim.linear._front_kernels import times_blocks
from fcsim.linear.elimination_tree import joints
from fcsim.linear.factors import SingularMatrix
from fcsim.linear.fronts import MultifrontalCholesky, inverse_blocks
from fcsim.linear.joints import BlockRows
from fcsim.linear.krylov import gmres
from fcsim.solvers.newton.systems._condensed_kernels import apply_blocks

ACCURACY, SAFETY = 1e-4, 0.3
"""Defect relative to the right-hand side: a defect of 1e-2 in the velocities of sticking contacts is large in reactions, and opens some.
Where Newton's residual is near the tolerance a defect of SAFETY times what is left is enough (R. S. Dembo, S. C. Eisenstat, T. Steihaug,
SIAM J. Numer. Anal. 19, 1982)."""
ITERATIONS, ENOUGH = 80, 0.3
"""Iterations of GMRES, and the defect that must be reached by then: far from a solution, where much slides, Newton's method goes on with
less than ACCURACY."""
SHIFTS = (1e-6, 1e-4)
"""Added to W's diagonal, relative to its mean, where that is factored in single precision."""


@dataclass(frozen=True, eq=False)
class StiffnessBlocks:
    """The factor of W + shift I in single precision; Z, joint by joint, each on the unknowns cuts[k], ..., cuts[k + 1] - 1."""

    factor: MultifrontalCholesky
    Z: NDArray[np.floating]
    cuts: IntArray

    def preconditioner(self, A: FloatArray, B: FloatArray) -> Callable[[FloatArray], FloatArray]:
        """That of A W + B; SingularMatrix where a joint's part is singular."""
        velocities = JointVelocities(self.factor.contacts, self.cuts, self.Z, A, B)

        def precondition(x: FloatArray) -> FloatArray:
            step = np.empty((len(self.factor.contacts), A.shape[1]))
            step[self.factor.contacts] = self.factor.backward(self.factor.forward(velocities(x).reshape(-1, 1))[:, 0]).reshape(step.shape)
            return step.ravel()

        return precondition


def stiffness_blocks(rows: BlockRows) -> StiffnessBlocks | None:
    """Factor W for the preconditioner; None where W is not positive definite even when shifted."""
    d, nc = rows.blocks.shape[1], len(rows.indptr) - 1
    mean = float(np.abs(rows.W.diagonal()).mean())
    for shift in SHIFTS:
        try:
            factor = MultifrontalCholesky(rows, np.ones(nc, dtype=bool), np.float32, shift=shift * mean)
        except SingularMatrix:
            continue
        cuts = d * starts_of_runs(joints(rows.indptr, rows.indices)[0][factor.contacts])
        Z = inverse_blocks(factor, cuts)
        if np.all(np.isfinite(Z)):
            return StiffnessBlocks(factor, Z, cuts)
    return None


def starts_of_runs(number: IntArray) -> IntArray:
    """Where each run of equal numbers (k,) begins, and k."""
    return np.concatenate([np.zeros(min(len(number), 1), dtype=np.int64), np.flatnonzero(np.diff(number)) + 1, [len(number)]])


class JointVelocities:
    """x (m,) -> (A + B Z)^-1 x of these contacts (k,), joint by joint; the unknowns of joint j are cuts[j], ..., cuts[j + 1] - 1 in their
    order, Z as in `StiffnessBlocks`. SingularMatrix where a joint's part is singular."""

    def __init__(self, contacts: IntArray, cuts: IntArray, Z: NDArray[np.floating], A: FloatArray, B: FloatArray) -> None:
        self.contacts, self._cuts, self._d = contacts, cuts, A.shape[1]
        A, B, d = A[contacts], B[contacts], self._d
        size = np.diff(cuts)
        starts = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(size * size)])
        sliding = np.add.reduceat(B.any(axis=(1, 2)), cuts[:-1] // d, dtype=np.int64) > 0 if len(contacts) else np.empty(0, dtype=bool)
        self._own = np.empty(A.shape, dtype=np.float32)  # A^-1 where all contacts of a joint stick, else what `_blocks` multiply
        self._own[:] = np.eye(d)
        alone = np.repeat(~sliding, size // d)
        self._which, inverses = np.flatnonzero(sliding), []
        try:
            self._own[alone] = np.linalg.inv(A[alone])
            for k in self._which:
                n, part = size[k], slice(cuts[k] // d, cuts[k + 1] // d)
                block = Z[starts[k] : starts[k + 1]].reshape(n // d, d, n)
                J = (B[part] @ block).reshape(n // d, d, n // d, d)
                own = np.arange(n // d)
                J[own, :, own, :] += A[part]
                inverses.append(np.linalg.inv(J.reshape(n, n)).astype(np.float32).ravel())
        except np.linalg.LinAlgError:
            raise SingularMatrix("the velocities of a joint are not determined") from None
        self._blocks = np.concatenate([np.empty(0, dtype=np.float32), *inverses])

    def __call__(self, x: FloatArray) -> FloatArray:
        """y (k d,) in the order of the contacts, in single precision."""
        y: FloatArray = np.einsum("aij,aj->ai", self._own, x.reshape(-1, self._d)[self.contacts].astype(np.float32)).ravel()
        times_blocks(self._blocks, self._cuts, self._which, y)
        return y


class Blocks(Protocol):
    """W factored once, whatever slides."""

    def preconditioner(self, A: FloatArray, B: FloatArray) -> Callable[[FloatArray], FloatArray]:
        """That of A W + B, x (m,) -> W^-1 (A + B Z)^-1 x; SingularMatrix where a joint's part is singular."""
        ...


class PreconditionedSystem[Made: Blocks]:
    """Solves (A W + B) dr = rhs; blocks: what serves the next W too, None before the first use and where W cannot be factored."""

    def __init__(self, product: Callable[[FloatArray], FloatArray], make: Callable[[], Made | None], blocks: Made | None = None) -> None:
        """product: x -> W x (m,); make: what factors this W; blocks: of an earlier W."""
        self._product, self._make, self.blocks, self._earlier = product, make, blocks, blocks is not None
        self.pays = True

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray, needed: float = 0.0) -> tuple[FloatArray, FloatArray] | None:
        """dr and W dr (m,) for rhs (nc, d); None where that does not pay.

        needed: the factor by which Newton's residual has still to fall, 0: not known. Less is not asked of the defect.
        """
        accuracy = max(ACCURACY, min(ENOUGH, SAFETY * needed))
        if self.blocks is not None:
            found = self._step(self.blocks, A, B, rhs, accuracy)
            if found is not None:
                return found
        if self.pays and (self.blocks is None or self._earlier):
            self._earlier, self.blocks = False, None  # the old one makes room for the new
            self.blocks = self._make()
            found = None if self.blocks is None else self._step(self.blocks, A, B, rhs, accuracy)
            if found is not None:
                return found
        self.pays = self.blocks is not None
        return None

    def _step(self, blocks: Made, A: FloatArray, B: FloatArray, rhs: FloatArray, accuracy: float) -> tuple[FloatArray, FloatArray] | None:
        shape = rhs.shape
        images: list[FloatArray] = []  # W times the steps

        def product(x: FloatArray) -> FloatArray:
            images.append(self._product(x))
            image: FloatArray = apply_blocks(A, images[-1].reshape(shape), B, x.reshape(shape))
            return image.ravel()

        try:
            precondition = blocks.preconditioner(A, B)
        except SingularMatrix:
            return None
        size = float(np.linalg.norm(rhs))
        found = gmres(product, precondition, rhs.ravel(), accuracy * size, ITERATIONS, ITERATIONS, ENOUGH * size)
        if found is None:
            return None
        dr, y = found
        return dr, np.tensordot(y, images, 1) if len(y) else np.zeros_like(dr)


def system_of_joints(rows: BlockRows, blocks: StiffnessBlocks | None = None) -> PreconditionedSystem[StiffnessBlocks]:
    """That of W by block rows; blocks: of an earlier W."""
    return PreconditionedSystem(rows.product, partial(stiffness_blocks, rows), blocks)
