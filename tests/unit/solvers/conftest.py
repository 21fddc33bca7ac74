"""Problems for the tests of projection, splitting and optimisation methods, and the error written again in NumPy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import scipy.sparse as sp

from fcsim.problem import GlobalProblem, LocalProblem


def block(angle: float, mu: float, d: int, lift: float = 0.0) -> LocalProblem:
    """A mass of 2 kg on a slope, one step of 1 ms: u = r / 2 + q."""
    q = np.zeros(d)
    q[0], q[1] = 1e-3 * 9.81 * (lift - np.cos(angle)), 1e-3 * 9.81 * np.sin(angle)
    return LocalProblem(0.5 * np.eye(d), q, np.array([mu]), dimension=d)


def full_rank(d: int, seed: int = 3, nc: int = 10, mu: float = 0.6) -> LocalProblem:
    rng = np.random.default_rng(seed)
    H = rng.standard_normal((d * nc + 10, d * nc)) / np.sqrt(d * nc)
    q = rng.standard_normal((nc, d))
    q[:, 0] -= 0.5
    return LocalProblem(H.T @ H + 0.2 * np.eye(d * nc), q.ravel(), rng.uniform(0.1, mu, nc), dimension=d)


def frictionless() -> LocalProblem:
    p = full_rank(3)
    return LocalProblem(p.W, p.q, np.zeros(p.nc))


def unsymmetric() -> LocalProblem:
    p = full_rank(3, mu=0.3)
    return LocalProblem(p.W + 0.01 * np.random.default_rng(5).standard_normal(p.W.shape), p.q, p.mu)


def sparse() -> LocalProblem:
    """A chain: each contact touches the next two only."""
    p = full_rank(3, nc=12)
    a = np.arange(12)
    near = np.kron(np.abs(a[:, None] - a) <= 2, np.ones((3, 3)))
    return LocalProblem(sp.bsr_array(p.W * near + 0.5 * np.eye(36), blocksize=(3, 3)), p.q, p.mu)


def hyperstatic() -> LocalProblem:
    """A block at rest on four points of its base, pushed inside the friction cone: 12 unknowns, rank 6."""
    H = np.zeros((6, 12))
    for a in range(4):
        p = np.array([np.cos(a * np.pi / 2), np.sin(a * np.pi / 2), -0.5])
        for k, direction in enumerate(np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])):
            H[:, 3 * a + k] = np.r_[direction, np.cross(p, direction)]
    f = np.r_[0.2, -0.1, -3.0, np.zeros(3)]
    inverse = 1 / np.array([2.0, 2, 2, 0.8, 0.8, 0.9])
    return LocalProblem(H.T @ (inverse[:, None] * H), H.T @ (inverse * f), np.full(4, 0.6))


PROBLEMS: dict[str, Callable[[], LocalProblem]] = {
    "sliding block": lambda: block(np.pi / 6, 0.3, 3),
    "sticking block": lambda: block(np.pi / 18, 0.3, 3),
    "sliding block, 2D": lambda: block(np.pi / 6, 0.3, 2),
    "take-off": lambda: block(np.pi / 6, 0.3, 3, lift=2.0),
    "full rank": lambda: full_rank(3),
    "full rank, 2D": lambda: full_rank(2, seed=4),
    "frictionless": frictionless,
    "unsymmetric": unsymmetric,
    "sparse": sparse,
    "hyperstatic": hyperstatic,
}


@pytest.fixture
def natural_map_error() -> Callable[[LocalProblem, np.ndarray], float]:
    """||r - P_K(r - (u + g(u)))|| / ||q|| contact by contact, u = W r + q, written again."""

    def error(p: LocalProblem, r: np.ndarray) -> float:
        u = (p.W @ r + p.q).reshape(-1, p.dimension)
        total = 0.0
        for mu, u_a, r_a in zip(p.mu, u, r.reshape(-1, p.dimension), strict=True):
            z = r_a - u_a
            z[0] -= mu * np.linalg.norm(u_a[1:])
            length = np.linalg.norm(z[1:])
            if mu * length <= -z[0]:
                z = 0 * z
            elif length > mu * z[0]:
                s = (z[0] + mu * length) / (1 + mu * mu)
                z = np.r_[s, mu * s * z[1:] / length]
            total += np.sum((r_a - z) ** 2)
        return float(np.sqrt(total) / np.linalg.norm(p.q))

    return error


@pytest.fixture(params=PROBLEMS)
def coulomb_problem(request: pytest.FixtureRequest) -> LocalProblem:
    return PROBLEMS[request.param]()


@pytest.fixture
def coulomb_problems() -> dict[str, Callable[[], LocalProblem]]:
    return PROBLEMS


@pytest.fixture
def global_problem() -> GlobalProblem:
    """Four bodies of 9 dofs with contacts and two equality constraints."""
    rng = np.random.default_rng(11)
    M = np.zeros((36, 36))
    for k in range(4):
        X = rng.standard_normal((9, 9))
        M[9 * k : 9 * k + 9, 9 * k : 9 * k + 9] = X @ X.T + 9 * np.eye(9)
    H = rng.standard_normal((36, 18))
    f = -H.reshape(36, 6, 3)[:, :, 0].sum(axis=1) + rng.standard_normal(36)
    G, b = rng.standard_normal((36, 2)), 0.1 * rng.standard_normal(2)
    return GlobalProblem(sp.csc_array(M), sp.csc_array(H), f, np.zeros(18), rng.uniform(0.1, 0.5, 6), sp.csc_array(G), b)


@pytest.fixture
def error_of() -> Callable[[LocalProblem, np.ndarray], float]:
    """||r - P_K(r - u - g(u))|| / ||q||, contact by contact."""

    def error(p: LocalProblem, r: np.ndarray) -> float:
        W = p.W.toarray() if sp.issparse(p.W) else p.W
        u = W @ r + p.q
        total = 0.0
        for a, m in enumerate(p.mu):
            own = slice(p.dimension * a, p.dimension * (a + 1))
            z = r[own] - u[own]
            z[0] -= m * np.linalg.norm(u[own][1:])
            length = np.linalg.norm(z[1:])
            if m * length <= -z[0]:
                z[:] = 0
            elif length > m * z[0]:
                first = (z[0] + m * length) / (1 + m * m)
                z = np.r_[first, m * first * z[1:] / length]
            total += float(np.sum((r[own] - z) ** 2))
        return float(np.sqrt(total) / np.linalg.norm(p.q))

    return error
