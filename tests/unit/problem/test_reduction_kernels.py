"""Connected components against SciPy's, blocks against slices of the dense matrix."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose, assert_array_equal
from scipy.sparse import csgraph

from fcsim.problem._reduction_kernels import asymmetry, block_of, connected_components, equal_blocks


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("n", [0, 1, 12, 300])
def test_connected_components(n: int, seed: int) -> None:
    """Of unsymmetric patterns, with long chains in any order, empty rows and single unknowns."""
    rng = np.random.default_rng(seed)
    A = sp.random_array((n, n), density=min(1, 0.8 / max(n, 1)), rng=rng, format="csr")
    chain = rng.permutation(n)[: n // 4]
    A = sp.csr_array(A + sp.coo_array((np.ones(max(len(chain) - 1, 0)), (chain[:-1], chain[1:])), shape=(n, n)))
    order, start, place = connected_components(A.indptr, A.indices)
    assert_array_equal(np.sort(order), np.arange(n))
    label = np.empty(n, dtype=np.int64)
    for c, (begin, end) in enumerate(pairwise(start)):
        own = order[begin:end]
        assert_array_equal(own, np.sort(own))
        assert_array_equal(place[own], np.arange(len(own)))
        label[own] = c
    count, expected = csgraph.connected_components(A, directed=False) if n else (0, label)
    assert len(start) - 1 == count
    assert len(set(zip(label, expected, strict=True))) == count  # the same partition
    assert_array_equal(np.sort(order[start[:-1]]), order[start[:-1]])


def kinds_of(*blocks: np.ndarray, tolerance: float) -> tuple[list[int], bool]:
    A = sp.csr_array(sp.block_diag([sp.csr_array(block) for block in blocks]))
    A.sort_indices()
    components = connected_components(A.indptr, A.indices)
    kind, exact = equal_blocks(A.indptr, A.indices, A.data, *components, np.diff(components[1]) > 1, tolerance)
    return kind.tolist(), exact


def test_kinds_of_blocks() -> None:
    rng = np.random.default_rng(0)
    A = rng.standard_normal((5, 5))
    late, missing = A.copy(), A.copy()
    late[4, 4] += 1e-6
    missing[2, 3] = 0
    other = rng.standard_normal((5, 5))
    three, four = np.ones((3, 3)), np.ones((4, 4))
    assert kinds_of(A, other, np.eye(1), A, tolerance=1e-13) == ([0, 1, -1, 0], True)
    assert kinds_of(A, late, missing, late, missing, A, tolerance=1e-13) == ([0, 1, 2, 1, 2, 0], True)
    assert kinds_of(A, late, missing, tolerance=1e-5) == ([0, 0, 1], False)
    assert kinds_of(missing, A, tolerance=1e-5) == ([0, 1], True)
    assert kinds_of(missing, A, tolerance=10) == ([0, 0], False)
    assert kinds_of(three, four, three, tolerance=1) == ([0, 1, 0], True)


@pytest.mark.parametrize("kind", [sp.csr_array, sp.csc_array])
def test_block_in_another_order(kind: type) -> None:
    rng = np.random.default_rng(1)
    A = kind(np.where(rng.random((9, 9)) < 0.5, rng.standard_normal((9, 9)), 0))
    place, own = np.arange(9), np.array([7, 0, 4, 5, 2, 8, 1, 3, 6])
    starts, indices, values = block_of(A.indptr, A.indices, A.data, own, place)
    assert_array_equal(kind((values, indices, starts), shape=(9, 9)).toarray(), A.toarray()[np.ix_(own, own)])
    assert_array_equal(place[own], np.arange(9))


def test_asymmetry() -> None:
    A = sp.csr_array(np.array([[0.0, 2.0, 0.0], [2.5, -5.0, 0.0], [0.0, 1e-9, 1.0]]))
    assert_allclose(asymmetry(A.indptr, A.indices, A.data, A.toarray()), 0.1)
    A = sp.csr_array(A.toarray() * [[1, 1.25, 1], [1, 1, 1], [1, 1, 1]])
    assert_allclose(asymmetry(A.indptr, A.indices, A.data, A.toarray()), 1e-9 / 5)
    assert asymmetry(A.indptr, A.indices, 0 * A.data, 0 * A.toarray()) == 0
