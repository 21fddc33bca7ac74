"""Lemke's and the enumerative method on problems whose answer is known: published ones, degenerate ones, ones without a solution."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.optimize
from numpy.testing import assert_allclose

from fcsim.linear.factors import SingularMatrix
from fcsim.solvers.lcp.lcp import LCPSolution, LCPStatus, all_supports, complementary_solutions, lemke


def enumerate_lcp(M: np.ndarray, q: np.ndarray) -> LCPSolution | None:
    """The first solution over all 2^n complementary bases, None where there is none."""
    return next(complementary_solutions(M, q), None)


def assert_solves(M: np.ndarray, q: np.ndarray, z: np.ndarray, tol: float = 1e-9) -> None:
    w = M @ z + q
    scale = 1 + np.abs(q).max(initial=0) + np.abs(z).max(initial=0)
    assert z.min(initial=0) >= 0 and w.min(initial=0) >= -tol * scale
    assert np.abs(z * w).max(initial=0) <= tol * scale**2


def feasible(rng: np.random.Generator, M: np.ndarray) -> np.ndarray:
    """q = w - M z for some z, w >= 0: for M positive semidefinite a solution then exists (Cottle, Pang, Stone 1992, theorem 3.1.2)."""
    n = len(M)
    return np.maximum(rng.standard_normal(n), 0) - M @ np.maximum(rng.standard_normal(n), 0)


@pytest.mark.parametrize("seed", range(40))
def test_positive_semidefinite_problems(seed: int) -> None:
    """Of any rank, with a skew part or not."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 40))
    X, S = rng.standard_normal((n, int(rng.integers(1, n + 1)))), rng.standard_normal((n, n))
    M = X @ X.T + (seed % 2) * (S - S.T)
    q = feasible(rng, M)
    answer = lemke(M, q)
    assert answer.status is LCPStatus.SOLVED
    assert_solves(M, q, answer.z)
    assert_allclose(answer.w, M @ answer.z + q, atol=1e-12)
    assert not answer.z[~answer.support].any()


@pytest.mark.parametrize("seed", range(6))
def test_nonnegative_least_squares(seed: int) -> None:
    """min ||A x - b|| over x >= 0 is the LCP of A^T A and -A^T b: unique for A of full rank."""
    rng = np.random.default_rng(seed)
    A, b = rng.standard_normal((14, 9)), rng.standard_normal(14)
    expected = scipy.optimize.nnls(A, b)[0]
    answer, enumerated = lemke(A.T @ A, -A.T @ b), enumerate_lcp(A.T @ A, -A.T @ b)
    assert enumerated is not None
    assert_allclose(answer.z, expected, atol=1e-10)
    assert_allclose(enumerated.z, expected, atol=1e-10)


def test_bimatrix_game() -> None:
    """Equilibria of the bimatrix game (A, B) are solutions of [[0, A], [B^T, 0]], q = -1 (Cottle, Pang, Stone 1992, section 1.2).

    Matching pennies with costs 1 and 2: both players mix half and half at the cost 1.5, so z = (1/2, 1/2) / 1.5 each. This M is not of a
    class for which Lemke's method must succeed, and with this covering vector it meets a ray.
    """
    A = np.array([[1.0, 2], [2, 1]])
    B = 3 - A
    M = np.block([[np.zeros((2, 2)), A], [B.T, np.zeros((2, 2))]])
    answer = enumerate_lcp(M, -np.ones(4))
    assert answer is not None
    assert_allclose(answer.z, np.full(4, 1 / 3))
    assert lemke(M, -np.ones(4), covering=np.array([1.0, 2, 3, 4])).status is LCPStatus.RAY


def test_linear_programme() -> None:
    """min c.x, A x >= b, x >= 0 by its optimality conditions [[0, -A^T], [A, 0]], (c, -b), against SciPy's HiGHS."""
    rng = np.random.default_rng(3)
    A, x0, y0 = rng.standard_normal((8, 5)), np.maximum(rng.standard_normal(5), 0), np.maximum(rng.standard_normal(8), 0)
    b, c = A @ x0 - np.maximum(rng.standard_normal(8), 0), A.T @ y0 + np.maximum(rng.standard_normal(5), 0)
    M, q = np.block([[np.zeros((5, 5)), -A.T], [A, np.zeros((8, 8))]]), np.r_[c, -b]
    answer = lemke(M, q)
    assert answer.status is LCPStatus.SOLVED
    assert_allclose(c @ answer.z[:5], scipy.optimize.linprog(c, -A, -b).fun, atol=1e-9)


def test_murtys_exponential_problem() -> None:
    """M lower triangular, 1 on and 2 below the diagonal, q = -1: z = e_1; Murty (Lecture Notes in Economics 186, 1978) takes 2^n - 1
    pivots with this covering vector.
    """
    pivots = []
    for n in (3, 4, 5, 6, 7, 8):
        M = np.tril(2 * np.ones((n, n)), -1) + np.eye(n)
        answer = lemke(M, -np.ones(n), covering=np.power(2.0, np.arange(n, 0, -1)), max_pivots=1000)
        assert_allclose(answer.z, np.eye(n)[0])
        pivots.append(answer.pivots)
        enumerated = enumerate_lcp(M, -np.ones(n))
        assert enumerated is not None
        assert_allclose(enumerated.z, np.eye(n)[0])
    assert pivots == [2**n - 1 for n in (3, 4, 5, 6, 7, 8)]


