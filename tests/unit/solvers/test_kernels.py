"""Numba kernels beside their NumPy twins: the one-contact solvers and the Gauss-Seidel sweep."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose

from fcsim.solvers._kernels import newton_alart_curnier, project_de_saxce, sweep_alart_curnier
from fcsim.solvers.formulations import alart_curnier
from fcsim.solvers.gauss_seidel import block_rows


def law_residual(r: np.ndarray, u: np.ndarray, mu: float) -> float:
    """How far (r, u) is from Coulomb's law, from its text: signs, cone, complementarity, direction of sliding."""
    r_T, u_T = np.linalg.norm(r[1:]), np.linalg.norm(u[1:])
    return max(-u[0], -r[0], r_T - mu * r[0], abs(u[0] * r[0]), np.linalg.norm(u_T * r[1:] + mu * r[0] * u[1:]))


def newton_twin(W: np.ndarray, q: np.ndarray, mu: float, rho: np.ndarray, r: np.ndarray) -> np.ndarray:
    for _ in range(50):
        F, A, B = (x[0] for x in alart_curnier((W @ r + q)[None], r[None], np.array([mu]), rho[None]))
        if np.linalg.norm(F) <= 1e-13:
            return r
        r = r - np.linalg.solve(A @ W + B, F)
    raise AssertionError("the twin did not converge")


def one_contact(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, float, np.ndarray]:
    X = 0.4 * rng.standard_normal((3, 3))
    W = X @ X.T + np.diag([1.0, 1.0, 1.5])
    rho = np.r_[1 / W[0, 0], [1 / np.linalg.eigvalsh(W[1:, 1:])[-1]] * 2]
    return W, rng.standard_normal(3) * [2, *rng.choice([0.2, 2.0], 2)], float(rng.choice([0.0, 0.1, 0.3, 0.5])), rho


def test_newton_on_one_contact() -> None:
    rng, zones = np.random.default_rng(0), {"open": 0, "stick": 0, "slip": 0}
    for _ in range(300):
        W, q, mu, rho = one_contact(rng)
        *r, solved = newton_alart_curnier(W, *q, mu, rho[0], rho[1], 0.0, 0.0, 0.0, 1e-13, 50)
        r = np.array(r)
        assert solved
        u = W @ r + q
        assert law_residual(r, u, mu) < 1e-11
        assert_allclose(r, newton_twin(W, q, mu, rho, np.zeros(3)), atol=1e-11)
        zones["open" if r[0] == 0 else "stick" if np.linalg.norm(u) < 1e-10 else "slip"] += 1
    assert min(zones.values()) > 20


def test_de_saxce_fixed_point_on_one_contact() -> None:
    rng = np.random.default_rng(1)
    for _ in range(100):
        W, q, mu, rho = one_contact(rng)
        *r, solved = project_de_saxce(W, *q, mu, 0.5 / np.linalg.norm(W, 2), 0.0, 0.0, 0.0, 1e-14, 20_000)
        assert solved
        assert law_residual(np.array(r), W @ np.array(r) + q, mu) < 1e-11
        assert_allclose(r, newton_twin(W, q, mu, rho, np.zeros(3)), atol=1e-10)


def test_unsolvable_local_iteration_is_told() -> None:
    W = np.diag([1.0, 1.0, 1.0])
    assert not newton_alart_curnier(W, -1.0, 5.0, 0.0, 0.5, 1.0, 1.0, 0.0, 0.0, 0.0, 1e-14, 0)[3]
    assert not newton_alart_curnier(0 * W, -1.0, 0.0, 0.0, 0.5, 1.0, 1.0, 0.0, 0.0, 0.0, 1e-14, 20)[3]
    assert not project_de_saxce(W, -1.0, 5.0, 0.0, 0.5, 0.1, 0.0, 0.0, 0.0, 1e-14, 2)[3]


@pytest.mark.parametrize("storage", ["dense", "block sparse"])
def test_one_sweep(storage: str) -> None:
    rng = np.random.default_rng(2)
    nc = 8
    H = 0.4 * rng.standard_normal((30, 3 * nc)) * np.kron(rng.random((30, nc)) < 0.5, np.ones(3))
    W = H.T @ H + np.eye(3 * nc)
    q, mu = 2 * rng.standard_normal((nc, 3)), rng.uniform(0, 0.5, nc)
    diagonal = np.array([W[3 * a : 3 * a + 3, 3 * a : 3 * a + 3] for a in range(nc)])
    rho = np.array([[1 / D[0, 0], 1 / np.linalg.eigvalsh(D[1:, 1:])[-1]] for D in diagonal])
    start = np.abs(rng.standard_normal((nc, 3)))
    order = rng.permutation(nc)
    r = start.copy()
    rows = block_rows(W if storage == "dense" else sp.bsr_array(W, blocksize=(3, 3)), 3)
    change, size, failures = sweep_alart_curnier(*rows, diagonal, q, mu, rho, order, r, 1e-14, 50)
    expected = start.copy()
    for a in order:
        own = slice(3 * a, 3 * a + 3)
        others = W[own] @ expected.ravel() - diagonal[a] @ expected[a] + q[a]
        expected[a] = newton_twin(diagonal[a], others, mu[a], np.r_[rho[a], rho[a, 1]], expected[a])
    assert_allclose(r, expected, atol=1e-10)
    assert_allclose(change, np.sum((r - start) ** 2))
    assert_allclose(size, np.sum(r**2))
    assert failures <= nc


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("storage", ["dense", "csr", "bsr"])
def test_block_rows(storage: str, d: int) -> None:
    rng = np.random.default_rng(3)
    nc = 5
    pattern = (rng.random((nc, nc)) < 0.4) | np.eye(nc, dtype=bool)
    W = rng.standard_normal((nc * d, nc * d)) * np.kron(pattern, np.ones((d, d)))
    given = {"dense": W, "csr": sp.csr_array(W), "bsr": sp.bsr_array(W, blocksize=(d, d))}[storage]
    indptr, indices, blocks = block_rows(given, d)
    back = sp.bsr_array((blocks, indices, indptr), shape=(3 * nc, 3 * nc)).toarray().reshape(nc, 3, nc, 3)
    assert_allclose(back[:, :d, :, :d].reshape(nc * d, nc * d), W, atol=0)
    if d == 2:  # the added tangent is coupled to nothing
        assert_allclose(back[:, 2, :, 2], np.eye(nc), atol=0)
        assert not back[:, 2, :, :2].any() and not back[:, :2, :, 2].any()
