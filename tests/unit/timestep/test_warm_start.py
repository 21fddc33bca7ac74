"""Where a step's solver begins, from what the last steps' reactions suggest."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.contact_detection import Contacts
from fcsim.problem import LocalProblem
from fcsim.timestep.reactions.reactions import Reactions
from fcsim.timestep.reactions.warm_start import nearest_start, warm_start

FRAME = np.tile(np.eye(3), (2, 1, 1))
CONTACTS = Contacts(
    np.zeros((2, 3)), FRAME, np.zeros(2), np.full(2, 0.5), np.zeros((2, 1), int), np.zeros((2, 1)), np.zeros((2, 2), int), np.array([4, 9])
)


def memory(*history: float) -> list[Reactions]:
    """Normal reactions of the last steps, newest first, the same at both contacts."""
    return [Reactions(CONTACTS.identity, FRAME, np.array([[r, 0, 0], [r, 0, 0]])) for r in history]


@pytest.mark.parametrize(
    ("history", "following"),
    [
        ((5.0, 5.0, 5.0), 5.0),
        ((4.0, 3.0, 2.0), 5.0),  # a ramp: 2 r1 - r2
        ((2.0, 5.0, 1.0), 6.0),  # a ramp with an alternating part: r1 + r2 - r3
        ((4.0, 3.0), 5.0),
        ((4.0,), 4.0),
    ],
)
def test_what_goes_on_is_met(history: tuple[float, ...], following: float) -> None:
    """The problem W = I, q = -r is solved by r alone."""
    r = np.array([following, 0, 0] * 2)
    assert_allclose(warm_start(LocalProblem(np.eye(6), -r, CONTACTS.mu), CONTACTS, memory(*history)), r)


def test_without_a_past_it_is_zero() -> None:
    assert_array_equal(warm_start(LocalProblem(np.eye(6), np.ones(6), CONTACTS.mu), CONTACTS, []), np.zeros(6))


def test_an_extrapolation_is_taken_only_where_it_is_better() -> None:
    """The load stopped growing."""
    r = np.array([4.0, 0, 0] * 2)
    assert_allclose(warm_start(LocalProblem(np.eye(6), -r, CONTACTS.mu), CONTACTS, memory(4.0, 3.0, 1.5)), r)


def test_among_answers_the_last_one_is_taken() -> None:
    """Two contacts carry 4 together, in any shares: what went from one to the other in the step before does not go on."""
    W = np.zeros((6, 6))
    W[np.ix_([0, 3], [0, 3])] = 1.0
    W += np.diag([0.0, 1, 1] * 2)
    q = np.array([-4.0, 0, 0] * 2)
    past = tuple(
        Reactions(CONTACTS.identity, CONTACTS.frame, np.array([[share, 0, 0], [4 - share, 0, 0]]) + slack)
        for share, slack in ((2.5, [1e-10, 0, 0]), (1.5, [2e-10, 0, 0]))
    )
    problem = LocalProblem(W, q, CONTACTS.mu)
    assert_allclose(warm_start(problem, CONTACTS, past, 1e-8), [2.5, 0, 0, 1.5, 0, 0], atol=1e-9)
    assert_allclose(warm_start(problem, CONTACTS, past[::-1], 1e-8), [1.5, 0, 0, 2.5, 0, 0], atol=1e-9)


@pytest.mark.parametrize(
    ("history", "following"),
    [
        ((4.0, 3.0, 2.0, 1.0), 5.0),  # a ramp
        ((3.0, 5.0, 2.0, 4.0), 6.0),  # a ramp with an alternating part
        ((4.0, 4.0, 4.0, 1.0), 4.0),
        ((4.0, 3.0, 2.0), 5.0),  # fewer than four: by the error
        ((4.0,), 4.0),
    ],
)
def test_the_rule_that_met_the_last_step_is_the_nearest(history: tuple[float, ...], following: float) -> None:
    r = np.array([following, 0, 0] * 2)
    assert_allclose(nearest_start(LocalProblem(np.eye(6), -r, CONTACTS.mu), CONTACTS, memory(*history)), r)


def test_small_errors_of_sticking_reactions_do_not_hide_what_is_near() -> None:
    """Two contacts stick, stiff against one another: W has the eigenvalue 1 for what they carry together, 1000 for what goes from one to
    the other. Extrapolations are 1e-2 off in the latter, r1 1 in the former: ten times the residual at a hundredth of the distance."""
    together, across = np.eye(6), np.zeros((6, 6))
    across[1, 1] = across[4, 4] = 1.0
    across[1, 4] = across[4, 1] = -1.0
    answer = np.array([[10.0, 3, 0], [10.0, 3, 0]])
    r1, off = answer - [0, 1, 0], np.array([[0, 0.01, 0], [0, -0.01, 0]])
    past = [Reactions(CONTACTS.identity, FRAME, r) for r in (r1, r1 - [0, 1, 0] - off, r1 - [0, 2, 0], r1 - [0, 3, 0])]
    W = together + 500 * across
    problem = LocalProblem(W, -W @ answer.ravel(), CONTACTS.mu)
    assert_allclose(warm_start(problem, CONTACTS, past).reshape(2, 3), r1)
    assert_allclose(nearest_start(problem, CONTACTS, past).reshape(2, 3), answer, atol=0.011)
