"""W as a sum over bodies against dense products H_b^T C H_b of the same matrices."""

from __future__ import annotations

from itertools import pairwise
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.linear import storage
from fcsim.linear.factors import mirror
from fcsim.problem import delassus_sum
from fcsim.problem._delassus_kernels import entries_by_body, union_of_neighbours
from fcsim.problem._reduction_kernels import added_to_own_blocks, alike_in_contacts
from fcsim.problem.delassus_sum import DelassusSum


def dense(matrix: Any) -> np.ndarray:
    return matrix.toarray() if sp.issparse(matrix) else np.asarray(matrix)


def contact_matrix(n: int, nc: int, d: int, rng: np.random.Generator) -> sp.csr_array:
    """Contacts on few unknowns each, in some rows only; the first contact and the first unknown touch nothing."""
    H = rng.standard_normal((n, nc * d)) * np.repeat(rng.random((n, nc)) < 0.25, d, axis=1) * (rng.random((n, nc * d)) < 0.7)
    H[:, :d], H[0] = 0, 0
    return sp.csr_array(H)


@pytest.mark.parametrize("stored", ["dense", "by rows", "by rows where few blocks are there"])
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("symmetric", [True, False])
@pytest.mark.parametrize("nc", [1, 4, 45])
def test_sum_of_the_bodies_shares(monkeypatch: pytest.MonkeyPatch, stored: str, d: int, symmetric: bool, nc: int) -> None:
    """Five bodies of two kinds and three diagonal ones, their unknowns in any order; some unknowns have no body."""
    if stored != "dense":
        monkeypatch.setattr(storage, "SPARSE_FROM", 0)
        monkeypatch.setattr(storage, "SUM_UP_TO" if stored == "by rows" else "SUM_FILLED", 0 if stored == "by rows" else 1.1)
    rng = np.random.default_rng(nc)
    size, kind, group = 7, np.array([1, 0, 1, 1, 0]), np.array([0, 3, 4, 9])
    bodies = [np.arange(k * size, (k + 1) * size) for k in range(5)] + [35 + np.arange(*ends) for ends in pairwise(group)]
    n = 35 + 9 + 4
    shuffle = rng.permutation(n)
    C = rng.standard_normal((2, size, size))
    C = C + C.transpose(0, 2, 1) if symmetric else C
    diagonal = rng.standard_normal(9)
    H = contact_matrix(n, nc, d, rng)
    body, column, inverse = np.full(n, -1), np.zeros(n, dtype=np.int64), np.zeros((n, n))
    for number, own in enumerate(bodies):
        body[shuffle[own]], column[shuffle[own]] = number, np.arange(len(own))
        share = C[kind[number]] if number < 5 else np.diag(diagonal[own - 35])
        inverse[np.ix_(shuffle[own], shuffle[own])] = share
    W = DelassusSum(H, body, column, len(bodies), d)
    W.add(0, C, kind, symmetric=symmetric)
    W.add_diagonal(5, diagonal, group)
    found, expected = W.matrix(), H.toarray().T @ inverse @ H.toarray()
    assert sp.issparse(found) == (stored != "dense")
    assert_allclose(dense(found), expected, rtol=0, atol=1e-12 * max(np.abs(expected).max(), 1))
    if sp.issparse(found):
        assert found.blocksize == (d, d)
        assert found.has_sorted_indices and found.indices.dtype == np.int32
        assert len(found.indices) == np.count_nonzero(shared_bodies(H, body, len(bodies), d))


def shared_bodies(H: sp.csr_array, body: np.ndarray, count: int, d: int) -> np.ndarray:
    """How many bodies two contacts share (nc, nc)."""
    touches = (H.toarray() != 0).reshape(H.shape[0], -1, d).any(axis=2).astype(int)
    of_body = np.array([touches[body == b].any(axis=0) for b in range(count)]).astype(int)
    return of_body.T @ of_body


