"""Newton's pauses in the race of `auto`, in steps whose contacts hold more than their bodies' velocities."""

from __future__ import annotations

import numpy as np
import pytest

from fcsim.problem import LocalProblem
from fcsim.solvers import Memory, solve
from fcsim.solvers.automatic.pause import PauseInRace

Q, MU = np.array([-1.0, 0.0, 0.0, -1.0, 0.0, 0.0]), np.full(2, 0.5)
SHARED = LocalProblem(np.kron(np.ones((2, 2)), np.eye(3)), Q, MU)  # two points share a load in any way: r_1 + r_2 = 1
UNIQUE = LocalProblem(np.eye(6), Q, MU)


def pause(memory: Memory | None) -> tuple[int, int] | None:
    """Its length, and what is left of it."""
    assert memory is not None
    found = memory.earlier(PauseInRace)
    return None if found is None else (found.length, found.left)


def test_newton_pauses_where_it_has_failed_twice_in_a_row() -> None:
    memory: Memory | None = Memory.of(np.arange(2))
    start, seen = 0.4 * np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0]), []
    for _ in range(7):
        result = solve(SHARED, "auto", start, memory=memory)
        memory = result.memory
        assert result.status.solved and result.r[[0, 3]].sum() == pytest.approx(1.0, abs=1e-7)
        seen.append(pause(memory))
    assert seen == [(0, 0), (1, 1), (1, 0), (2, 2), (2, 1), (2, 0), (4, 4)]

    again = solve(SHARED, "auto", memory=memory)  # from zero nothing is left out, and nothing counts
    assert again.status.solved and pause(again.memory) == (4, 4)

    for left in (3, 2, 1, 0):
        memory = solve(UNIQUE, "auto", start, memory=memory).memory
        assert pause(memory) == (4, left)
    assert pause(solve(UNIQUE, "auto", start, memory=memory).memory) is None
