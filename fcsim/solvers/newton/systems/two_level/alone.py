"""The two-level system where it is asked for by name, whatever the size of W; what goes on where it does not get there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from fcsim.arrays import FloatArray, IntArray
from fcsim.errors import InputError
from fcsim.linear.joints import BlockRows
from fcsim.problem import Delassus
from fcsim.solvers.memory import Kept
from fcsim.solvers.newton.systems.interface import NewtonSystem
from fcsim.solvers.newton.systems.two_level.settling import SettlesJoints
from fcsim.solvers.newton.systems.two_level.system import Preconditioner, TwoLevelSystem


@dataclass(frozen=True, eq=False)
class KeptTwoLevel(Kept):
    """What serves the next W of the same contacts."""

    preconditioner: Preconditioner


class SystemByBodies(SettlesJoints[TwoLevelSystem]):
    """Solves (A W + B) dr = rhs by GMRES with the joints' own blocks and the coarse space of the bodies' motions (`system`).

    InputError where W is shifted or its bodies are not known. Where joints have too many contacts or GMRES does not get there, as of rigid
    bodies with more contacts than they need, `whole` goes on, from then on.
    """

    def __init__(self, operator: Delassus, whole: Callable[[Delassus], NewtonSystem], kept: KeptTwoLevel | None = None) -> None:
        """whole: what makes the system that goes on."""
        if operator.shift is not None or operator.shares is None:
            got = "a regularised W" if operator.shift is not None else "a W whose bodies are not known"
            expected = "expected a global problem without equality constraints, or a step's with no compliance or link at its contacts"
            raise InputError(f"option linear: {expected}, for 'two-level', got {got}")
        self.operator, self._make_whole = operator, whole
        rows = BlockRows(operator.W, operator.dimension)
        self._two_level = TwoLevelSystem(rows, operator.shares, None if kept is None else kept.preconditioner)
        self._whole: NewtonSystem | None = None
        self._solves = self._of_whole = 0
        self.needed, self.foreseen = 0.0, False  # as in `NewtonSpace`; 0: not known

    def left(self, identity: IntArray) -> KeptTwoLevel | None:
        """What serves the next W of these contacts, None where there is nothing."""
        left = None if self._two_level is None else self._two_level.left
        return None if left is None else KeptTwoLevel(identity, left)

    @property
    def said(self) -> str:
        """How much of what was asked for by this name another system has solved; "" where nothing."""
        if not self._of_whole:
            return ""
        return (
            f"linear='two-level' did not get there in {self._of_whole} of {self._solves} iterations, whose systems another one has solved"
        )

    def shifted(self, shift: FloatArray) -> NewtonSystem:
        return self._make_whole(self.operator).shifted(shift)

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        self._solves += 1
        found = None if self._two_level is None else self._two_level.solve(A, B, rhs, self.needed, self.foreseen)
        if found is not None:
            return found
        self._of_whole += 1
        if self._whole is None:
            self._whole = self._make_whole(self.operator)
        return self._whole.solve(A, B, rhs)
