"""Newton's pauses in the race of `auto`, in steps whose contacts hold more than their bodies' velocities."""

from __future__ import annotations

import numpy as np
import pytest

from fcsim.problem import LocalProblem
from fcsim.solvers import Memory, solve
from fcsim.solvers.automatic.pause import Pause, PauseInRace, passed_over

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
    for _ in range(8):
        result = solve(SHARED, "auto", start, memory=memory)
        memory = result.memory
        assert result.status.solved and result.r[[0, 3]].sum() == pytest.approx(1.0, abs=1e-7)
        seen.append(pause(memory))
    assert seen == [(0, 0), (1, 1), (1, 0), (4, 4), (4, 3), (4, 2), (4, 1), (4, 0)]

    again = solve(SHARED, "auto", memory=memory)  # from zero nothing is left out, and nothing counts
    assert again.status.solved and pause(again.memory) == (4, 0)

    memory = solve(SHARED, "auto", start, memory=memory).memory
    assert pause(memory) == (16, 16)
    for left in range(15, -1, -1):
        memory = solve(UNIQUE, "auto", start, memory=memory).memory
        assert pause(memory) == (16, left)
    assert pause(solve(UNIQUE, "auto", start, memory=memory).memory) is None


def test_newton_is_passed_over_in_the_race_where_it_was_before() -> None:
    """Bodies that turn: where q follows Newton pauses by problems, and the race's own pause counts those on which it was tried there."""
    start, nobody = 0.4 * np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0]), np.empty(0, dtype=np.int64)
    memory: Memory | None = Memory.of(np.arange(2)).having(Pause(nobody, length=2, left=2)).having(PauseInRace(nobody, length=0, left=0))
    for _ in range(2):
        memory = passed_over(memory)
        memory = solve(SHARED, "auto", start, memory=memory).memory
        assert pause(memory) == (0, 0)  # or, tried, it would have failed
    assert passed_over(memory) is None
    assert memory is not None
    memory = memory.having(Pause(nobody, length=4, left=4))  # tried, and failed
    memory = solve(SHARED, "auto", start, memory=memory).memory
    assert pause(memory) == (1, 1)
    assert passed_over(None) is None