def test_entries_of_h_stored_twice_are_summed() -> None:
    H = sp.csc_array((np.array([1.0, 2.0, 4.0]), np.array([0, 0, 1]), np.array([0, 2, 3])), shape=(2, 2))
    W = DelassusSum(H, np.zeros(2, dtype=np.int64), np.arange(2), 1, 2)
    W.add(0, np.array([[[2.0, 1.0], [1.0, 3.0]]]), np.zeros(1, dtype=np.int64))
    assert_allclose(W.matrix(), [[18, 12], [12, 48]])


@pytest.mark.parametrize("d", [2, 3])
def test_contacts_of_one_pattern_are_sorted_by_bodies_as_any_others(d: int) -> None:
    """H whose columns of a contact have the same rows, against the same H with a zero more in a row that no other column has."""
    rng, n, nc = np.random.default_rng(0), 60, 25
    rows = [np.sort(rng.choice(n - 1, 8, replace=False)) for _ in range(nc)]
    H = sp.csc_array((rng.standard_normal(8 * d * nc), np.repeat(rows, d, axis=0).ravel(), 8 * np.arange(d * nc + 1)), shape=(n, d * nc))
    body, column = np.append(np.sort(rng.integers(-1, 6, n - 1)), -1), np.arange(n)
    indptr = H.indptr + np.arange(d * nc + 1) // d
    last = indptr[d::d] - 1
    data, indices = np.zeros(indptr[-1]), np.full(indptr[-1], n - 1)
    others = np.delete(np.arange(indptr[-1]), last)
    data[others], indices[others] = H.data, H.indices
    for some in (np.arange(nc), np.array([1, 2, 5, 17, 24])):
        found = entries_by_body(H.indptr, H.indices, H.data, body, column, 6, d, some)
        for x, y in zip(found, entries_by_body(indptr, indices, data, body, column, 6, d, some), strict=True):
            assert_array_equal(x, y)
        own = sp.csc_array(H[:, (d * some[:, None] + np.arange(d)).ravel()])  # of some contacts: as of H without the others
        for x, y in zip(found, entries_by_body(own.indptr, own.indices, own.data, body, column, 6, d, np.arange(len(some))), strict=True):
            assert_array_equal(x, y)


def test_pattern_of_block_rows() -> None:
    """Contacts 0, 2, 5 on a body, 2, 3 on another, 1 on none, 4 alone."""
    starts, columns = union_of_neighbours(np.array([0, 3, 3, 5, 6]), np.array([0, 2, 5, 2, 3, 4]), 6)
    rows = [columns[a:b].tolist() for a, b in pairwise(starts)]
    assert rows == [[0, 2, 5], [], [0, 2, 3, 5], [2, 3], [4], [0, 2, 5]]


@pytest.mark.parametrize("d", [2, 3])
def test_neighbours_alike_in_contacts_are_one_group(d: int) -> None:
    """Unknowns 0, 1 touch contacts 0 and 2 (in different rows), 2 none, 3 and 5 contact 1, 4 contacts 1 and 2."""
    H = np.zeros((6, 3 * d))
    H[0, [0, 2 * d]], H[1, [1, 2 * d + 1]], H[[3, 5], d], H[4, [d, 2 * d]] = 1, 1, 1, 1
    H = sp.csc_array(H)
    assert_array_equal(alike_in_contacts(H.indptr, H.indices, 6, np.arange(6), d), [0, 2, 3, 4, 5, 6])
    assert_array_equal(alike_in_contacts(H.indptr, H.indices, 6, np.array([0, 1, 3, 5]), d), [0, 2, 4])
    assert_array_equal(alike_in_contacts(H.indptr, H.indices, 6, np.empty(0, dtype=np.int64), d), [0])


@pytest.mark.parametrize("size", [0, 1, 31, 33, 70])
def test_mirror(size: int) -> None:
    A = np.random.default_rng(0).standard_normal((size, size))
    upper = np.triu(A)
    mirror(A)
    assert_array_equal(A, upper + np.triu(upper, 1).T)


