"""The block Cholesky factorisation beside NumPy's dense algebra, on patterns that are chains, meshes, stars, random or in pieces."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.linear import _elimination_tree_kernels as kernels
from fcsim.linear.block_factors.analysis import PADDING, Analysis
from fcsim.linear.block_factors.cholesky import BlockCholesky
from fcsim.linear.elimination_tree import elimination_tree, minimum_degree
from fcsim.linear.factors import SingularMatrix


def grid(k: int) -> np.ndarray:
    line = np.eye(k, k=1) + np.eye(k, k=-1)
    return np.kron(line, np.eye(k)) + np.kron(np.eye(k), line)


def star(n: int) -> np.ndarray:
    pattern = np.zeros((n, n))
    pattern[n // 2] = pattern[:, n // 2] = 1
    return pattern


def scattered(n: int, density: float) -> np.ndarray:
    pattern = np.random.default_rng(n).random((n, n)) < density
    return (pattern | pattern.T).astype(float)


PATTERNS = {
    "one": np.ones((1, 1)),
    "diagonal": np.zeros((7, 7)),
    "chain": np.eye(30, k=1) + np.eye(30, k=-1),
    "grid": grid(9),
    "star": star(20),
    "full": np.ones((13, 13)),
    "sparse": scattered(60, 0.03),
    "denser": scattered(40, 0.15),
    "pieces": np.kron(np.eye(5), scattered(12, 0.2)),
}


def matrix(pattern: np.ndarray, d: int) -> np.ndarray:
    """A symmetric positive definite matrix with blocks (d, d) on the pattern and the diagonal."""
    n, rng = len(pattern), np.random.default_rng(d)
    A = rng.standard_normal((n * d, n * d)) * np.kron((pattern != 0) | np.eye(n, dtype=bool), np.ones((d, d)))
    A = A + A.T
    return A + np.diag(np.abs(A).sum(axis=1) + 0.1)


def stored(A: np.ndarray, d: int) -> sp.bsr_array:
    return sp.bsr_array(A, blocksize=(d, d))


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("name", PATTERNS)
def test_solution_is_that_of_dense_algebra(name: str, d: int) -> None:
    A = matrix(PATTERNS[name], d)
    W, b = stored(A, d), np.random.default_rng(1).standard_normal(len(A))
    analysis = Analysis(W)
    for shift in (0.0, 2.5):  # one analysis serves every shift
        x = BlockCholesky(analysis, W.data, shift).solve(b)
        assert_allclose(x, np.linalg.solve(A + shift * np.eye(len(A)), b), rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("padding", [0.0, PADDING])
@pytest.mark.parametrize("name", PATTERNS)
def test_structure_is_that_of_the_dense_factor(name: str, padding: float) -> None:
    """A front's border holds the factor's rows below it, those of its last column exactly; without padding no front holds a zero."""
    A = matrix(PATTERNS[name], 1)
    W = stored(A, 1)
    tree = elimination_tree(W.indptr.astype(np.int64), W.indices.astype(np.int64), padding)
    assert_array_equal(np.sort(tree.order), np.arange(len(A)))
    # entries that vanish only by cancellation do not occur in a matrix with random entries
    L = np.linalg.cholesky(A[np.ix_(tree.order, tree.order)])
    filled = np.abs(L) > 1e-14 * L.diagonal()
    for f in range(len(tree)):
        begin, end = tree.first[f : f + 2]
        border = tree.rows[tree.starts[f] : tree.starts[f + 1]]
        assert_array_equal(border, end + np.flatnonzero(filled[end:, end - 1]))
        for j in range(begin, end):
            below = end + np.flatnonzero(filled[end:, j])
            assert set(below) <= set(border)
            assert padding or (len(below) == len(border) and filled[j:end, j].all())
    assert tree.first[0] == 0 and tree.first[-1] == len(A) and np.all(np.diff(tree.first) > 0)


def test_a_subtree_is_consecutive_in_postorder() -> None:
    parent = np.array([3, 3, 4, 6, 6, 6, -1, 8, -1])
    order = kernels.postorder(parent)
    place = np.argsort(order)
    descendants = {j: {j} for j in range(9)}
    for j in range(9):
        if parent[j] >= 0:
            descendants[parent[j]] |= descendants[j]
    for j, below in descendants.items():
        assert {int(place[k]) for k in below} == set(range(int(place[j]) - len(below) + 1, int(place[j]) + 1))


def test_ordering_keeps_the_fill_small() -> None:
    W = stored(matrix(star(200), 1), 1)
    pattern = W.indptr.astype(np.int64), W.indices.astype(np.int64)
    assert np.flatnonzero(minimum_degree(*pattern) == 100)[0] >= 198  # the centre goes last, but for a tie: no fill at all
    tree = elimination_tree(*pattern, 0.0)
    assert len(tree.rows) + sum(n * (n - 1) // 2 for n in np.diff(tree.first)) == 199


@pytest.mark.parametrize("d", [1, 3])
def test_indefinite_and_singular_matrices_are_refused(d: int) -> None:
    A = matrix(grid(5), d)
    least = float(np.linalg.eigvalsh(A)[0])
    W = stored(A, d)
    analysis = Analysis(W)
    BlockCholesky(analysis, W.data, -0.9 * least)
    with pytest.raises(SingularMatrix, match="positive definite"):
        BlockCholesky(analysis, W.data, -1.1 * least)
    for bad in (np.nan, np.inf):
        blocks = W.data.copy()
        blocks[0] = bad
        with pytest.raises(SingularMatrix):
            BlockCholesky(analysis, blocks)


def test_zeros_stored_on_one_side_only() -> None:
    """What assembly leaves behind where entries cancel: half of the random places have no mirror image."""
    d, n = 2, 30
    A = matrix(grid(5)[:25, :25], d)
    A = np.block([[A, np.zeros((50, 10))], [np.zeros((10, 50)), np.eye(10)]])
    rows, columns = np.random.default_rng(4).integers(0, n, (2, 40))
    marked = A.copy().reshape(n, d, n, d)
    marked[rows, 0, columns, 0] += 7.0
    W = stored(marked.reshape(n * d, n * d), d)
    place = np.repeat(np.arange(n), np.diff(W.indptr)), W.indices
    W.data[:] = A.reshape(n, d, n, d)[place[0], :, place[1], :]
    assert any(np.all(block == 0) for block in W.data)
    assert_allclose(BlockCholesky(Analysis(W), W.data).solve(np.ones(n * d)), np.linalg.solve(A, np.ones(n * d)), rtol=1e-11)


def test_the_callers_matrix_stays_as_it_is() -> None:
    W = stored(matrix(grid(4), 3), 3)
    before = W.copy()
    BlockCholesky(Analysis(W), W.data, 1.0).solve(np.ones(48))
    assert_array_equal(W.data, before.data)
    assert_array_equal(W.indices, before.indices)
