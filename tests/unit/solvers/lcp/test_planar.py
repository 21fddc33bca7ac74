"""The 2D methods on statics, random, hyperstatic and unsymmetric problems; the one-contact kernel against all states enumerated."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose

from fcsim.errors import InputError
from fcsim.problem import LocalProblem
from fcsim.solvers import Result, Status, solve
from fcsim.solvers.lcp._planar_kernels import planar
from fcsim.solvers.lcp.coulomb_lcp import coulomb_lcp
from fcsim.solvers.lcp.lcp import lemke

METHODS = ["2D-NSGS", "2D-CPG", "2D-LEMKE", "2D-ENUM"]


def random_problem(seed: int, nc: int = 12, mu: float = 0.5, sparse: bool = False) -> LocalProblem:
    rng = np.random.default_rng(seed)
    H = rng.standard_normal((2 * nc + 5, 2 * nc)) / np.sqrt(2 * nc)
    q = rng.standard_normal((nc, 2))
    q[:, 0] -= 0.5
    W = H.T @ H + 0.1 * np.eye(2 * nc)
    return LocalProblem(sp.bsr_array(W, blocksize=(2, 2)) if sparse else W, q.ravel(), rng.uniform(0.1, mu, nc), dimension=2)


def hyperstatic(seed: int) -> LocalProblem:
    """A rigid body on six points of a plane: rank 3 of 12."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1, 1, 6)
    H = np.zeros((3, 12))
    H[0, 1::2], H[1, 0::2], H[2, 0::2], H[2, 1::2] = 1, 1, x, 0.3
    f = np.array([0.1, -2.0, 0.2])
    return LocalProblem(H.T @ H, H.T @ f, np.full(6, 0.4), dimension=2)


def violation(p: LocalProblem, r: np.ndarray) -> float:
    """The largest violation of Coulomb's law, in its case-by-case words."""
    u = p.W @ r + p.q
    r_N, r_T, u_N, u_T = r[0::2], r[1::2], u[0::2], u[1::2]
    power = np.abs(r_T * u_T + p.mu * r_N * np.abs(u_T))  # sliding: r_T = -mu r_N sign(u_T)
    return float(np.max([-r_N, -u_N, np.abs(r_N * u_N), np.abs(r_T) - p.mu * r_N, power], initial=0))


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize(
    ("q", "mu", "r", "u"),
    [
        ((1.0, 0.4), 0.5, (0, 0), (1, 0.4)),  # takes off
        ((-1.0, 0.2), 0.5, (2, -0.4), (0, 0)),  # sticks
        ((-1.0, 0.9), 0.5, (2, -1), (0, 0.4)),  # slides to +
        ((-1.0, -0.9), 0.5, (2, 1), (0, -0.4)),  # slides to -
        ((-1.0, 0.9), 0.0, (2, 0), (0, 0.9)),  # without friction
    ],
)
def test_one_block(name: str, q: tuple[float, float], mu: float, r: tuple[float, float], u: tuple[float, float]) -> None:
    """W = diag(1/2, 1/2): a mass of 2, pushed by q."""
    result = solve(LocalProblem(0.5 * np.eye(2), np.array(q), np.array([mu]), dimension=2), name, tol=1e-12)
    assert result.solved
    assert_allclose(result.r, r, atol=1e-12)
    assert_allclose(result.u, u, atol=1e-12)


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", METHODS)
def test_random_problems(name: str, seed: int, sparse: bool) -> None:
    p = random_problem(seed, sparse=sparse)
    result, newton = solve(p, name, tol=1e-11), solve(p, "NSN-AC", tol=1e-11)
    assert result.solved
    assert violation(p, result.r) < 1e-9
    assert_allclose(result.r, newton.r, atol=1e-8)
    warm = solve(p, name, 1.001 * newton.r, tol=1e-11)
    assert warm.solved and violation(p, warm.r) < 1e-9


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", METHODS)
def test_hyperstatic_problems(name: str, seed: int) -> None:
    p = hyperstatic(seed)
    result = solve(p, name, tol=1e-9)
    assert result.solved == (result.error <= 1e-9)
    if name != "2D-CPG":
        assert result.solved
    if result.solved:
        assert violation(p, result.r) < 1e-7