@pytest.mark.parametrize("d", [2, 3])
def test_a_diagonal_is_added_to_own_blocks(d: int) -> None:
    """As a sum of matrices, which leaves out blocks of zeros: with one, or without an own block, nothing is added."""
    rng = np.random.default_rng(d)
    pattern = (rng.random((7, 7)) < 0.4) | np.eye(7, dtype=bool)
    W = sp.bsr_array(np.kron(pattern, np.ones((d, d))) * rng.standard_normal((7 * d, 7 * d)), blocksize=(d, d))
    diagonal = rng.standard_normal(7 * d)
    expected = W.toarray() + np.diag(diagonal)
    assert added_to_own_blocks(W.indptr, W.indices, W.data, diagonal)
    assert np.array_equal(W.toarray(), expected)
    W.data[2] = 0.0
    before = W.data.copy()
    assert not added_to_own_blocks(W.indptr, W.indices, W.data, diagonal)
    bare = sp.bsr_array(np.kron(np.ones((7, 7)) - np.eye(7), np.ones((d, d))), blocksize=(d, d))
    assert not added_to_own_blocks(bare.indptr, bare.indices, bare.data, diagonal)
    assert np.array_equal(W.data, before) and np.all(bare.data == 1.0)


@pytest.mark.parametrize(("d", "told"), ((2, False), (3, False), (3, True)))
def test_h_of_other_values_in_the_same_places_follows_them(monkeypatch: pytest.MonkeyPatch, d: int, told: bool) -> None:
    """Entry by entry beside H itself, zeros' signs too where a contact's columns are alike, also after H of other places; told: where it is
    known that places are those of the last H, nobody compares them."""
    monkeypatch.setattr(delassus_sum, "ENTRIES_FROM", 1)
    rng, n, nc, bodies = np.random.default_rng(3), 24, 9, 4
    body, column = np.repeat(np.arange(bodies), n // bodies), np.tile(np.arange(n // bodies), bodies)
    body[body == 2] = -1  # without a share in W
    before: object = None
    for _ in range(2):
        kept = [object(), object()]
        alike = np.repeat(rng.random((n, nc)) < 0.3, d, axis=1)
        alike[:, : 2 * d] &= rng.random((n, 2 * d)) < 0.7  # of two contacts each column has other rows
        for turn in range(5):
            some = np.array([0, 2, 3, 7]) if turn == 3 else np.arange(nc)
            dense = np.where(alike, rng.choice([-0.0, 1.5, -2.0, 3.25], (n, nc * d)), 0.0)
            rows, columns = np.nonzero(alike)
            H = sp.csc_array((dense[rows, columns], (rows, columns)), shape=dense.shape)
            H.sum_duplicates()
            kept_as = kept[turn == 3] if told else None
            with patch.object(np, "array_equal", wraps=np.array_equal) as compared:
                W = DelassusSum(H, body, column, bodies, d, some=some, kept_as=kept_as)
            first, contacts, begins, unknowns, weights = W.bodies
            assert not compared.called or kept_as is None or kept_as is not before
            before = kept_as
            expected = entries_by_body(H.indptr, H.indices, H.data, body, column, bodies, d, some)
            assert weights.tobytes() == expected[4].tobytes()  # signs of zeros
            found = np.zeros((bodies, n // bodies, len(some) * d))
            for b in range(bodies):
                for p in range(first[b], first[b + 1]):
                    own = slice(begins[p], begins[p + 1])
                    found[b, unknowns[own], d * contacts[p] : d * contacts[p] + d] = weights[own, :d]
            wanted = dense.reshape(bodies, -1, nc, d)[:, :, some].reshape(bodies, -1, len(some) * d)
            assert np.array_equal(found[[0, 1, 3]], wanted[[0, 1, 3]]) and not found[2].any()
