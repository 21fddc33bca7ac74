"""What is kept from problem to problem: matched by the contacts' identity, new values for changes, nothing where none is asked for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.problem import LocalProblem
from fcsim.solvers import Memory, solve
from fcsim.solvers.memory import Kept


@dataclass(frozen=True, eq=False)
class _Number(Kept):
    value: FloatArray


def _problem(nc: int = 4) -> LocalProblem:
    return LocalProblem(np.eye(3 * nc), np.tile([-1.0, 0.1, 0.0], nc), np.full(nc, 0.5))


def test_contacts_are_found_by_their_numbers() -> None:
    kept = _Number(np.array([7, 3, 9]), np.array([1.0, 2.0, 3.0]))
    assert_array_equal(kept.places(np.array([9, 4, 7, 3, 100])), [2, -1, 0, 1, -1])
    assert_array_equal(_Number(np.empty(0, dtype=int), np.empty(0)).places(np.array([5])), [-1])


def test_changes_make_new_values() -> None:
    first = Memory.of(np.arange(3))
    kept = _Number(first.identity, np.zeros(3))
    second = first.having(kept)
    assert first.earlier(_Number) is None
    assert second.earlier(_Number) is kept
    assert second.of_same_contacts(_Number) is kept
    assert second.having(_Number(first.identity, np.ones(3))).values != second.values
    assert len(second.having(_Number(first.identity, np.ones(3))).values) == 1
    assert second.without(_Number).values == ()


def test_other_contacts_of_the_same_number_do_not_count_as_the_same() -> None:
    memory = Memory.of(np.arange(3)).having(_Number(np.arange(3), np.zeros(3)))
    moved = memory.follow(np.array([1, 2, 3]))
    assert moved.of_same_contacts(_Number) is None
    assert moved.earlier(_Number) is not None


def test_solve_keeps_nothing_unasked() -> None:
    assert solve(_problem(), "NSN-AC").memory is None


@pytest.mark.parametrize("name", ["NSN-AC", "ADMM", "auto", "NSN-AC-HYBRID", "NSGS-AC"])
def test_the_answer_does_not_depend_on_the_memory(name: str) -> None:
    p, memory = _problem(), Memory.of(np.arange(4))
    for _ in range(3):
        result = solve(p, name, memory=memory, tol=1e-10)
        assert result.solved
        assert result.memory is not None
        assert np.abs(result.u - (p.W @ result.r + p.q)).max() < 1e-12
        memory = result.memory


def test_of_another_size_is_refused() -> None:
    with pytest.raises(InputError, match=r"memory: expected one of the problem's 4 contacts, got one of 3"):
        solve(_problem(), "NSN-AC", memory=Memory.of(np.arange(3)))
    with pytest.raises(InputError, match="identity: expected whole numbers"):
        Memory.of(np.zeros((2, 2)))
