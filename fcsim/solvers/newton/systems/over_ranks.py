"""Newton's linear system where ranks of MPI have W together: GMRES as in `preconditioned`, with the factor of W over ranks.

Each rank has the joints that it alone knows, with Z on them from its own fronts and from Z on the interface; joints on the interface are
every rank's. Vectors are whole on every rank, and all take the same steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray, IntArray
from fcsim.linear.block_rows import dofs_of
from fcsim.linear.elimination_tree import joints
from fcsim.linear.factors import SingularMatrix
from fcsim.problem import Delassus
from fcsim.problem.distributed import DistributedDelassus, DistributedFactor
from fcsim.solvers.memory import Kept
from fcsim.solvers.newton.systems.condensed import CondensedSystem
from fcsim.solvers.newton.systems.interface import NewtonSystem
from fcsim.solvers.newton.systems.preconditioned import SHIFTS, JointVelocities, PreconditionedSystem, starts_of_runs


@dataclass(frozen=True, eq=False)
class BlocksOverRanks:
    """contacts (k,): those that this rank alone knows, in the order of its fronts, and after them the interface's; Z and cuts as in
    `StiffnessBlocks`, on them."""

    factor: DistributedFactor
    contacts: IntArray
    Z: NDArray[np.floating]
    cuts: IntArray

    def preconditioner(self, A: FloatArray, B: FloatArray) -> Callable[[FloatArray], FloatArray]:
        """That of A W + B; SingularMatrix, on all ranks, where a joint's part is singular on one."""
        with self.factor.layout.together("joints of W"):
            velocities = JointVelocities(self.contacts, self.cuts, self.Z, A, B)
        d = A.shape[1]
        unknowns = dofs_of(self.contacts, d)

        def precondition(x: FloatArray) -> FloatArray:
            y = np.zeros_like(x)
            y[unknowns] = velocities(x)
            return self.factor.solve(y)

        return precondition


def blocks_over_ranks(W: DistributedDelassus) -> BlocksOverRanks | None:
    """Factor W for the preconditioner; None where W is not positive definite even when shifted."""
    layout = W.layout
    mean = float(np.abs(W.diagonal()).mean())
    with layout.together("joints of W"):
        joint = joints(W.rows.indptr, W.rows.indices)[0]
    between = layout.at_interface_of_ranks(joint[layout.at_interface])
    joint_between = np.unique(between, axis=1, return_inverse=True)[1].ravel()
    for shift in SHIFTS:
        try:
            factor = W.factor(shift * mean, rough=True)
        except SingularMatrix:
            continue
        at_interface = factor.inverse_at_interface()
        try:
            with layout.together("stiffness of joints"):
                return _with_stiffness(factor, joint, joint_between, at_interface)
        except SingularMatrix:
            continue
    return None


def _with_stiffness(
    factor: DistributedFactor, joint: IntArray, joint_between: IntArray, at_interface: NDArray[np.floating]
) -> BlocksOverRanks:
    """joint (k,), joint_between (b,): the joint of each of this rank's contacts, and of the interface's; at_interface: Z there."""
    layout, d = factor.layout, factor.layout.dimension
    own, order = factor.own.contacts, np.argsort(joint_between, kind="stable")
    inner, outer = d * starts_of_runs(joint[own]), d * starts_of_runs(joint_between[order])
    between = [at_interface[np.ix_(part, part)].ravel() for part in np.split(dofs_of(order, d), outer[1:-1])]
    Z = np.concatenate([factor.blocks_of_inverse(inner, at_interface), *between])
    if not np.all(np.isfinite(Z)):
        raise SingularMatrix("the stiffness of a joint is not finite")
    contacts = np.concatenate([layout.own[own], layout.interface[order]])
    return BlocksOverRanks(factor, contacts, Z, np.concatenate([inner[:-1], inner[-1] + outer]))


@dataclass(frozen=True, eq=False)
class KeptBlocks(Kept):
    """What serves the next W of the same contacts."""

    blocks: BlocksOverRanks


class SystemOverRanks:
    """Solves (A W + B) dr = rhs of a distributed W; where GMRES does not, all ranks go on with all of W, as one process would."""

    def __init__(self, operator: Delassus, whole: Callable[[Delassus], NewtonSystem], kept: KeptBlocks | None = None) -> None:
        """whole: what makes the system of all of W."""
        W = operator.W
        assert isinstance(W, DistributedDelassus)
        self.operator, self._W, self._make_whole = operator, W, whole
        self._preconditioned = PreconditionedSystem(W.matvec, partial(blocks_over_ranks, W), None if kept is None else kept.blocks)
        self._whole: NewtonSystem | None = None
        self.needed = 0.0  # the factor by which Newton's residual has still to fall; 0: not known

    def left(self, identity: IntArray) -> KeptBlocks | None:
        """What serves the next W of these contacts, None where there is nothing."""
        blocks = self._preconditioned.blocks
        return None if blocks is None else KeptBlocks(identity, blocks)

    def shifted(self, shift: FloatArray) -> NewtonSystem:
        return self._of_all().shifted(shift)

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        if self._preconditioned.pays and not len(self._W.layout.free):
            found = self._preconditioned.solve(A, B, rhs, self.needed)
            if found is not None:
                return found
        whole = self._of_all()
        if isinstance(whole, CondensedSystem):
            whole.needed = self.needed
        return whole.solve(A, B, rhs)

    def _of_all(self) -> NewtonSystem:
        if self._whole is None:
            self._whole = self._make_whole(Delassus(self._W.whole, self.operator.dimension))
        return self._whole
