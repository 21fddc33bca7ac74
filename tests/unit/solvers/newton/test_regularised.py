"""The Newton system of regularised problems, against the matrix written out densely."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import scipy.sparse as sp

from fcsim.linear.factors import SingularMatrix
from fcsim.problem import Delassus, LocalProblem, natural_map_residual
from fcsim.solvers.base import Monitor, Status
from fcsim.solvers.newton.systems import choice
from fcsim.solvers.newton.systems.direct import DenseSystem, SparseSystem
from fcsim.solvers.newton.systems.interface import NewtonSystem
from fcsim.solvers.proximal.inner import InnerProblems
from fcsim.solvers.proximal.options import ProximalOptions


def sparse(W: sp.csr_array, d: int) -> NewtonSystem:
    return SparseSystem(Delassus(W, d))


def dense(W: sp.csr_array, d: int) -> NewtonSystem:
    return DenseSystem(Delassus(W.toarray(), d))


STORAGES = pytest.mark.parametrize("shifted_system", [sparse, dense])


def system(d: int, nc: int = 12, seed: int = 0) -> tuple[sp.csr_array, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """An unsymmetric block-sparse W without the diagonal block of contact 2, a shift, A with two open contacts, B and rhs."""
    rng = np.random.default_rng(seed)
    blocks = (rng.random((nc, nc)) < 0.3) | np.eye(nc, dtype=bool)
    blocks[2, 2] = False
    W = sp.csr_array(np.kron(blocks, np.ones((d, d))) * rng.standard_normal((nc * d, nc * d)))
    A, B = rng.standard_normal((2, nc, d, d))
    A[[3, 7]], B[[3, 7]] = 0, np.eye(d)
    return W, 1 + rng.random(nc), A, B, rng.standard_normal((nc, d))


@STORAGES
@pytest.mark.parametrize("d", [2, 3])
def test_solves_the_matrix_written_out(d: int, shifted_system: Callable[[sp.csr_array, int], NewtonSystem]) -> None:
    W, shift, A, B, rhs = system(d)
    first = shifted_system(W, d)
    for factor in (1.0, 1e-3):  # the second shift replaces the first
        own = first.shifted(factor * shift)
        shifted = W.toarray() + np.diag(np.repeat(factor * shift, d))
        J = np.zeros_like(shifted)
        for a in range(len(shift)):
            J[d * a : d * a + d] = A[a] @ shifted[d * a : d * a + d]
            J[d * a : d * a + d, d * a : d * a + d] += B[a]
        dr, du = own.solve(A, B, rhs)
        assert np.allclose(J @ dr, rhs.ravel(), rtol=0, atol=1e-10 * np.linalg.cond(J))
        assert np.allclose(du, shifted @ dr, rtol=0, atol=1e-10 * np.abs(du).max())
        assert np.array_equal(dr.reshape(-1, d)[[3, 7]], rhs[[3, 7]])
        assert np.allclose(own.operator.diagonal_blocks, [shifted[d * a : d * a + d, d * a : d * a + d] for a in range(len(shift))])


@STORAGES
def test_all_contacts_open(shifted_system: Callable[[sp.csr_array, int], NewtonSystem]) -> None:
    W, _, A, B, rhs = system(3)
    dr, du = shifted_system(W, 3).solve(0 * A, 0 * B + np.eye(3), rhs)
    assert np.array_equal(dr, rhs.ravel())
    assert np.allclose(du, W @ dr)


@STORAGES
def test_singular_matrix_is_said(shifted_system: Callable[[sp.csr_array, int], NewtonSystem]) -> None:
    W, _, A, B, rhs = system(3)
    with pytest.raises(SingularMatrix):
        shifted_system(0 * W, 3).solve(A, 0 * B, rhs)


@pytest.mark.parametrize("storage", ["sparse", "dense", "dense and large"])
def test_solution_of_the_regularised_problem(storage: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """r solves K* ∋ (W + alpha D)(r) + q - alpha D r_k + g ⊥ r ∈ K, for rank-deficient W, D with the mean where a block is zero."""
    rng = np.random.default_rng(3)
    nc, d, alpha, mu = 10, 3, 0.5, 0.6
    H = rng.standard_normal((12, nc * d))
    H[:, :d] = 0  # a contact between two held bodies
    W, q, centre = H.T @ H, rng.standard_normal(nc * d), rng.random(nc * d)
    if storage == "dense and large":
        monkeypatch.setattr(choice, "ONCE_WHOLE", 0)
    problem = LocalProblem(sp.csr_array(W) if storage == "sparse" else W, q, np.full(nc, mu))
    inner = InnerProblems(problem, Monitor(q, problem.mu, d, 1e-12), ProximalOptions(metric="compliance"))
    found, _ = inner.solve(centre, centre, alpha, 1e-12, 100)
    assert found.status is Status.SOLVED
    D = np.array([np.trace(W[d * a : d * a + d, d * a : d * a + d]) / d for a in range(nc)])
    D[0] = D[1:].mean()
    u = (W @ found.r + q + alpha * np.repeat(D, d) * (found.r - centre)).reshape(-1, d)
    r = found.r.reshape(-1, d)
    slip = np.linalg.norm(u[:, 1:], axis=1)
    assert (u[:, 0] >= -1e-9).all() and (np.linalg.norm(r[:, 1:], axis=1) <= mu * r[:, 0] + 1e-9).all()
    assert np.abs(r[:, 0] * u[:, 0]).max() <= 1e-9
    assert np.abs((r[:, 1:] * u[:, 1:]).sum(axis=1) + mu * r[:, 0] * slip).max() <= 1e-9


def test_a_rho_that_adapts_solves_many_that_a_constant_one_leaves() -> None:
    """Three contacts of very different compliance: the natural map of the regularised problem, recomputed here, judges."""
    left = recovered = 0
    for seed in range(150):
        rng = np.random.default_rng(seed)
        root = rng.standard_normal((9, 9)) * 10 ** rng.uniform(-1, 1, 9)
        W, q, mu = root @ root.T + 1e-3 * np.eye(9), rng.standard_normal(9), np.full(3, 0.8)
        problem, watch = LocalProblem(W, q, mu), Monitor(q, mu, 3, 1e-9)
        shift = 1e-3 * np.repeat([np.trace(W[3 * a : 3 * a + 3, 3 * a : 3 * a + 3]) / 3 for a in range(3)], 3)

        def solved(adaptive: bool, problem: LocalProblem = problem, watch: Monitor = watch, shift: np.ndarray = shift) -> bool:
            rho = {"rho": "adaptive"} if adaptive else {"rho": "split spectral norm", "rho_factor": 10.0}
            inner = InnerProblems(problem, watch, ProximalOptions(metric="compliance", internal_options=rho))
            found, _ = inner.solve(np.zeros(9), np.zeros(9), 1e-3, 1e-9, 15)
            error = natural_map_residual(found.r, problem.W @ found.r + shift * found.r + problem.q, problem.mu)
            claimed = found.status is Status.SOLVED
            assert not claimed or error <= 1.001e-9 * np.linalg.norm(problem.q)
            return claimed

        if not solved(adaptive=False):
            left += 1
            recovered += solved(adaptive=True)
    assert left >= 10 and recovered >= left / 3
