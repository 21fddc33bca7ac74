"""Where a step's first system is linearised: velocities and statuses after solutions that are written down."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.problem import LocalProblem
from fcsim.solvers import Memory, solve
from fcsim.solvers.newton.expected import LastVelocities, statuses, with_velocities
from fcsim.solvers.newton.formulations import alart_curnier
from fcsim.solvers.newton.statuses import OPEN, SLIDING, STICKING, made_to_slide

MU = np.full(3, 0.5)
OPENED = ([0.3, 0.1, 0.0], [0.0, 0.0, 0.0])
SLID = ([0.0, -0.4, 0.3], [2.0, 0.8, -0.6])
STUCK = ([0.0, 0.0, 0.0], [2.0, 0.5, 0.1])


def _after(memory: Memory, *contacts: tuple[list[float], list[float]]) -> Memory:
    u, r = (np.array(values) for values in zip(*contacts, strict=True))
    return with_velocities(memory, u, r, MU[: len(u)], np.full(len(u), 0.7))


def _kept(memory: Memory) -> LastVelocities:
    kept = memory.earlier(LastVelocities)
    assert kept is not None
    return kept


def test_statuses_of_solutions() -> None:
    u, r = (np.array(values) for values in zip(OPENED, SLID, STUCK, strict=True))
    for compliance in (1e-3, 1.0, 1e3):
        assert_array_equal(statuses(u, r, MU, np.full(3, compliance)), [OPEN, SLIDING, STICKING])


def test_what_slid_in_one_of_two_solutions_is_expected_to_slide() -> None:
    """With the velocity that it slid with; opened ones stay open, and a third solution forgets the first."""
    memory = _after(Memory.of(np.arange(3)), SLID, STUCK, SLID)
    assert_array_equal(_kept(memory).slides, [True, False, True])
    memory = _after(memory, STUCK, STUCK, OPENED)
    kept = _kept(memory)
    assert_array_equal(kept.slides, [True, False, False])
    assert_allclose(kept.expected, [SLID[0], STUCK[0], OPENED[0]], atol=0)
    assert_allclose(kept.u, [STUCK[0], STUCK[0], OPENED[0]], atol=0)
    memory = _after(memory, STUCK, SLID, OPENED)
    assert_array_equal(_kept(memory).slides, [False, True, False])


def test_contacts_that_come_and_go() -> None:
    """Known by their numbers: new ones have the start's velocities and are not made to slide."""
    memory = _after(Memory.of(np.array([5, 7, 9])), SLID, STUCK, STUCK)
    memory = _after(memory.follow(np.array([4, 5, 9])), STUCK, STUCK, STUCK)
    assert_array_equal(_kept(memory).slides, [False, True, False])
    u, slides = _kept(memory).at(np.full((2, 3), 8.0), np.array([5, 6]))
    assert_array_equal(slides, [True, False])
    assert_allclose(u, [SLID[0], [8.0, 8.0, 8.0]], atol=0)
    assert len(_kept(_after(memory.follow(np.array([1])), SLID)).u) == 1


def test_made_to_slide() -> None:
    """A contact inside its disk takes on the equation of the disk's edge along y_T; others keep theirs."""
    u, r = (np.array(values) for values in zip(STUCK, STUCK, SLID, strict=True))
    rho = np.ones((3, 3))
    before, after = (alart_curnier(u, r, MU, rho) for _ in range(2))
    after = made_to_slide(after, np.array([True, False, True]), u, r, MU, rho)
    for old, new in zip(before, after, strict=True):
        assert_allclose(new[1:], old[1:], atol=0)
    n = r[0, 1:] / np.linalg.norm(r[0, 1:])
    assert_allclose(after[0][0], [0.0, *(r[0, 1:] - MU[0] * r[0, 0] * n)], atol=1e-15)
    assert_allclose(after[2][0, 1:, 0], -MU[0] * n, atol=1e-15)  # dF_T / dr_N


def test_an_answer_does_not_depend_on_what_is_expected() -> None:
    """A memory in which every contact is said to slide changes the way to an answer, not the answer."""
    rng = np.random.default_rng(3)
    H, q = rng.standard_normal((95, 90)) / np.sqrt(90), rng.standard_normal((30, 3))
    q[:, 0] -= 0.5
    p = LocalProblem(H.T @ H + 0.1 * np.eye(90), q.ravel(), np.full(30, 0.3))
    first = solve(p, "NSN-AC", tol=1e-10, memory=Memory.of(np.arange(30)))
    assert first.memory is not None
    kept = _kept(first.memory)
    misled = first.memory.having(LastVelocities(kept.identity, kept.u, kept.status, kept.expected, np.ones(30, dtype=bool)))
    again = solve(p, "NSN-AC", first.r, tol=1e-12, memory=misled)
    assert again.solved
    assert_allclose(again.u, first.u, rtol=0, atol=1e-7 * np.abs(first.u).max())
