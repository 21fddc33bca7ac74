"""The Newton system of regularised problems, against the matrix written out densely."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from fcsim.linear import SingularMatrix
from fcsim.problem import LocalProblem
from fcsim.solvers.base import Monitor, Status
from fcsim.solvers.regularised import RegularisedNewton, ShiftedSystem


def system(d: int, nc: int = 12, seed: int = 0) -> tuple[sp.csr_array, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """An unsymmetric block-sparse W without the diagonal block of contact 2, a shift, A with two open contacts, B and rhs."""
    rng = np.random.default_rng(seed)
    blocks = (rng.random((nc, nc)) < 0.3) | np.eye(nc, dtype=bool)
    blocks[2, 2] = False
    W = sp.csr_array(np.kron(blocks, np.ones((d, d))) * rng.standard_normal((nc * d, nc * d)))
    A, B = rng.standard_normal((2, nc, d, d))
    A[[3, 7]], B[[3, 7]] = 0, np.eye(d)
    return W, 1 + rng.random(nc), A, B, rng.standard_normal((nc, d))


@pytest.mark.parametrize("d", [2, 3])
def test_solves_the_matrix_written_out(d: int) -> None:
    W, shift, A, B, rhs = system(d)
    own = ShiftedSystem(W, d)
    for factor in (1.0, 1e-3):  # the second shift replaces the first
        own.regularise(factor * shift)
        shifted = W.toarray() + np.diag(np.repeat(factor * shift, d))
        J = np.zeros_like(shifted)
        for a in range(len(shift)):
            J[d * a : d * a + d] = A[a] @ shifted[d * a : d * a + d]
            J[d * a : d * a + d, d * a : d * a + d] += B[a]
        dr, du = own.solve(A, B, rhs)
        assert np.allclose(J @ dr, rhs.ravel(), rtol=0, atol=1e-10 * np.linalg.cond(J))
        assert np.allclose(du, shifted @ dr, rtol=0, atol=1e-10 * np.abs(du).max())
        assert np.array_equal(dr.reshape(-1, d)[[3, 7]], rhs[[3, 7]])
        assert np.allclose(own.diagonal_blocks, [shifted[d * a : d * a + d, d * a : d * a + d] for a in range(len(shift))])


def test_all_contacts_open() -> None:
    W, _, A, B, rhs = system(3)
    dr, du = ShiftedSystem(W, 3).solve(0 * A, 0 * B + np.eye(3), rhs)
    assert np.array_equal(dr, rhs.ravel())
    assert np.allclose(du, W @ dr)


def test_singular_matrix_is_said() -> None:
    W, _, A, B, rhs = system(3)
    with pytest.raises(SingularMatrix):
        ShiftedSystem(0 * W, 3).solve(A, 0 * B, rhs)


@pytest.mark.parametrize("dense", [False, True])
def test_solution_of_the_regularised_problem(dense: bool) -> None:
    """r solves K* ∋ (W + alpha D)(r) + q - alpha D r_k + g ⊥ r ∈ K, for rank-deficient W, D with the mean where a block is zero."""
    rng = np.random.default_rng(3)
    nc, d, alpha, mu = 10, 3, 0.5, 0.6
    H = rng.standard_normal((12, nc * d))
    H[:, :d] = 0  # a contact between two held bodies
    W, q, centre = H.T @ H, rng.standard_normal(nc * d), rng.random(nc * d)
    problem = LocalProblem(W if dense else sp.csr_array(W), q, np.full(nc, mu))
    found, _ = RegularisedNewton(problem).solve(centre, alpha, 1e-12, "AC", Monitor(q, problem.mu, d, 1e-12))
    assert found.status is Status.SOLVED
    D = np.array([np.trace(W[d * a : d * a + d, d * a : d * a + d]) / d for a in range(nc)])
    D[0] = D[1:].mean()
    u = (W @ found.r + q + alpha * np.repeat(D, d) * (found.r - centre)).reshape(-1, d)
    r = found.r.reshape(-1, d)
    slip = np.linalg.norm(u[:, 1:], axis=1)
    assert (u[:, 0] >= -1e-9).all() and (np.linalg.norm(r[:, 1:], axis=1) <= mu * r[:, 0] + 1e-9).all()
    assert np.abs(r[:, 0] * u[:, 0]).max() <= 1e-9
    assert np.abs((r[:, 1:] * u[:, 1:]).sum(axis=1) + mu * r[:, 0] * slip).max() <= 1e-9
