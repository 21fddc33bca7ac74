"""How bodies are expected to move in a step, from the steps before: where the elastic term of turning bodies is first linearised.

Velocities at the ends of steps swing about the motion at theta = 1/2; displacements over steps do not. So the next one is taken on the
straight line through the last two, dx = 2 dx_1 - dx_2.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.solvers import Memory
from fcsim.solvers.memory import Kept
from fcsim.timestep.state import State

SAME_TIME = 1e-6
"""Of a step: times that differ by less are one."""


@dataclass(frozen=True, eq=False)
class KeptMotion(Kept):
    """moved (n_dofs,) [m] over the step of the length h [s] from t [s]; before (n_dofs,): over the one before it, None = not known."""

    t: float = field(kw_only=True)
    h: float = field(kw_only=True)
    moved: FloatArray = field(kw_only=True)
    before: FloatArray | None = field(kw_only=True)


def expected_motion(memory: Memory | None, state: State, h: float) -> FloatArray | None:
    """Displacements (n_dofs,) [m] expected over a step of the length h [s] from a state; None where no step like it came before."""
    kept = _fitting(memory, state.t - h, h)
    if kept is None:
        return None
    return kept.moved if kept.before is None else 2 * kept.moved - kept.before


def with_motion(memory: Memory, state: State, h: float, moved: FloatArray) -> Memory:
    """The memory that knows what moved (n_dofs,) [m] over the step from a state."""
    again, last = _fitting(memory, state.t, h), _fitting(memory, state.t - h, h)
    before = again.before if again is not None else None if last is None else last.moved
    return memory.having(KeptMotion(np.empty(0, dtype=np.int64), t=state.t, h=h, moved=moved, before=before))


def _fitting(memory: Memory | None, t: float, h: float) -> KeptMotion | None:
    """What is kept of a step of the length h from t."""
    kept = None if memory is None else memory.earlier(KeptMotion)
    return kept if kept is not None and kept.h == h and abs(kept.t - t) <= SAME_TIME * h else None