@pytest.mark.parametrize("n", [4, 10, 40])
def test_degenerate_problems_do_not_cycle(n: int) -> None:
    """Ties everywhere: q of equal entries, integer M, repeated rows and columns."""
    rng = np.random.default_rng(n)
    for _ in range(20):
        X = rng.integers(-1, 2, (n // 2, 2)).astype(float)
        X = np.repeat(X, 2, axis=0)
        M = X @ X.T
        q = -M @ np.ones(n)  # z = 1 solves with w = 0
        answer = lemke(M, q, covering=np.ones(n))
        assert answer.status is LCPStatus.SOLVED
        assert_solves(M, q, answer.z)


def test_ties_of_a_cyclic_matrix() -> None:
    """Every ratio of the first pivots is tied; by symmetry z = (1, 1, 1) / 3."""
    M = np.array([[1.0, 2, 0], [0, 1, 2], [2, 0, 1]])
    answer = lemke(M, -np.ones(3), covering=np.ones(3))
    assert answer.status is LCPStatus.SOLVED and answer.pivots <= 8
    assert_allclose(answer.z, np.full(3, 1 / 3))


def test_trivial_problems() -> None:
    M = np.array([[2.0, 1], [1, 2]])
    for q in (np.zeros(2), np.array([1.0, 0])):
        answer = lemke(M, q)
        assert answer.status is LCPStatus.SOLVED and answer.pivots == 0 and not answer.z.any()
    nothing = lemke(np.zeros((0, 0)), np.zeros(0))
    assert nothing.status is LCPStatus.SOLVED and nothing.z.shape == (0,)


def test_no_solution() -> None:
    """w_1 = -z_2 - 1 < 0 for every z >= 0: a ray for Lemke, nothing for the enumeration; for M copositive-plus a ray is a proof."""
    M, q = np.array([[0.0, -1], [1, 0]]), np.array([-1.0, 1])
    assert lemke(M, q).status is LCPStatus.RAY
    assert enumerate_lcp(M, q) is None


def test_all_solutions_are_enumerated() -> None:
    """M = [[0, 1], [1, 0]], q = (-1, -1): z = (1, 1) only; M = -I, q = (1, 1): the four z in {0, 1}^2."""
    for M, q, expected in (
        (np.array([[0.0, 1], [1, 0]]), -np.ones(2), {(1.0, 1.0)}),
        (-np.eye(2), np.ones(2), {(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)}),
    ):
        found = list(complementary_solutions(M, q))
        assert {tuple(answer.z) for answer in found} == expected
        for answer in found:
            assert_solves(M, q, answer.z)
        assert [answer.pivots for answer in found] == sorted(answer.pivots for answer in found)


def test_singular_bases_are_not_overlooked() -> None:
    """M = 1 1^T, q = -1: every z >= 0 of sum 1 solves; of the bases with both positive, the block is singular."""
    M, q = np.ones((2, 2)), -np.ones(2)
    only_both = [np.array([[True, True]])]
    for supports in (only_both, [np.array([[True, True], [True, True]])]):
        answer = next(complementary_solutions(M, q, supports))
        assert_allclose(answer.z.sum(), 1)
        assert_solves(M, q, answer.z)


def test_supports() -> None:
    everything = np.concatenate(list(all_supports(13)))
    assert everything.shape == (8192, 13) and len(np.unique(everything, axis=0)) == 8192
    assert not everything[0].any() and everything[-1].all()


def test_start_from_a_basis() -> None:
    """From its own basis a problem takes no pivot, from a nearby one a few, from a singular one it is an error."""
    rng = np.random.default_rng(8)
    X = rng.standard_normal((30, 30))
    M, q = X @ X.T + np.eye(30), rng.standard_normal(30)
    cold = lemke(M, q)
    assert cold.pivots > 5
    warm = lemke(M, q, start=cold.support)
    assert warm.pivots == 0
    assert_allclose(warm.z, cold.z, atol=1e-12)
    nearby = cold.support.copy()
    nearby[[0, 7]] ^= True
    again = lemke(M, q, start=nearby)
    assert again.status is LCPStatus.SOLVED
    assert_allclose(again.z, cold.z, atol=1e-10)
    assert_allclose(again.support, cold.support)
    with pytest.raises(SingularMatrix):
        lemke(np.ones((3, 3)), -np.ones(3), start=np.ones(3, dtype=bool))


def test_stop_and_limit() -> None:
    rng = np.random.default_rng(9)
    X = rng.standard_normal((60, 60))
    M, q = X @ X.T, -np.abs(rng.standard_normal(60))
    assert lemke(M, q, stop=lambda: True).status is LCPStatus.STOPPED
    limited = lemke(M, q, max_pivots=3)
    assert limited.status is LCPStatus.MAX_PIVOTS and limited.pivots == 3
