"""The block LU factorisation beside NumPy's dense algebra, on all contacts and on some of them."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose

from fcsim.linear.block_factors import _lu_kernels as kernels
from fcsim.linear.block_factors._single_factor_kernels import factorise_single, sign_single
from fcsim.linear.block_factors._single_kernels import solve_single
from fcsim.linear.block_factors.analysis import Analysis, analysed
from fcsim.linear.block_factors.lu import BlockLU
from fcsim.linear.factors import SingularMatrix
from fcsim.problem.shifted_factor import complete_rows


def grid(k: int) -> np.ndarray:
    line = np.eye(k, k=1) + np.eye(k, k=-1)
    return np.kron(line, np.eye(k)) + np.kron(np.eye(k), line)


def scattered(n: int, density: float) -> np.ndarray:
    """A pattern that is not symmetric, and without some diagonal entries."""
    return (np.random.default_rng(n).random((n, n)) < density).astype(float)


PATTERNS = {
    "one": np.ones((1, 1)),
    "diagonal": np.eye(7),
    "chain": np.eye(30, k=1) + np.eye(30, k=-1),
    "grid": grid(12),
    "full": np.ones((50, 50)),
    "sparse": scattered(60, 0.03),
    "denser": scattered(40, 0.15),
    "pieces": np.kron(np.eye(5), scattered(12, 0.2)),
}


def matrix(pattern: np.ndarray, d: int) -> np.ndarray:
    """An unsymmetric matrix, regular whatever rows and columns are taken from it: its diagonal blocks are dominant, though their
    diagonals are not."""
    n, rng = len(pattern), np.random.default_rng(d)
    A = rng.standard_normal((n * d, n * d)) * np.kron(pattern != 0, np.ones((d, d)))
    turned = np.roll(np.eye(d), 1, axis=1)  # so that rows must be exchanged for d > 1
    return A + np.kron(np.eye(n), 3 * np.abs(A).sum(axis=1).max() * turned + 0.1 * turned)


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("name", PATTERNS)
def test_solution_is_that_of_dense_algebra(name: str, d: int) -> None:
    A, rng = matrix(PATTERNS[name], d), np.random.default_rng(0)
    rows = complete_rows(sp.csr_array(A), d)
    assert_allclose(rows.toarray(), A, atol=0)
    analysis, n = Analysis(rows), len(A) // d
    for active in (np.ones(n, dtype=bool), rng.random(n) < 0.6, rng.random(n) < 0.1, np.zeros(n, dtype=bool)):
        b = rng.standard_normal(n * d)
        x = BlockLU(analysis, rows.data, active).solve(b)
        own = np.repeat(active, d)
        assert_allclose(A[np.ix_(own, own)] @ x[own], b[own], rtol=0, atol=1e-11)
        assert not x[~own].any()
    assert_allclose(A @ BlockLU(analysis, rows.data).solve(b), b, rtol=0, atol=1e-11)


@pytest.mark.parametrize("seed", range(20))
def test_fronts_without_active_contacts_pass_on_what_waits_for_them(seed: int) -> None:
    """Whatever contacts are left out of a mesh, whose tree has many branches."""
    rng = np.random.default_rng(seed)
    A = matrix(grid(14), 2)
    rows = complete_rows(A, 2)
    active = rng.random(196) < rng.uniform(0.05, 0.95)
    own, b = np.repeat(active, 2), rng.standard_normal(392)
    x = BlockLU(Analysis(rows), rows.data, active).solve(b)
    assert_allclose(A[np.ix_(own, own)] @ x[own], b[own], rtol=0, atol=1e-11)


@pytest.mark.parametrize(("n", "n1"), [(1, 1), (7, 3), (40, 40), (90, 70), (130, 50)])
def test_eliminated_front(n: int, n1: int) -> None:
    """P F = L U on the first rows and columns and the complement on the rest, by NumPy; 130 is updated by BLAS."""
    F = np.random.default_rng(n).standard_normal((n, n))
    own, rest = slice(n1), slice(n1, n)
    complement = F[rest, rest] - F[rest, own] @ np.linalg.solve(F[own, own], F[own, rest])
    out, pivots = F.copy(), np.empty(n1, dtype=np.int64)
    assert kernels.eliminate(out, n1, pivots)
    exchanged = F[own].copy()
    for k, p in enumerate(pivots):
        assert k <= p < n1
        exchanged[[k, p]] = exchanged[[p, k]]
    L, U = np.tril(out[own, own], -1) + np.eye(n1), np.triu(out[own, own])
    assert_allclose(L @ U, exchanged[:, own], atol=1e-11)
    assert np.abs(L).max() == 1.0
    assert_allclose(L @ out[own, rest], exchanged[:, rest], atol=1e-11)
    assert_allclose(out[rest, own] @ U, F[rest, own], atol=1e-10)
    assert_allclose(out[rest, rest], complement, rtol=1e-9, atol=1e-9)


def test_a_front_without_a_pivot_is_said() -> None:
    A = matrix(grid(3), 2)
    A[6:8] = 0
    rows = complete_rows(A, 2)
    with pytest.raises(SingularMatrix, match="singular"):
        BlockLU(Analysis(rows), rows.data)
    A[6:8] = np.nan
    rows = complete_rows(A, 2)
    with pytest.raises(SingularMatrix):
        BlockLU(Analysis(rows), rows.data)


def test_a_pattern_is_analysed_once() -> None:
    """The factors of a matrix by the analysis of its pattern, whichever were asked for between."""
    rng = np.random.default_rng(5)
    patterns = [sp.csr_array(grid(k) + np.eye(k * k)) for k in range(3, 9)]
    for pattern in (*patterns, patterns[0], patterns[-1]):
        pattern.sort_indices()
        analysis = analysed(pattern.indptr, pattern.indices)
        assert analysed(pattern.indptr.copy(), pattern.indices.copy()) is analysis
        values = rng.standard_normal(pattern.nnz)
        A = sp.csr_array((values, pattern.indices, pattern.indptr), shape=pattern.shape) + 8 * sp.eye_array(pattern.shape[0])
        x = rng.standard_normal(pattern.shape[0])
        A = sp.csr_array(A)
        A.sort_indices()
        assert_allclose(BlockLU(analysis, A.data.reshape(-1, 1, 1)).solve(A @ x), x, atol=1e-10)


@pytest.mark.parametrize("name", PATTERNS)
def test_solutions_of_single_unknowns_are_those_of_dense_algebra(name: str) -> None:
    """Rows are exchanged within fronts; right sides with few numbers, which pass over most fronts, too."""
    A, rng = matrix(PATTERNS[name], 1), np.random.default_rng(0)
    A = A * rng.choice([0.01, 1.0], len(A), p=[0.2, 0.8])[:, None]  # so that rows are exchanged in fronts of several columns
    rows, n = complete_rows(sp.csr_array(A), 1), len(A)
    analysis = Analysis(rows)
    order, first, starts, below, offsets = analysis.fronts
    values, borders, pivots = np.empty(offsets[-1]), np.empty(int(np.diff(first) @ np.diff(starts))), np.empty(n, dtype=np.int64)
    given = analysis.plan, first, starts, offsets
    assert factorise_single(*given, rows.data.ravel(), values, borders, pivots)
    assert sign_single(first, starts, offsets, values, pivots) == np.linalg.slogdet(A)[0]
    few = np.zeros(n)
    few[rng.integers(n)] = 1.0
    for b in (rng.standard_normal(n), few):
        x = np.full(n, np.nan)
        solve_single(order, first, starts, below, offsets, values, borders, pivots, b, np.empty(n), np.empty(n), x)
        assert_allclose(A @ x, b, rtol=0, atol=1e-11)
    for nothing in (0.0, np.nan):
        assert not factorise_single(*given, nothing * rows.data.ravel(), values, borders, pivots)
