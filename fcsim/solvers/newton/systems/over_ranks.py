"""Newton's linear system where ranks of MPI have W together: by the two-level preconditioner, else, on each rank, with all of W."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from fcsim.arrays import FloatArray, IntArray
from fcsim.problem import Delassus
from fcsim.problem.distributed import DistributedDelassus
from fcsim.solvers.memory import Kept
from fcsim.solvers.newton.systems.condensed import CondensedSystem
from fcsim.solvers.newton.systems.interface import NewtonSystem
from fcsim.solvers.newton.systems.two_level.over_ranks.preconditioner import PreconditionerOverRanks
from fcsim.solvers.newton.systems.two_level.over_ranks.system import TwoLevelOverRanks
from fcsim.solvers.newton.systems.two_level.settling import SettlesJoints


@dataclass(frozen=True, eq=False)
class KeptPreconditioner(Kept):
    """What serves the next W of the same contacts."""

    preconditioner: PreconditionerOverRanks


class SystemOverRanks(SettlesJoints[TwoLevelOverRanks]):
    """Solves (A W + B) dr = rhs of a distributed W; where GMRES does not, all ranks go on with all of W, as one process would."""

    def __init__(self, operator: Delassus, whole: Callable[[Delassus], NewtonSystem], kept: KeptPreconditioner | None = None) -> None:
        """whole: what makes the system of all of W."""
        W = operator.W
        assert isinstance(W, DistributedDelassus)
        self.operator, self._W, self._make_whole = operator, W, whole
        earlier = None if kept is None else kept.preconditioner
        self._two_level = None if W.bodies is None else TwoLevelOverRanks(W, W.bodies, earlier)
        self._whole: NewtonSystem | None = None
        self.needed, self.foreseen = 0.0, False  # as in `NewtonSpace`; 0: not known

    def left(self, identity: IntArray) -> KeptPreconditioner | None:
        """What serves the next W of these contacts, None where there is nothing."""
        left = None if self._two_level is None else self._two_level.left
        return None if left is None else KeptPreconditioner(identity, left)

    def shifted(self, shift: FloatArray) -> NewtonSystem:
        return self._of_all().shifted(shift)

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        found = None if self._two_level is None else self._two_level.solve(A, B, rhs, self.needed, self.foreseen)
        if found is not None:
            return found
        whole = self._of_all()
        if isinstance(whole, CondensedSystem):
            whole.needed, whole.foreseen = self.needed, self.foreseen
        return whole.solve(A, B, rhs)

    def _of_all(self) -> NewtonSystem:
        if self._whole is None:
            self._whole = self._make_whole(Delassus(self._W.whole, self.operator.dimension))
        return self._whole