@pytest.mark.parametrize("name", METHODS)
def test_slightly_unsymmetric_problem(name: str) -> None:
    p = random_problem(7)
    W = p.W + 0.005 * np.random.default_rng(0).standard_normal(p.W.shape)
    p = LocalProblem(W, p.q, p.mu, dimension=2)
    result = solve(p, name, tol=1e-9)
    assert result.solved and violation(p, result.r) < 1e-7


@pytest.mark.parametrize("name", METHODS)
def test_bad_units_do_not_matter(name: str) -> None:
    p = random_problem(8)
    small = LocalProblem(1e-9 * p.W, 1e-3 * p.q, p.mu, dimension=2)
    result, expected = solve(small, name, tol=1e-6 if name in ("2D-NSGS", "2D-CPG") else 1e-3), solve(p, "NSN-AC", tol=1e-12)
    # error = ||...|| / ||q|| mixes units; u does not
    assert_allclose(1e3 * (small.W @ result.r + small.q), p.W @ expected.r + p.q, atol=1e-3)


def test_kernel_against_the_enumerated_states() -> None:
    """Of the four states of one contact, tried one after the other on linear systems, at least one holds, and the kernel finds it."""
    rng = np.random.default_rng(1)
    W3 = np.zeros((3, 3))
    for _ in range(2000):
        X = rng.standard_normal((2, 2))
        W, q, mu = X @ X.T + 0.01 * np.eye(2), rng.standard_normal(2), rng.uniform(0, 2)
        answers = [np.zeros(2)] if q[0] >= 0 else []
        stick = np.linalg.solve(W, -q)
        if abs(stick[1]) <= mu * stick[0]:
            answers.append(stick)
        for s in (1, -1):
            edge = np.array([1.0, -s * mu])
            n = -q[0] / (W[0] @ edge)
            if n >= 0 and s * (W[1] @ edge * n + q[1]) >= 0:
                answers.append(n * edge)
        W3[:2, :2] = W
        r_N, r_T, rest, solved = planar(W3, q[0], q[1], 0.0, mu, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1)
        assert solved == bool(answers)
        if solved:
            assert rest == 0
            assert min(np.abs(np.array([r_N, r_T]) - answer).max() for answer in answers) < 1e-9 * (1 + abs(r_N))
    assert planar(np.zeros((3, 3)), -1.0, 0.0, 0.0, 0.5, 1.0, 1.0, 7.0, 1.0, 0.0, 0.0, 1) == (7.0, 1.0, 0.0, False)


def test_enumeration_from_the_worst_guess() -> None:
    """Without Gauss-Seidel's guess all states of few contacts are visited in the end, whatever the start."""
    for seed in range(6):
        p = random_problem(seed, nc=4)
        for start in (None, np.tile([1.0, 0.0], 4), -np.ones(8)):
            result = solve(p, "2D-ENUM", start, guess_sweeps=0, tol=1e-12)
            assert result.solved and result.iterations <= 5**4
            assert violation(p, result.r) < 1e-9


def test_enumeration_says_when_it_gives_up() -> None:
    p = random_problem(3, nc=20)
    few = solve(p, "2D-ENUM", guess_sweeps=0, max_iterations=50)
    assert few.status is Status.MAX_ITERATIONS and few.iterations == 50
    # u_N = -r_N - 1 has no r_N >= 0: none of the five bases answers
    nothing = solve(LocalProblem(-np.eye(2), np.array([-1.0, 0]), np.array([0.3]), dimension=2), "2D-ENUM")
    assert nothing.status is Status.STAGNATED and nothing.iterations == 5


def test_lemke_says_when_there_is_no_solution() -> None:
    """A contact between bodies that do not move cannot be pushed apart: W = 0, q_N < 0."""
    result = solve(LocalProblem(np.zeros((2, 2)), np.array([-1.0, 0]), np.array([0.3]), dimension=2), "2D-LEMKE")
    assert result.status is Status.STAGNATED and not result.solved


