"""Factorisations: all agree with dense algebra, refuse singular matrices and leave nothing behind in PETSc."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose

from fcsim import runtime
from fcsim.linear import factors as linear
from fcsim.linear import storage
from fcsim.linear.factors import DenseCholesky, DenseLU, Mumps, SingularMatrix, SuperLU, factorise

needs_petsc = pytest.mark.skipif(not runtime.has_petsc(), reason="petsc4py is not installed")
SPARSE = [SuperLU, pytest.param(Mumps, marks=needs_petsc)]


def random_matrix(n: int, seed: int, *, symmetric: bool = False) -> sp.csr_array:
    A = sp.random_array((n, n), density=0.1, rng=np.random.default_rng(seed), format="csr")
    A = A + A.T if symmetric else A
    return sp.csr_array(A + sp.diags_array(np.full(n, 1.0 + 0.3 * n)))


@pytest.mark.parametrize("method", [DenseCholesky, DenseLU, *SPARSE])
@pytest.mark.parametrize("columns", [None, 1, 4])
def test_solves_like_dense_algebra(method: type, columns: int | None) -> None:
    A = random_matrix(40, 0, symmetric=True)
    rhs = np.random.default_rng(1).standard_normal((40,) if columns is None else (40, columns))
    given = rhs.copy()
    factor = method(A if method in (SuperLU, Mumps) else A.toarray())
    x = factor.solve(rhs)
    assert x.shape == rhs.shape
    assert_allclose(x, np.linalg.solve(A.toarray(), rhs), rtol=1e-11, atol=1e-13)
    assert_allclose(rhs, given, atol=0)
    assert factor.name


@needs_petsc
@pytest.mark.parametrize("blocks", [1, 2, 4])
def test_sparse_cholesky(blocks: int) -> None:
    A = random_matrix(40, 2, symmetric=True)
    rhs = np.random.default_rng(3).standard_normal((40, 2))
    given = sp.bsr_array(A, blocksize=(blocks, blocks)) if blocks > 1 else A
    factor = Mumps(given, positive_definite=True)
    assert_allclose(factor.solve(rhs), np.linalg.solve(A.toarray(), rhs), rtol=1e-11, atol=1e-13)
    factor.refactor(2 * given)
    assert_allclose(factor.solve(rhs), np.linalg.solve(2 * A.toarray(), rhs), rtol=1e-11, atol=1e-13)
    shifted = sp.csr_array(A - 1.01 * np.linalg.eigvalsh(A.toarray())[0] * sp.eye_array(40))
    with pytest.raises(SingularMatrix, match="not positive definite: 1 negative pivots"):
        Mumps(shifted, positive_definite=True)


@needs_petsc
def test_compressed_factors_are_as_accurate_as_said() -> None:
    n = 26  # smaller ones have no front large enough to be compressed
    line = sp.diags_array([-np.ones(n - 1), np.full(n, 2.1), -np.ones(n - 1)], offsets=[-1, 0, 1])
    A = sp.csr_array(sp.kronsum(sp.kronsum(line, line), line))
    x = np.random.default_rng(8).standard_normal(n**3)
    factors = {accuracy: Mumps(A, positive_definite=True, compression=accuracy) for accuracy in (0.0, 1e-9, 1e-3)}
    error = {accuracy: np.abs(factor.solve(A @ x) - x).max() for accuracy, factor in factors.items()}
    assert error[0.0] < 1e-12 < error[1e-9] < 1e-7 < error[1e-3] < 0.1


def test_symmetry() -> None:
    A = random_matrix(40, 2, symmetric=True)
    assert linear.is_symmetric(A) and linear.is_symmetric(sp.bsr_array(A, blocksize=(2, 2))) and linear.is_symmetric(A.toarray())
    B = A.tolil()
    B[3, 5] += 1e-6
    assert not linear.is_symmetric(B.tocsr())


@pytest.mark.parametrize("method", [DenseLU, *SPARSE])
def test_unsymmetric_matrix(method: type) -> None:
    A = random_matrix(30, 3)
    rhs = np.arange(30.0)
    factor = method(A if method in (SuperLU, Mumps) else A.toarray())
    assert_allclose(factor.solve(rhs), np.linalg.solve(A.toarray(), rhs), rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("method", SPARSE)
def test_saddle_point_matrix_without_diagonal(method: type) -> None:
    """[[M, -G], [-G^T, 0]] as equality constraints make it: indefinite, no entry on part of the diagonal."""
    rng = np.random.default_rng(4)
    M, G = random_matrix(20, 5, symmetric=True), sp.csr_array(rng.standard_normal((20, 3)))
    A = sp.block_array([[M, -G], [-G.T, None]], format="csr")
    rhs = rng.standard_normal(23)
    assert_allclose(method(A).solve(rhs), np.linalg.solve(A.toarray(), rhs), rtol=1e-9, atol=1e-12)


@needs_petsc
def test_refactor_takes_new_values_on_the_same_pattern() -> None:
    A = random_matrix(30, 6)
    factor = Mumps(A)
    factor.solve(np.ones(30))
    B = A.copy()
    B.data = B.data * np.random.default_rng(7).uniform(0.5, 1.5, B.nnz)
    factor.refactor(B)
    assert_allclose(factor.solve(np.ones(30)), np.linalg.solve(B.toarray(), np.ones(30)), rtol=1e-11)


@pytest.mark.parametrize("method", [DenseCholesky, DenseLU, *SPARSE])
def test_singular_matrix_is_refused(method: type) -> None:
    A = np.diag([2.0, 1.0, 0.0, 3.0])
    with pytest.raises(SingularMatrix, match="size 4"):
        method(sp.csr_array(A) if method in (SuperLU, Mumps) else A)


@needs_petsc
def test_refactor_refuses_a_singular_matrix() -> None:
    A = sp.csr_array(np.array([[2.0, 1.0], [1.0, 3.0]]))
    factor = Mumps(A)
    with pytest.raises(SingularMatrix):
        factor.refactor(sp.csr_array(np.array([[1.0, 1.0], [1.0, 1.0]])))


def test_cholesky_refuses_an_indefinite_matrix() -> None:
    with pytest.raises(SingularMatrix, match="positive definite"):
        DenseCholesky(np.array([[1.0, 2.0], [2.0, 1.0]]))


@needs_petsc
def test_no_option_is_left_in_the_global_database() -> None:
    PETSc = runtime.petsc()
    before = PETSc.Options().getAll()
    Mumps(random_matrix(20, 8)).solve(np.ones(20))
    with pytest.raises(SingularMatrix):
        Mumps(sp.csr_array(np.diag([1.0, 0.0])))
    assert PETSc.Options().getAll() == before


def test_factorise_chooses_by_size(monkeypatch: pytest.MonkeyPatch) -> None:
    A, rhs = random_matrix(50, 9, symmetric=True), np.arange(50.0)
    expected = np.linalg.solve(A.toarray(), rhs)
    assert isinstance(factorise(A), DenseLU)
    assert isinstance(factorise(A, positive_definite=True), DenseCholesky)
    monkeypatch.setattr(storage, "BLOCK_UP_TO", 10)
    assert isinstance(factorise(A), Mumps if runtime.has_petsc() else SuperLU)
    assert_allclose(factorise(A).solve(rhs), expected, rtol=1e-11, atol=1e-13)
    monkeypatch.setattr(runtime, "has_petsc", lambda: False)
    assert isinstance(factorise(A), SuperLU)
    assert_allclose(factorise(A).solve(rhs), expected, rtol=1e-11, atol=1e-13)
    assert isinstance(factorise(A.toarray()), DenseLU)  # a dense matrix stays dense


@pytest.mark.parametrize("positive_definite", [False, True])
def test_a_matrix_without_rows_is_factored_in_silence(positive_definite: bool, capfd: pytest.CaptureFixture[str]) -> None:
    """LAPACK writes "illegal value" past Python's streams: links between bodies that supports hold leave such a matrix."""
    factor = factorise(sp.csr_array((0, 0)), positive_definite=positive_definite)
    assert factor.solve(np.empty((0, 3))).shape == (0, 3)
    assert capfd.readouterr() == ("", "")