@pytest.mark.parametrize("name", ["2D-LEMKE", "2D-CPG", "2D-NSGS"])
def test_iterations_and_time_are_limited(name: str) -> None:
    p = random_problem(5, nc=30)
    result = solve(p, name, max_iterations=2, tol=1e-12)
    assert result.status is Status.MAX_ITERATIONS and result.iterations == 2
    assert solve(p, name, time_limit=0.0, tol=1e-12).status is Status.TIME_LIMIT


def test_lemke_from_the_states_of_the_answer() -> None:
    """A warm start whose states are right takes no pivot, though its numbers are wrong."""
    p = random_problem(6, nc=30)
    expected = solve(p, "NSN-AC", tol=1e-12)
    W_D = p.W + 0.001 * np.diag(np.diag(p.W))
    nearby = LocalProblem(W_D, p.q, p.mu, dimension=2)
    cold, warm = (solve(nearby, "2D-LEMKE", start, tol=1e-11) for start in (None, expected.r))
    assert cold.solved and warm.solved
    assert warm.iterations < 0.2 * cold.iterations
    assert_allclose(warm.r, cold.r, atol=1e-9)


def test_lcp_of_the_plane_holds_the_law() -> None:
    """Each of its blocks on a given (r_N, beta, lambda): u, the slack of the sliding velocity and of the cone."""
    p = random_problem(9, nc=3)
    D = np.broadcast_to(np.array([[1.0], [-1.0]]), (3, 2, 1))
    lcp = coulomb_lcp(p, D)
    z = np.random.default_rng(2).uniform(0, 1, 12)
    r_N, beta, slack = z[:3], z[3:9].reshape(3, 2), z[9:]
    r = np.column_stack([r_N, beta[:, 0] - beta[:, 1]]).ravel()
    assert_allclose(lcp.reaction(z), lcp.impulse * r)
    u = ((p.W @ lcp.reaction(z) + p.q) / lcp.velocity).reshape(3, 2)
    w = lcp.M @ z + lcp.q
    assert_allclose(w[:3], u[:, 0])
    assert_allclose(w[3:9].reshape(3, 2), np.column_stack([u[:, 1] + slack, -u[:, 1] + slack]))
    assert_allclose(w[9:], p.mu * r_N - beta.sum(axis=1))


def test_support_of_every_state() -> None:
    """The bases that suit solved problems are theirs: from them no pivot is needed."""
    for seed, mu in itertools.product(range(5), (0.3, 1.0)):
        p = random_problem(seed, mu=mu)
        answer = solve(p, "NSN-AC", tol=1e-13)
        lcp = coulomb_lcp(p, np.broadcast_to(np.array([[1.0], [-1.0]]), (12, 2, 1)))
        found = lemke(lcp.M, lcp.q, start=lcp.support(answer.r, answer.u))
        assert found.pivots == 0
        assert_allclose(lcp.reaction(found.z), answer.r, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("2D-CPG", {"preconditioner": "ilu"}, "preconditioner: expected one of 'none', 'diagonal'"),
        ("2D-CPG", {"stagnation_iterations": 0}, "stagnation_iterations: expected an integer >= 1"),
        ("2D-ENUM", {"guess_sweeps": -1}, "guess_sweeps: expected an integer >= 0"),
        ("2D-LEMKE", {"max_iterations": -1}, "max_iterations"),
        ("2D-NSGS", {"relaxation": 3.0}, "relaxation"),
    ],
)
def test_bad_options_are_refused(name: str, options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        solve(random_problem(0), name, **options)


@pytest.mark.parametrize("name", METHODS)
def test_three_dimensions_are_refused(name: str) -> None:
    with pytest.raises(InputError, match="works in 2D, the problem has 3D"):
        solve(LocalProblem(np.eye(3), np.ones(3), np.ones(1)), name)


@pytest.mark.parametrize("options", [{"preconditioner": "diagonal"}, {"one_contact": "AC"}, {"warm_start": False}])
def test_options_lead_to_the_same_answer(options: dict[str, Any]) -> None:
    name = {"preconditioner": "2D-CPG", "one_contact": "2D-NSGS", "warm_start": "2D-LEMKE"}[next(iter(options))]
    p = random_problem(10)
    result: Result = solve(p, name, np.ones(24), tol=1e-11, **options)
    assert result.solved
    assert_allclose(result.r, solve(p, "NSN-AC", tol=1e-12).r, atol=1e-8)
